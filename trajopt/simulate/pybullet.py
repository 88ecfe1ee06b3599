"""Bullet through pybullet, in a private client for each run.

The robot is a URDF written for this run. Why the settings are what they are stands beside each
option.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.arrays import Array, fold
from trajopt.errors import ArgumentError, MissingDependencyError, SimulationError
from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.simulate.bullet import (
    OUTLINE,
    WHEELS,
    Client,
    add_plates,
    build_stage,
    load_robot,
    plate_filter,
    shoot,
)
from trajopt.simulate.bullet_grip import Grip
from trajopt.simulate.engine import Camera, Contacts, Motion, Start
from trajopt.simulate.model import Model, cross
from trajopt.simulate.motors import Motors
from trajopt.simulate.plates import Plates
from trajopt.simulate.scene import Stage
from trajopt.simulate.stepping import Pace
from trajopt.simulate.tyres import give

# Joints that one Bullet multibody can report; with more, joint states silently read zero
# (measured).
MAX_JOINTS = 121
# Bullet stops joints at 100 rad/s unless told otherwise; a roller of 9.5 mm turns at 124 rad/s in
# lateral motion at 3 km/h [rad/s].
MAX_JOINT_SPEED = 1e4
AWAY = (0.0, 0.0, -100.0)  # m, where an obstacle is that is out of the world


@dataclass(frozen=True)
class PyBullet:
    """Options of the Bullet engine (values measured on a Mecanum robot of 20 kg over 5 m unless
    said otherwise)."""

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

    @contextmanager
    def open(
        self, model: Model, stage: Stage, start: Start, picture: Camera | None
    ) -> Iterator[_Session]:
        """See ``engine.Engine``; ArgumentError for a robot with too many rollers for one Bullet
        multibody or too large a height field, SimulationError when Bullet cannot build it."""
        if len(model.links) - 1 > MAX_JOINTS:
            raise ArgumentError(
                "robot.wheels",
                f"{len(model.links) - 1} joints",
                f"at most {MAX_JOINTS} wheels and rollers in pybullet (beyond, it reads zeros)",
            )
        bullet = Client(load_bullet())
        try:
            bullet.setGravity(0.0, 0.0, -STANDARD_GRAVITY)
            bullet.setPhysicsEngineParameter(
                fixedTimeStep=self.step,
                numSolverIterations=self.solver_iterations,
                # Bullet's cone lets the wheel of an axle that comes first hold all it can across,
                # and then spin (measured: a differential drive along a slope turned by 40 deg): see Grip
                enableConeFriction=0,
                contactBreakingThreshold=self.contact_breaking_threshold,
                erp=self.contact_erp,
                contactERP=self.contact_erp,
                enableFileCaching=0,  # else a robot of the same file name comes back
                deterministicOverlappingPairs=1,
            )
            yield _Session(bullet, self, model, stage, start, visible=picture is not None)
        finally:
            bullet.disconnect()


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


class _Session:
    """One client with the robot in it; fulfils ``engine.Session``."""

    def __init__(
        self,
        bullet: Client,
        options: PyBullet,
        model: Model,
        stage: Stage,
        start: Start,
        *,
        visible: bool,
    ) -> None:
        self.bullet, self.options, self.model, self.stage = bullet, options, model, stage
        self.solids = build_stage(bullet, stage, visible)
        self.robot = load_robot(bullet, model, start, visible)
        self.cog = np.array(model.links[0].cog)
        self.plates = Plates(model, stage) if stage.plates else None
        self.bodies = add_plates(bullet, len(model.feet) if stage.plates else 0)
        self.solids |= dict.fromkeys(self.bodies, -1)
        self.middle = start.place
        # Bullet numbers joints as it walks the tree; -1 is the base
        names = [
            bullet.getJointInfo(self.robot, joint)[1].decode()
            for joint in range(bullet.getNumJoints(self.robot))
        ]
        if len(names) != len(model.links) - 1:
            raise SimulationError(
                f"pybullet built {len(names)} joints, not those of the robot {model.name!r}"
            )
        self.joint = [-1, *(names.index(f"link_{i}") for i in range(1, len(model.links)))]
        self.link = {joint: i for i, joint in enumerate(self.joint)}
        self.offset = dict.fromkeys(range(len(model.links)), 0.0)
        for link in range(len(model.links)):
            self._surface(link)
        for link, angle in start.angles.items():
            # small angles keep their digits: whole turns are added when reading
            bullet.resetJointState(self.robot, self.joint[link], fold(float(angle)), 0.0)
            self.offset[link] = float(angle - fold(float(angle)))
        self.grip = Grip(
            bullet, model, self.robot, self.joint, stage.scene.friction, rollers=stage.uneven
        )
        self.turns = np.array([self.offset[link] for link in model.targets])
        self.before: Array | None = None
        links = model.links
        spins = [s for s, driven in zip(model.spins, model.driven, strict=True) if driven]
        self.driven = np.array(model.driven, dtype=bool)
        self.turned, self.spins, self.motors = tuple(spins), self._joints(spins), Motors(model)
        steered = [t for t in model.targets if links[t].joint.drive == "position"]
        self.steered, self.powers = self._joints(steered), [links[s].joint.effort for s in steered]
        # Bullet's own jointDamping does nothing to them (measured)
        self.forced = [
            i for i, k in enumerate(links) if k.joint.drive == "spring" or k.joint.damping > 0.0
        ]
        commanded = [t for t in model.targets if t not in steered]
        self.commanded = [self.forced.index(t) for t in commanded]
        soft = [links[i].joint for i in self.forced]
        self.rests = np.array([joint.rest for joint in soft])
        self.stiffness = np.array([joint.stiffness for joint in soft])
        self.damping = np.array([joint.damping for joint in soft])
        self.most = np.array([joint.effort for joint in soft])

    def _joints(self, links: list[int]) -> list[int]:
        return [self.joint[link] for link in links]

    def _surface(self, number: int) -> None:
        """Contact and motor of one link.

        Joint speed or damping in the same call as friction makes Bullet drop the friction, so it
        takes three calls.
        """
        bullet, robot, joint = self.bullet, self.robot, self.joint[number]
        link = self.model.links[number]
        bullet.changeDynamics(robot, joint, linearDamping=0.0, angularDamping=0.0)
        bullet.changeDynamics(robot, joint, jointDamping=0.0, maxJointVelocity=MAX_JOINT_SPEED)
        bullet.changeDynamics(
            robot, joint,
            lateralFriction=link.grip * self.stage.scene.friction, spinningFriction=0.0,
            rollingFriction=0.0, restitution=0.0,
        )  # fmt: skip
        rolls, soft = link.joint.role == "roller", give(self.model, link)
        if rolls and not self.stage.uneven:
            soft = None
        elif rolls:  # friction along the axis alone: light rollers would never get up to speed
            bullet.changeDynamics(robot, joint, anisotropicFriction=[0.0, 0.0, 1.0])
        if soft is not None:
            bullet.changeDynamics(robot, joint, contactStiffness=soft[0], contactDamping=soft[1])
        meets = WHEELS if link.meets == "ground" else OUTLINE
        if link.wheel >= 0 and self.plates is not None:
            meets = plate_filter(link.wheel)
        bullet.setCollisionFilterGroupMask(robot, joint, *meets)
        if joint >= 0:  # every joint is born with a motor that brakes it
            bullet.setJointMotorControl2(robot, joint, bullet.VELOCITY_CONTROL, force=0.0)

    def advance(self, wheel_speeds: Array, angles: Array) -> None:
        """See ``engine.Session``."""
        bullet, robot = self.bullet, self.robot
        if self.spins:
            asked, speeds = wheel_speeds[self.driven], self.joints(self.turned)[1]
            bullet.setJointMotorControlArray(
                robot, self.spins, bullet.VELOCITY_CONTROL,
                targetVelocities=asked.tolist(), forces=self.motors.most(speeds, asked).tolist(),
                velocityGains=[self.options.wheel_gain] * len(self.spins),
            )  # fmt: skip
        count = len(self.steered)
        if count:
            before, self.before = self.before, angles[:count] - self.turns[:count]
            rates = (
                0.0 * self.before if before is None else (self.before - before) / self.options.step
            )
            bullet.setJointMotorControlArray(
                robot, self.steered, bullet.POSITION_CONTROL, targetPositions=self.before.tolist(),
                targetVelocities=rates.tolist(), forces=self.powers,
            )  # fmt: skip
        if self.plates is not None:
            self._move_plates(self.plates)
        self.grip.update()
        if self.forced:
            self.rests[self.commanded] = angles[count:]
            now, speeds, _ = self.joints(tuple(self.forced))
            forces = self.stiffness * (self.rests - now) - self.damping * speeds
            bullet.setJointMotorControlArray(
                robot, self._joints(self.forced), bullet.TORQUE_CONTROL,
                forces=np.clip(forces, -self.most, self.most).tolist(),
            )  # fmt: skip
        bullet.stepSimulation()

    def _move_plates(self, plates: Plates) -> None:
        """Plates turn about the place where the robot began: Bullet keeps contacts by where they
        are on them."""
        plates.move(self.motion(self.model.feet).place)
        up = plates.normal / plates.normal[:, 2:]
        height = np.sum(up * (plates.place - self.middle), axis=1)
        for body, z, (w, *vector) in zip(self.bodies, height, plates.quaternions(), strict=True):
            place = self.middle + np.array([0.0, 0.0, z])
            self.bullet.resetBasePositionAndOrientation(body, place.tolist(), (*vector, w))

    def base(self) -> Motion:
        """See ``engine.Session``."""
        where, attitude = self.bullet.getBasePositionAndOrientation(self.robot)
        linear, angular = self.bullet.getBaseVelocity(self.robot)
        rotation = np.array(self.bullet.getMatrixFromQuaternion(attitude)).reshape(3, 3)
        arm = rotation @ self.cog
        velocity = np.array(linear) - np.cross(angular, arm)
        return Motion(
            (np.array(where) - arm)[None], rotation[None], velocity[None], np.array(angular)[None]
        )

    def motion(self, links: tuple[int, ...]) -> Motion:
        """See ``engine.Session``."""
        if 0 in links:
            raise ArgumentError("links", links, "wheels and rollers; base() tells of the chassis")
        found = [
            self.bullet.getLinkState(
                self.robot, self.joint[link], computeLinkVelocity=1, computeForwardKinematics=1
            )
            for link in links
        ]
        cog, place, velocity, spin = (
            np.array([state[k] for state in found]).reshape(-1, 3) for k in (0, 4, 6, 7)
        )
        turns = np.array([self.bullet.getMatrixFromQuaternion(state[5]) for state in found])
        return Motion(place, turns.reshape(-1, 3, 3), velocity + cross(spin, place - cog), spin)

    def joints(self, links: tuple[int, ...]) -> tuple[Array, Array, Array]:
        """See ``engine.Session``."""
        if not links:
            return np.zeros(0), np.zeros(0), np.zeros(0)
        found = self.bullet.getJointStates(self.robot, self._joints(list(links)))
        turns = np.array([self.offset[link] for link in links])
        angles, speeds, torques = (np.array([state[k] for state in found]) for k in (0, 1, 3))
        return angles + turns, speeds, torques

    def contacts(self) -> Contacts:
        """See ``engine.Session``."""
        found = [p for p in self.bullet.getContactPoints(bodyA=self.robot) if p[9] > 0.0]
        if not found:
            none, rows = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
            return Contacts(none, none, rows, rows, np.zeros(0), np.zeros(0))
        return Contacts(
            np.array([self.link[p[3]] for p in found]),
            np.array([self.solids[p[2]] for p in found]),
            np.array([p[5] for p in found]),
            np.array([p[7] for p in found]),
            np.array([p[9] for p in found]),
            np.array([-p[8] for p in found]),
        )

    def move(self, name: str, place: tuple[float, float] | None) -> None:
        """See ``engine.Session``."""
        for body, i in self.solids.items():
            solid = self.stage.solids[i]
            if i < 0 or solid.name != name or solid.meets != "obstacles":
                continue
            at = solid.shape.pose
            w, x, y, z = at.quaternion
            to = AWAY if place is None else (*place, at.place[2])
            self.bullet.resetBasePositionAndOrientation(body, to, (x, y, z, w))

    def render(self, camera: Camera) -> NDArray[np.uint8]:
        """Picture (H, W, 3) by Bullet's own software renderer."""
        x, y, z = (float(v) for v in self.base().place[0])
        return shoot(self.bullet, camera, camera.target or (x, y, z + 0.08))
