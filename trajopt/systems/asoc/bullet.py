"""The robot on split offset casters in Bullet, on a height field."""

from __future__ import annotations

import importlib.metadata
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError, SimulationError
from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.simulate.pybullet import load_bullet
from trajopt.systems.asoc.modules import AsocGeometry
from trajopt.systems.asoc.reference import Reference
from trajopt.systems.asoc.run import (
    ALPHA_DAMPING,
    PIVOT_GAIN,
    STEP,
    AsocBody,
    AsocRun,
    AsocState,
    run_asoc,
)
from trajopt.systems.asoc.tracking import Knowledge
from trajopt.world.height_map import HeightMap

BREAKING = 0.001  # m; Bullet's 20 mm keep contacts in the air
PIVOT_TORQUE = 20.0  # N m at most of driven pivots, chosen
MOST_POINTS = 250_000  # of a height field; Bullet copies them through Python, chosen


def asoc_in_pybullet(
    geometry: AsocGeometry,
    ground: HeightMap,
    reference: Reference,
    *,
    friction: float = 0.6,
    driven_pivots: bool = False,
    knowledge: Knowledge | None = None,
) -> AsocRun:
    """Drive the robot along ``reference`` on ``ground``, everything known unless ``knowledge`` says
    otherwise. Raises ArgumentError (also for a ground of more than 250,000 points), SimulationError
    (explosion, tip-over) and MissingDependencyError without pybullet."""
    if ground.heights.size > MOST_POINTS:
        raise ArgumentError(
            "ground", ground.heights.shape, f"at most {MOST_POINTS} points in Bullet; crop the map"
        )
    bullet = load_bullet()
    robot = AsocBody(geometry, friction, driven_pivots)
    client = bullet.connect(bullet.DIRECT)
    if client < 0:
        raise SimulationError("pybullet could not open another physics client in this process")
    try:
        session = _session(bullet, client, robot, ground, reference)
        version = importlib.metadata.version("pybullet")
        return run_asoc(
            session, robot, ground, reference, label=("pybullet", version), knowledge=knowledge
        )
    finally:
        bullet.disconnect(client)


def _session(
    bullet: Any, client: int, robot: AsocBody, ground: HeightMap, reference: Reference
) -> _Session:
    bullet.setGravity(0.0, 0.0, -STANDARD_GRAVITY, physicsClientId=client)
    bullet.setPhysicsEngineParameter(
        fixedTimeStep=STEP,
        numSolverIterations=50,
        enableConeFriction=0,
        contactBreakingThreshold=BREAKING,
        enableFileCaching=0,
        deterministicOverlappingPairs=1,
        physicsClientId=client,
    )
    floor = _ground(bullet, client, ground)
    bullet.changeDynamics(
        floor, -1, lateralFriction=1.0, physicsClientId=client
    )  # Bullet multiplies
    place, velocity = reference.at(0.0)
    reach = np.linspace(-1.0, 1.0, 41)
    lift = float(ground.height(place[0] + reach[:, None], place[1] + reach[None, :]).max())
    with tempfile.TemporaryDirectory(prefix="trajopt-") as folder:
        path = Path(folder) / "asoc.urdf"
        path.write_text(asoc_urdf(robot), encoding="utf-8")
        body = bullet.loadURDF(
            str(path),
            basePosition=(*place, robot.body_height + lift),
            flags=bullet.URDF_USE_INERTIA_FROM_FILE | bullet.URDF_USE_IMPLICIT_CYLINDER,
            physicsClientId=client,
        )
    names = [
        bullet.getJointInfo(body, k, physicsClientId=client)[1].decode()
        for k in range(bullet.getNumJoints(body, physicsClientId=client))
    ]
    for joint in range(
        -1, len(names)
    ):  # friction and damping in separate calls: together Bullet drops friction
        bullet.changeDynamics(
            body, joint, linearDamping=0.0, angularDamping=0.0, physicsClientId=client
        )
        bullet.changeDynamics(
            body, joint, jointDamping=0.0, maxJointVelocity=1e4, physicsClientId=client
        )
        bullet.changeDynamics(
            body,
            joint,
            lateralFriction=robot.friction,
            spinningFriction=0.0,
            rollingFriction=0.0,
            restitution=0.0,
            physicsClientId=client,
        )
        if joint >= 0:  # every joint is born with a motor that brakes it
            bullet.setJointMotorControl2(
                body, joint, bullet.VELOCITY_CONTROL, force=0.0, physicsClientId=client
            )
    number = {name: k for k, name in enumerate(names)}
    count = range(robot.geometry.modules)
    for i in count:
        bullet.resetJointState(
            body,
            number[f"alpha{i}"],
            float(np.arctan2(velocity[1], velocity[0])),
            physicsClientId=client,
        )
    return _Session(
        bullet,
        client,
        body,
        floor,
        robot,
        tuple(number[f"lift{i}"] for i in count),
        tuple(number[f"alpha{i}"] for i in count),
        tuple(number[f"beta{i}"] for i in count),
        tuple(number[f"spin{i}{w}"] for i in count for w in (1, 2)),
    )


