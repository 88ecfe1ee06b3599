"""Bullet through pybullet, in a private client for each run.

The robot is a URDF written for this run: base at the chassis' centre of gravity, one continuous
joint a wheel, one a roller. Why the settings are what they are stands beside each option.
"""

from __future__ import annotations

import importlib.metadata
import math
import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.arrays import Array, fold
from trajopt.errors import ArgumentError, MissingDependencyError, SimulationError
from trajopt.simulate.engine import (
    GRAVITY,
    Camera,
    Command,
    Controller,
    Observation,
    Recording,
    SimRobot,
)
from trajopt.simulate.scene import Scene, blocks
from trajopt.simulate.stepping import Pace, drive
from trajopt.simulate.urdf import robot_urdf

# Joints that one Bullet multibody can report; with more, joint states silently read zero
# (measured).
MAX_JOINTS = 121
# Collision filter groups (bits): the robot's parts meet the terrain and never each other.
ROBOT_GROUP, TERRAIN_GROUP = 2, 1
# Bullet stops joints at 100 rad/s unless told otherwise; a roller of 9.5 mm turns at 124 rad/s in
# lateral motion at 3 km/h [rad/s].
MAX_JOINT_SPEED = 1e4
# Rounded margin that Bullet adds around convex hulls of a URDF [m] (gUrdfDefaultCollisionMargin).
HULL_MARGIN = 0.001


@dataclass(frozen=True)
class PyBullet:
    """Options of the Bullet engine (values measured on the LOC8 over 5 m unless said otherwise)."""

    step: float = 0.002  # s; at 10 ms the robot drifts by 5-13 %
    stride: int = 5  # steps between two records; 10 ms, the thesis's step
    solver_iterations: int = 50  # Bullet's default
    contact_breaking_threshold: float = (
        0.001  # m; the default 20 mm keeps contacts of rollers in the air
    )
    contact_erp: float = 0.2  # share of a penetration removed a step; Bullet's default
    wheel_gain: float = 1.0  # share of the wheel speed error removed a step; Bullet's default

    def __post_init__(self) -> None:
        """Raise ArgumentError for options that Bullet cannot use."""
        Pace(self.step, self.stride)
        if self.solver_iterations < 1:
            raise ArgumentError("solver_iterations", self.solver_iterations, "at least 1 iteration")
        if not self.contact_breaking_threshold > 0.0:
            raise ArgumentError(
                "contact_breaking_threshold", self.contact_breaking_threshold, "a length in m"
            )
        for name in ("contact_erp", "wheel_gain"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise ArgumentError(name, getattr(self, name), "a share in (0, 1]")

    @property
    def name(self) -> str:
        """Name in the registry."""
        return "pybullet"

    def run(
        self,
        robot: SimRobot,
        scene: Scene,
        command: Command,
        *,
        settle: float = 0.2,
        picture: Camera | None = None,
        controller: Controller | None = None,
    ) -> Recording:
        """Drive ``robot`` through ``scene``; arguments and errors of ``stepping.drive``.

        Also raises MissingDependencyError without pybullet, ArgumentError for a robot with too many
        rollers for one Bullet multibody, SimulationError when Bullet cannot build the robot.
        """
        joints = 4 + sum(len(wheel.rollers) for wheel in robot.wheels)
        if joints > MAX_JOINTS:
            raise ArgumentError(
                "robot.wheels",
                f"{joints} joints",
                f"at most {MAX_JOINTS} wheels and rollers (beyond, Bullet reads zeros)",
            )
        bullet = load_bullet()
        version = importlib.metadata.version("pybullet")
        client = bullet.connect(bullet.DIRECT)
        if client < 0:
            raise SimulationError("pybullet could not open another physics client in this process")
        try:
            session = _session(
                self, bullet, client, robot, scene, command, visible=picture is not None
            )
            return drive(
                session,
                robot,
                command,
                Pace(self.step, self.stride),
                label=(self.name, version),
                settle=settle,
                picture=picture,
                controller=controller,
            )
        finally:
            bullet.disconnect(client)


def load_bullet() -> Any:
    """The pybullet module, loaded without the build time that it prints when first imported.

    Raises MissingDependencyError without pybullet.
    """
    if "pybullet" in sys.modules and sys.modules["pybullet"] is not None:
        return sys.modules["pybullet"]
    sys.stderr.flush()
    kept, silent = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 2)  # the message comes from C, past sys.stderr
    try:
        import pybullet
    except ImportError as error:
        raise MissingDependencyError(
            "pybullet", "simulate", "the physics engine 'pybullet'"
        ) from error
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(silent)
    return pybullet


