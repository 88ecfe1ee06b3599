"""A differential drive in pybullet: open or closed loop along a plan, with wheel slip measured at
the contact.

Beside the roller-level engines, whose contract is made for four wheels with rollers. The floor is
flat, or carries the ramps of a path problem (rounded as the plan knows them) and walls.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from trajopt.arrays import Array, fold, require_positive
from trajopt.control.tracking import Tracker
from trajopt.errors import ArgumentError, SimulationError
from trajopt.simulate.engine import GRAVITY
from trajopt.simulate.pybullet import load_bullet
from trajopt.systems.powerbot.model import DriveRobot, drive_urdf
from trajopt.timing.trajectory import Trajectory
from trajopt.world.ramp import Ramp

_STRIP = 0.05  # m between the ramp mesh's edges across its rounded parts; chosen
_RAMP_WIDTH = 12.0  # m, chosen: wider than any path over it
_WALL_HEIGHT = 0.5  # m, chosen
_STIFFNESS = 4e5  # N/m, chosen: a wheel gives way by 1 mm
_DAMPING = 6e3  # N s/m, chosen: a little below critical
_SETTLE = 0.5  # s at rest before the start
_EXPLODED = 20.0  # m/s; no robot of this kind is that fast


@dataclass(frozen=True)
class Wall:
    """A wall from ``start`` to ``end`` (x, y), m."""

    start: tuple[float, float]
    end: tuple[float, float]
    thickness: float = 0.1  # m


@dataclass(frozen=True)
class Floor:
    """``friction`` of the drive wheels on it, ramps and walls."""

    friction: float
    ramps: tuple[Ramp, ...] = ()
    walls: tuple[Wall, ...] = ()

    def __post_init__(self) -> None:
        require_positive("friction", self.friction, "(coefficient)")


@dataclass(frozen=True)
class DriveOptions:
    """Time ``step`` (s), ``control`` (s) between commands, solver iterations; all chosen."""

    step: float = 0.002
    control: float = 0.02
    iterations: int = 100

    def __post_init__(self) -> None:
        if not 0 < self.step <= self.control:
            raise ArgumentError("step", self.step, f"a time in (0, {self.control}] s")


@dataclass(frozen=True, eq=False)
class DriveRecord:
    """Every ``control`` seconds: ``times`` (N,), ``pose`` (N, 3), ``speed`` (N,) along the heading,
    ``planned`` (N, 3) poses and ``planned_speed`` (N,); ``slip`` (N, 2) speed of each drive wheel's
    contact point over the floor, m/s (largest since the record before); ``load`` (N, 4) normal
    forces, N (drive left, right, caster left, right; means); ``pitch`` (N,) rad; ``touched``
    whether a wall was met."""

    times: Array
    pose: Array
    speed: Array
    planned: Array
    planned_speed: Array
    slip: Array
    load: Array
    pitch: Array
    touched: bool

    @property
    def slip_ratio(self) -> float:
        """Root mean square of the wheels' slip over that of the speed."""
        return slip_share(self.slip, self.speed)

    @property
    def goal_offset(self) -> float:
        """m between the last pose and the plan's."""
        return float(np.hypot(*(self.pose[-1] - self.planned[-1])[:2]))

    @property
    def final_heading_error(self) -> float:
        """rad."""
        return float(abs(fold(self.pose[-1, 2] - self.planned[-1, 2])))

    @property
    def heading_error(self) -> float:
        """Root mean square, rad."""
        return float(np.sqrt(np.mean(fold(self.pose[:, 2] - self.planned[:, 2]) ** 2)))

    @property
    def speed_error(self) -> float:
        """Root mean square, m/s (eq. 3.10 of [waheed2006])."""
        return float(np.sqrt(np.mean((self.speed - self.planned_speed) ** 2)))