def _ground(bullet: Any, client: int, ground: HeightMap) -> int:
    """The height field: data are Z[y, x].ravel() with "rows" counting x; Bullet puts the middle of
    its extent and of its heights at the body's origin."""
    rows, columns = ground.heights.shape
    shape = bullet.createCollisionShape(
        bullet.GEOM_HEIGHTFIELD,
        meshScale=[ground.spacing, ground.spacing, 1.0],
        heightfieldData=ground.heights.ravel().tolist(),
        numHeightfieldRows=columns,
        numHeightfieldColumns=rows,
        physicsClientId=client,
    )
    if shape < 0:
        raise SimulationError(
            f"pybullet could not build a height field of {rows} x {columns} points"
        )
    middle = (
        ground.origin[0] + ground.size[0] / 2,
        ground.origin[1] + ground.size[1] / 2,
        float(ground.heights.min() + ground.heights.max()) / 2,
    )
    return int(bullet.createMultiBody(0.0, shape, basePosition=middle, physicsClientId=client))


def asoc_urdf(robot: AsocBody) -> str:
    """The robot as URDF text. Only wheels and plate collide; Bullet keeps a robot's parts from each
    other."""
    x, y, z = robot.body_size
    m = robot.body_mass
    inertia = (m * (y * y + z * z) / 12, m * (x * x + z * z) / 12, m * (x * x + y * y) / 12)
    plate = f'<collision><geometry><box size="{x} {y} {z}"/></geometry></collision>'
    modules = "".join(_module(robot, i) for i in range(robot.geometry.modules))
    return f'<robot name="asoc">{_link("body", m, inertia, plate)}{modules}</robot>'


def _module(robot: AsocBody, i: int) -> str:
    g = robot.geometry
    px, py = g.positions[i]
    ball = (0.4 * robot.link_mass * 0.05**2,) * 3
    rod = robot.link_mass * g.split**2 / 12
    drop = g.wheel_radius - robot.body_height + robot.sag
    across = robot.wheel_mass * (g.wheel_radius**2 / 4 + g.wheel_width**2 / 12)
    spin = robot.wheel_mass * g.wheel_radius**2 / 2
    tyre = (
        f'<collision><origin rpy="1.5707963267948966 0 0"/><geometry><cylinder radius="{g.wheel_radius}" '
        f'length="{g.wheel_width}"/></geometry></collision>'
    )
    parts = [
        _link(f"strut{i}", 0.1, (1e-4, 1e-4, 1e-4)),
        _joint(
            f"lift{i}",
            "prismatic",
            "body",
            f"strut{i}",
            (px, py, drop),
            "0 0 1",
            robot.pivot.travel,
        ),
        _link(f"fork{i}", robot.link_mass - 0.1, ball),
        _joint(f"alpha{i}", "continuous", f"strut{i}", f"fork{i}", (0, 0, 0), "0 0 1"),
        _link(f"axle{i}", robot.link_mass, (rod, 1e-3, rod)),
        _joint(
            f"beta{i}",
            "revolute",
            f"fork{i}",
            f"axle{i}",
            (-g.offset, 0, 0),
            "1 0 0",
            robot.pivot.tilt_range,
        ),
    ]
    for w, side in ((1, -1), (2, 1)):
        parts += [
            _link(f"wheel{i}{w}", robot.wheel_mass, (across, spin, across), tyre),
            _joint(
                f"spin{i}{w}",
                "continuous",
                f"axle{i}",
                f"wheel{i}{w}",
                (0, side * g.split / 2, 0),
                "0 1 0",
            ),
        ]
    return "".join(parts)