@dataclass(frozen=True, eq=False)
class _BulletSession:
    """One client with the robot in it; fulfils ``engine.Session``."""

    bullet: Any
    client: int
    body: int
    wheel_joints: tuple[int, ...]
    torque: float
    gain: float
    cog: Array
    angle_offset: Array

    def advance(self, wheel_speeds: Array) -> None:
        """One time step with these wheel speed targets (4,) [rad/s]."""
        self.bullet.setJointMotorControlArray(
            self.body,
            self.wheel_joints,
            self.bullet.VELOCITY_CONTROL,
            targetVelocities=wheel_speeds.tolist(),
            forces=[self.torque] * 4,
            velocityGains=[self.gain] * 4,
            physicsClientId=self.client,
        )
        self.bullet.stepSimulation(physicsClientId=self.client)

    def observe(self) -> Observation:
        """State now."""
        where, attitude = self.bullet.getBasePositionAndOrientation(
            self.body, physicsClientId=self.client
        )
        linear, angular = self.bullet.getBaseVelocity(self.body, physicsClientId=self.client)
        rotation = np.array(self.bullet.getMatrixFromQuaternion(attitude)).reshape(3, 3)
        arm = rotation @ self.cog
        joints = self.bullet.getJointStates(
            self.body, self.wheel_joints, physicsClientId=self.client
        )
        contacts = self.bullet.getContactPoints(bodyA=self.body, physicsClientId=self.client)
        touching = [point[8] for point in contacts if point[9] > 0.0]  # those that carry a force
        return Observation(
            position=np.array(where) - arm,
            rotation=rotation,
            velocity=np.array(linear) - np.cross(angular, arm),
            wheel_angles=np.array([joint[0] for joint in joints]) + self.angle_offset,
            wheel_speeds=np.array([joint[1] for joint in joints]),
            wheel_torques=np.array([joint[3] for joint in joints]),
            contacts=len(touching),
            penetration=max((-depth for depth in touching), default=0.0),
        )

    def render(self, camera: Camera) -> NDArray[np.uint8]:
        """Picture (H, W, 3) by Bullet's own software renderer."""
        seen = self.observe().position
        target = (
            camera.target if camera.target is not None else (float(seen[0]), float(seen[1]), 0.08)
        )
        view = self.bullet.computeViewMatrixFromYawPitchRoll(
            target, camera.distance, math.degrees(camera.yaw), math.degrees(camera.pitch), 0.0, 2
        )
        lens = self.bullet.computeProjectionMatrixFOV(
            45.0, camera.width / camera.height, 0.05, 20.0
        )
        shot = self.bullet.getCameraImage(
            camera.width,
            camera.height,
            view,
            lens,
            lightDirection=(1.0, -1.5, 3.0),
            shadow=1,
            renderer=self.bullet.ER_TINY_RENDERER,
            physicsClientId=self.client,
        )
        image: NDArray[np.uint8] = np.array(shot[2], dtype=np.uint8).reshape(
            camera.height, camera.width, 4
        )
        return image[:, :, :3].copy()