def drive_in_pybullet(
    trajectory: Trajectory,
    robot: DriveRobot,
    floor: Floor,
    *,
    tracker: Tracker | None = None,
    options: DriveOptions | None = None,
    faster: float = 1.0,
    start_error: Sequence[float] = (0.0, 0.0, 0.0),
) -> DriveRecord:
    """Drive the plan in Bullet: closed loop with a ``tracker``, open loop without.

    ``faster`` runs the plan's time by that factor quicker: forces grow with its square.
    ``start_error`` is in the body frame (m, m, rad). Raises MissingDependencyError without
    pybullet, SimulationError when the numbers leave physics, ArgumentError for a factor that is not
    positive.
    """
    require_positive("faster", faster, "(factor)")
    options = DriveOptions() if options is None else options
    start = trajectory.at(0.0).pose[0]
    cos, sin = np.cos(start[2]), np.sin(start[2])
    start += [
        cos * start_error[0] - sin * start_error[1],
        sin * start_error[0] + cos * start_error[1],
        start_error[2],
    ]
    with drive_session(robot, floor, options, start) as session:
        return _drive(session, trajectory, robot, tracker, options, faster)


@contextmanager
def drive_session(
    robot: DriveRobot, floor: Floor, options: DriveOptions, start: Array
) -> Iterator[DriveSession]:
    """A robot that has come to rest on the floor at ``start`` (3,): x, y (m), yaw (rad).

    Raises MissingDependencyError without pybullet.
    """
    bullet = load_bullet()
    client = bullet.connect(bullet.DIRECT)
    try:
        session = _session(bullet, client, robot, floor, options, start)
        for _ in range(round(_SETTLE / options.step)):
            session.advance(0.0, 0.0)
        yield session
    finally:
        bullet.disconnect(client)


@dataclass(frozen=True, eq=False)
class DriveSession:
    """A running simulation of one robot in Bullet."""

    bullet: Any
    client: int
    body: int
    ground: tuple[int, ...]
    walls: tuple[int, ...]
    robot: DriveRobot
    joints: tuple[int, int, int, int]

    def interval(
        self, before: tuple[float, float], after: tuple[float, float], steps: int
    ) -> tuple[Array, Array, bool]:
        """One control interval: left and right wheel speed (m/s) go evenly from ``before`` to
        ``after``, since a jump would tear the wheels loose. Largest slip (2,) of the drive wheels,
        m/s, mean loads (4,), N, and whether a wall was met. Raises SimulationError when the numbers
        leave physics."""
        slip, load, touched = np.zeros(2), np.zeros(4), False
        for i in range(steps):
            share = (i + 0.5) / steps
            self.advance(*(a + share * (b - a) for a, b in zip(before, after, strict=True)))
            now, force, met = self.contacts()
            slip, load, touched = np.maximum(slip, now), load + force / steps, touched or met
        pose, speed, _ = self.pose()
        if not np.all(np.isfinite(pose)) or abs(speed) > _EXPLODED:
            raise SimulationError(f"the robot moves at {speed:.3g} m/s: not physics any more")
        return slip, load, touched

    def advance(self, left: float, right: float) -> None:
        radius = self.robot.radius
        self.bullet.setJointMotorControlArray(
            self.body,
            self.joints[:2],
            self.bullet.VELOCITY_CONTROL,
            targetVelocities=[left / radius, right / radius],
            forces=[self.robot.torque_limit] * 2,
            physicsClientId=self.client,
        )
        self.bullet.stepSimulation(physicsClientId=self.client)

    def pose(self) -> tuple[Array, float, float]:
        """x, y, yaw of the body origin; speed along the heading; pitch."""
        where, attitude = self.bullet.getBasePositionAndOrientation(
            self.body, physicsClientId=self.client
        )
        linear, angular = self.bullet.getBaseVelocity(self.body, physicsClientId=self.client)
        rotation = np.array(self.bullet.getMatrixFromQuaternion(attitude)).reshape(3, 3)
        arm = rotation @ -np.array(self.robot.chassis_cog)
        origin = np.array(where) + arm
        velocity = np.array(linear) + np.cross(angular, arm)
        yaw = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
        return (
            np.array([origin[0], origin[1], yaw]),
            float(velocity @ rotation[:, 0]),
            float(-np.arcsin(np.clip(rotation[2, 0], -1.0, 1.0))),
        )

    def contacts(self) -> tuple[Array, Array, bool]:
        """Slip speed of the two drive wheels (m/s), loads of wheels and casters (N), whether a wall
        is met."""
        slip, load, touched = np.zeros(2), np.zeros(4), False
        for point in self.bullet.getContactPoints(bodyA=self.body, physicsClientId=self.client):
            other, link, force = point[2], point[3], point[9]
            if force <= 0:
                continue
            if other in self.walls:
                touched = True
            if link not in self.joints or other in self.walls:
                continue
            wheel = self.joints.index(link)
            load[wheel] += force
            if wheel < 2:
                state = self.bullet.getLinkState(
                    self.body, link, computeLinkVelocity=1, physicsClientId=self.client
                )
                arm = np.array(point[5]) - np.array(state[0])
                velocity = np.array(state[6]) + np.cross(state[7], arm)
                normal = np.array(point[7])
                slip[wheel] = max(
                    slip[wheel], float(np.linalg.norm(velocity - (velocity @ normal) * normal))
                )
        return slip, load, touched