def _link(name: str, mass: float, inertia: tuple[float, ...], collision: str = "") -> str:
    xx, yy, zz = inertia
    return (
        f'<link name="{name}"><inertial><mass value="{mass}"/><inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" '
        f'iyz="0" izz="{zz}"/></inertial>{collision}</link>'
    )


def _joint(
    name: str,
    kind: str,
    parent: str,
    child: str,
    place: tuple[float, ...],
    axis: str,
    reach: float = 0.0,
) -> str:
    limit = (
        f'<limit lower="{-reach}" upper="{reach}" effort="1e4" velocity="1e4"/>' if reach else ""
    )
    x, y, z = place
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} {y} {z}"/><axis xyz="{axis}"/>{limit}</joint>'
    )


@dataclass(frozen=True, eq=False)
class _Session:
    """One Bullet client with the robot in it."""

    bullet: Any
    client: int
    body: int
    floor: int
    robot: AsocBody
    lifts: tuple[int, ...]
    alphas: tuple[int, ...]
    betas: tuple[int, ...]
    spins: tuple[int, ...]

    def advance(self, wheel_speeds: Array, pivots: Array) -> None:
        b, c = self.bullet, self.client
        joints = (*self.lifts, *self.alphas)
        states = b.getJointStates(self.body, joints, physicsClientId=c)
        count = len(self.lifts)
        forces = [
            -self.robot.stiffness * (s[0] + self.robot.sag) - self.robot.damping * s[1]
            for s in states[:count]
        ]
        forces += [-ALPHA_DAMPING * s[1] for s in states[count:]]
        b.setJointMotorControlArray(
            self.body, joints, b.TORQUE_CONTROL, forces=forces, physicsClientId=c
        )
        b.setJointMotorControlArray(
            self.body,
            self.spins,
            b.VELOCITY_CONTROL,
            targetVelocities=wheel_speeds.ravel().tolist(),
            forces=[self.robot.torque] * len(self.spins),
            physicsClientId=c,
        )
        if self.robot.driven_pivots:
            tilts = b.getJointStates(self.body, self.betas, physicsClientId=c)
            torque = [
                float(np.clip(PIVOT_GAIN * (want - s[0]) - s[1], -PIVOT_TORQUE, PIVOT_TORQUE))
                for want, s in zip(pivots, tilts, strict=True)
            ]
            b.setJointMotorControlArray(
                self.body, self.betas, b.TORQUE_CONTROL, forces=torque, physicsClientId=c
            )
        b.stepSimulation(physicsClientId=c)

    def state(self) -> AsocState:
        b, c = self.bullet, self.client
        where, attitude = b.getBasePositionAndOrientation(self.body, physicsClientId=c)
        rotation = np.array(b.getMatrixFromQuaternion(attitude), dtype=np.float64).reshape(3, 3)
        alpha = np.array(
            [s[0] for s in b.getJointStates(self.body, self.alphas, physicsClientId=c)]
        )
        spins = np.array(
            [s[1] for s in b.getJointStates(self.body, self.spins, physicsClientId=c)]
        ).reshape(-1, 2)
        touching = {
            point[3]
            for point in b.getContactPoints(self.body, self.floor, physicsClientId=c)
            if point[8] <= BREAKING
        }
        touch = np.array([spin in touching for spin in self.spins]).reshape(-1, 2)
        return AsocState(np.array(where, dtype=np.float64), rotation, alpha, spins, touch)