def _session(
    options: PyBullet,
    bullet: Any,
    client: int,
    robot: SimRobot,
    scene: Scene,
    command: Command,
    *,
    visible: bool,
) -> _BulletSession:
    bullet.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=client)
    bullet.setPhysicsEngineParameter(
        fixedTimeStep=options.step,
        numSolverIterations=options.solver_iterations,
        enableConeFriction=0,  # the implicit cone makes rollers creep
        contactBreakingThreshold=options.contact_breaking_threshold,
        erp=options.contact_erp,
        contactERP=options.contact_erp,
        enableFileCaching=0,  # else a robot of the same file name comes back
        deterministicOverlappingPairs=1,
        physicsClientId=client,
    )
    for ground in _terrain(bullet, client, scene, visible=visible):
        _surface(
            bullet, client, ground, -1, friction=1.0
        )  # Bullet multiplies: the rollers carry it all
        bullet.setCollisionFilterGroupMask(
            ground, -1, TERRAIN_GROUP, ROBOT_GROUP, physicsClientId=client
        )
    body = _load(bullet, client, robot, command, visible=visible)
    count = bullet.getNumJoints(body, physicsClientId=client)
    names = [
        bullet.getJointInfo(body, joint, physicsClientId=client)[1].decode()
        for joint in range(count)
    ]
    if count != 4 + sum(len(wheel.rollers) for wheel in robot.wheels):
        raise SimulationError(
            f"pybullet built {count} joints, not those of the robot {robot.name!r}"
        )
    for joint in range(-1, count):
        _surface(bullet, client, body, joint, friction=scene.friction)
        bullet.setCollisionFilterGroupMask(
            body, joint, ROBOT_GROUP, TERRAIN_GROUP, physicsClientId=client
        )
    rollers = [joint for joint, name in enumerate(names) if "roller" in name]
    # every joint is born with a motor that brakes it
    bullet.setJointMotorControlArray(
        body, rollers, bullet.VELOCITY_CONTROL, forces=[0.0] * len(rollers), physicsClientId=client
    )
    wheels = tuple(names.index(f"wheel_{index}") for index in range(4))
    start = np.array(command.start_wheel_angles, dtype=np.float64)
    folded = fold(start)
    for joint, angle in zip(wheels, folded, strict=True):
        bullet.resetJointState(body, joint, float(angle), 0.0, physicsClientId=client)
    cog = np.array([0.0, 0.0, robot.cog_height])
    return _BulletSession(
        bullet, client, body, wheels, robot.torque_limit, options.wheel_gain, cog, start - folded
    )


def _terrain(bullet: Any, client: int, scene: Scene, *, visible: bool) -> Iterator[int]:
    plane = bullet.createCollisionShape(bullet.GEOM_PLANE, physicsClientId=client)
    yield bullet.createMultiBody(0.0, plane, physicsClientId=client)
    for block in blocks(scene.terrain):
        half = [extent / 2.0 for extent in block.size]
        shape = bullet.createCollisionShape(
            bullet.GEOM_BOX, halfExtents=half, physicsClientId=client
        )
        colour = [0.75, 0.62, 0.42, 1.0]
        seen = (
            bullet.createVisualShape(
                bullet.GEOM_BOX, halfExtents=half, rgbaColor=colour, physicsClientId=client
            )
            if visible
            else -1
        )
        yield bullet.createMultiBody(
            0.0, shape, seen, block.centre, block.quaternion(), physicsClientId=client
        )


def _load(bullet: Any, client: int, robot: SimRobot, command: Command, *, visible: bool) -> int:
    x, y, yaw = command.start_pose
    with tempfile.TemporaryDirectory(prefix="trajopt-") as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(
            robot_urdf(robot, Path(folder), margin=HULL_MARGIN, visible=visible), encoding="utf-8"
        )
        try:
            return int(
                bullet.loadURDF(
                    str(path),
                    basePosition=(x, y, robot.cog_height),
                    baseOrientation=bullet.getQuaternionFromEuler((0.0, 0.0, yaw)),
                    flags=bullet.URDF_USE_INERTIA_FROM_FILE | bullet.URDF_USE_IMPLICIT_CYLINDER,
                    physicsClientId=client,
                )
            )
        except bullet.error as error:
            raise SimulationError(
                f"pybullet could not build the robot {robot.name!r}: {error}"
            ) from error


def _surface(bullet: Any, client: int, body: int, link: int, *, friction: float) -> None:
    """Contact and damping of one link, in three calls.

    Joint speed or damping in the same call as friction makes Bullet drop the friction.
    """
    bullet.changeDynamics(body, link, linearDamping=0.0, angularDamping=0.0, physicsClientId=client)
    bullet.changeDynamics(
        body, link, jointDamping=0.0, maxJointVelocity=MAX_JOINT_SPEED, physicsClientId=client
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