def _drive(
    session: DriveSession,
    trajectory: Trajectory,
    robot: DriveRobot,
    tracker: Tracker | None,
    options: DriveOptions,
    faster: float,
) -> DriveRecord:
    width = 2 * abs(robot.platform.body.contacts[0][1])
    substeps = max(round(options.control / options.step), 1)
    total = trajectory.duration / faster
    count = int(np.ceil((total + (tracker.settle if tracker else 0.3)) / options.control))
    times = options.control * np.arange(count + 1, dtype=np.float64)
    at = trajectory.at(np.minimum(times * faster, trajectory.duration))
    twist = at.twist * faster * (times < total)[:, None]
    planned_speed = at.twist[:, 0] * faster * (times < total)
    poses, speeds, slips, loads, pitches, touched = [], [], [], [], [], False
    slip, load, last = np.zeros(2), np.zeros(4), (0.0, 0.0)
    for k in range(count + 1):
        pose, speed, pitch = session.pose()
        poses.append(pose)
        speeds.append(speed)
        slips.append(slip)
        loads.append(load)
        pitches.append(pitch)
        if k == count:
            break
        v, w = float(twist[k + 1, 0]), float(twist[k + 1, 2])  # reached at the end of the interval
        order = (
            (v - w * width / 2, v + w * width / 2)
            if tracker is None
            else tracker.wheel_speeds(at.pose[k], (v, w), pose, width)
        )
        slip, load, met = session.interval(last, order, substeps)
        last, touched = order, touched or met
    pose_array = np.array(poses)
    pose_array[:, 2] = np.unwrap(pose_array[:, 2])
    return DriveRecord(
        times,
        pose_array,
        np.array(speeds),
        at.pose,
        planned_speed,
        np.array(slips),
        np.array(loads),
        np.array(pitches),
        touched,
    )


def _session(
    bullet: Any, client: int, robot: DriveRobot, floor: Floor, options: DriveOptions, start: Array
) -> DriveSession:
    bullet.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=client)
    bullet.setPhysicsEngineParameter(
        fixedTimeStep=options.step,
        numSolverIterations=options.iterations,
        contactBreakingThreshold=0.005,
        enableFileCaching=0,
        deterministicOverlappingPairs=1,
        physicsClientId=client,
    )
    plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=client)
    ground = [bullet.createMultiBody(0.0, plane, physicsClientId=client)]
    ground += [_ramp(bullet, client, ramp) for ramp in floor.ramps]
    walls = [_wall(bullet, client, wall) for wall in floor.walls]
    for solid in (*ground, *walls):
        bullet.changeDynamics(
            solid, -1, lateralFriction=1.0, restitution=0.0, physicsClientId=client
        )
    x, y, yaw = (float(value) for value in start)
    cog = robot.chassis_cog
    z = cog[2] + sum(float(r.height_at(np.array([x]), np.array([y]))[0]) for r in floor.ramps)
    with tempfile.TemporaryDirectory(prefix="trajopt-") as folder:
        file = FilePath(folder) / "drive.urdf"
        file.write_text(drive_urdf(robot), encoding="utf-8")
        body = int(
            bullet.loadURDF(
                str(file),
                basePosition=(x + np.cos(yaw) * cog[0], y + np.sin(yaw) * cog[0], z + 1e-4),
                baseOrientation=bullet.getQuaternionFromEuler((0.0, 0.0, yaw)),
                flags=bullet.URDF_USE_INERTIA_FROM_FILE,
                physicsClientId=client,
            )
        )
    names = {
        bullet.getJointInfo(body, j, physicsClientId=client)[1].decode(): j
        for j in range(bullet.getNumJoints(body, physicsClientId=client))
    }
    joints = tuple(names[n] for n in ("wheel_left", "wheel_right", "caster_left", "caster_right"))
    for link in range(-1, len(names)):
        friction = floor.friction if link in joints[:2] else 0.0
        bullet.changeDynamics(
            body, link, linearDamping=0.0, angularDamping=0.0, physicsClientId=client
        )
        bullet.changeDynamics(
            body, link, jointDamping=0.0, maxJointVelocity=1e3, physicsClientId=client
        )
        bullet.changeDynamics(
            body,
            link,
            lateralFriction=friction,
            spinningFriction=0.0,
            rollingFriction=0.0,
            restitution=0.0,
            physicsClientId=client,
        )
        if (
            link in joints
        ):  # equally stiff, so that the four contacts share the load as the limits assume
            bullet.changeDynamics(
                body,
                link,
                contactStiffness=_STIFFNESS,
                contactDamping=_DAMPING,
                physicsClientId=client,
            )
    return DriveSession(
        bullet,
        client,
        body,
        tuple(ground),
        tuple(walls),
        robot,
        (joints[0], joints[1], joints[2], joints[3]),
    )


def _ramp(bullet: Any, client: int, ramp: Ramp) -> int:
    """The ramp and the floor behind it as strips of triangles, with the plan's rounding."""
    half = ramp.rounding / 2
    edge = np.linspace(-half, half, max(int(np.ceil(ramp.rounding / _STRIP)), 2) + 1)
    d = np.concatenate([[-0.5], edge, ramp.run + edge, [ramp.run + 20.0]])
    cos, sin = np.cos(ramp.direction), np.sin(ramp.direction)
    x, y = ramp.place[0] + d * cos, ramp.place[1] + d * sin
    z = ramp.height_at(x, y)
    z[0] -= 1e-3  # the foot lies under the plane
    side = _RAMP_WIDTH / 2
    vertices = [
        [a - s * side * sin, b + s * side * cos, c]
        for a, b, c in zip(x, y, z, strict=True)
        for s in (1, -1)
    ]
    faces = []
    for i in range(len(d) - 1):
        faces += [2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 1, 2 * i + 3, 2 * i + 2]
    shape = bullet.createCollisionShape(
        bullet.GEOM_MESH,
        vertices=vertices,
        indices=faces,
        flags=bullet.GEOM_FORCE_CONCAVE_TRIMESH,
        physicsClientId=client,
    )
    return int(bullet.createMultiBody(0.0, shape, physicsClientId=client))


def _wall(bullet: Any, client: int, wall: Wall) -> int:
    a, b = np.asarray(wall.start), np.asarray(wall.end)
    along, middle = b - a, (a + b) / 2
    shape = bullet.createCollisionShape(
        bullet.GEOM_BOX,
        halfExtents=[float(np.hypot(*along)) / 2, wall.thickness / 2, _WALL_HEIGHT / 2],
        physicsClientId=client,
    )
    turned = bullet.getQuaternionFromEuler((0.0, 0.0, float(np.arctan2(along[1], along[0]))))
    return int(
        bullet.createMultiBody(
            0.0, shape, -1, (*middle.tolist(), _WALL_HEIGHT / 2), turned, physicsClientId=client
        )
    )


def slip_share(slip: Array, speed: Array) -> float:
    """Root mean square of ``slip`` over that of ``speed``, both m/s."""
    return float(np.sqrt(np.mean(slip**2)) / np.sqrt(np.mean(speed**2)))
