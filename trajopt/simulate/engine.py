"""The contract that every physics engine fulfils.

Robot frame: x forward, y left, z up, origin below the middle of the wheel centres, on the ground
when the robot stands on flat ground. Wheel order: front-left, front-right, rear-left, rear-right.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from trajopt.arrays import Array, IntArray
from trajopt.errors import ArgumentError
from trajopt.robots.robot import STANDARD_GRAVITY, Robot
from trajopt.simulate.rollers import RollerWheel, Vector
from trajopt.simulate.scene import Scene, require

GRAVITY = STANDARD_GRAVITY
ENGINES = ("pybullet", "mujoco")


@dataclass(frozen=True)
class SimRobot:
    """A chassis box on four roller wheels, all that an engine needs to build it.

    ``robot`` is what it was made from, ``chassis_mass`` [kg] without wheels, ``chassis_size``
    (length, width, height) [m] of the box that collides with the terrain, ``chassis_clearance`` [m]
    from the ground to its bottom, ``cog_height`` [m] of the chassis alone above the ground,
    ``wheel_positions`` four (x, y) [m], ``wheels`` in the same order, ``torque_limit`` [N m] at
    each wheel, ``chassis_inertia`` principal (xx, yy, zz) [kg m^2], by default that of the box.
    """

    name: str
    robot: Robot
    chassis_mass: float
    chassis_size: Vector
    chassis_clearance: float
    cog_height: float
    wheel_positions: tuple[tuple[float, float], ...]
    wheels: tuple[RollerWheel, ...]
    torque_limit: float
    chassis_inertia: Vector | None = None

    def __post_init__(self) -> None:
        """Raise ArgumentError for a size, mass or torque that makes no robot."""
        for name in ("chassis_mass", "cog_height", "torque_limit"):
            require(name, getattr(self, name), low=0.0, expected="a positive number")
        require(
            "chassis_clearance",
            self.chassis_clearance,
            low=-1e-12,
            expected="a height of at least 0 m",
        )
        for size in self.chassis_size:
            require("chassis_size", size, low=0.0, expected="three positive lengths in m")
        if len(self.wheels) != 4 or len(self.wheel_positions) != 4:
            raise ArgumentError(
                "wheels", len(self.wheels), "4 wheels and 4 wheel positions (FL, FR, RL, RR)"
            )

    @property
    def inertia(self) -> Vector:
        """Principal moments of the chassis [kg m^2]; a homogeneous box unless given."""
        if self.chassis_inertia is not None:
            return self.chassis_inertia
        x, y, z = self.chassis_size
        unit = self.chassis_mass / 12.0
        return (unit * (y * y + z * z), unit * (x * x + z * z), unit * (x * x + y * y))

    def wheel_centres(self) -> Array:
        """Wheel centres (4, 3) in the robot frame [m]."""
        return np.array(
            [(x, y, w.radius) for (x, y), w in zip(self.wheel_positions, self.wheels, strict=True)]
        )

    def wheel_speeds(self, vx: float, vy: float, yaw_rate: float) -> Array:
        """Wheel speeds (4,) [rad/s] that roll without slip at body speeds (m/s, m/s, rad/s)."""
        speeds: Array = self.robot.inverse @ np.array([vx, vy, yaw_rate])
        return speeds


@dataclass(frozen=True, eq=False)
class Command:
    """Wheel speeds over time, linear between samples, zero before and after.

    ``times`` (N,) [s] from 0, rising; ``wheel_speeds`` (N, 4) [rad/s]; ``start_pose`` (x, y, yaw)
    [m, m, rad]; ``start_wheel_angles`` (4,) [rad].
    """

    times: Array
    wheel_speeds: Array
    start_pose: Vector = (0.0, 0.0, 0.0)
    start_wheel_angles: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Raise ArgumentError for wrong shapes, times that do not rise from 0, or values not
        finite."""
        times, speeds = np.asarray(self.times), np.asarray(self.wheel_speeds)
        if times.ndim != 1 or len(times) < 2 or times[0] != 0.0 or not np.all(np.diff(times) > 0.0):
            raise ArgumentError("times", times, "at least two rising times in s, the first 0")
        if speeds.shape != (len(times), 4):
            raise ArgumentError("wheel_speeds", speeds.shape, f"shape ({len(times)}, 4), rad/s")
        for name, values in (
            ("times", times),
            ("wheel_speeds", speeds),
            ("start_pose", self.start_pose),
            ("start_wheel_angles", self.start_wheel_angles),
        ):
            if not np.all(np.isfinite(values)):
                raise ArgumentError(name, values, "finite numbers")

    @property
    def duration(self) -> float:
        """Last time [s]."""
        return float(self.times[-1])

    def at(self, moment: float) -> Array:
        """Wheel speeds (4,) at ``moment`` [s]."""
        if moment < 0.0 or moment > self.times[-1]:
            return np.zeros(4)
        right = int(
            np.clip(np.searchsorted(self.times, moment, side="right"), 1, len(self.times) - 1)
        )
        before, after = self.times[right - 1], self.times[right]
        part = (moment - before) / (after - before)
        speeds: Array = (1.0 - part) * self.wheel_speeds[right - 1] + part * self.wheel_speeds[
            right
        ]
        return speeds


@dataclass(frozen=True)
class Camera:
    """View for a picture at the end of a run: the camera looks at the robot (or ``target``, m).

    ``distance`` [m], ``yaw`` and ``pitch`` [rad] (yaw 0 looks along +y, negative pitch looks down),
    size in pixels.
    """

    width: int = 640
    height: int = 480
    distance: float = 1.8
    yaw: float = math.radians(35.0)
    pitch: float = math.radians(-25.0)
    target: Vector | None = None


@dataclass(frozen=True, eq=False)
class Observation:
    """What the engine shows at one moment.

    ``position`` (3,) [m] and ``rotation`` (3, 3) of the robot frame, ``velocity`` (3,) [m/s],
    ``wheel_angles`` (4,) counted on, ``wheel_speeds`` (4,) [rad/s], ``wheel_torques`` (4,) [N m],
    ``contacts`` with the terrain, ``penetration`` [m] of the deepest one (positive is inside).
    """

    position: Array
    rotation: Array
    velocity: Array
    wheel_angles: Array
    wheel_speeds: Array
    wheel_torques: Array
    contacts: int
    penetration: float


@dataclass(frozen=True, eq=False)
class Recording:
    """What happened, from the start of the command (after settling).

    ``times`` (N,) [s]; ``pose`` (N, 3) x, y [m] and yaw [rad], counted on; ``height`` [m],
    ``roll``, ``pitch`` [rad] (N,) of the robot frame; ``wheel_angles`` [rad], counted on,
    ``wheel_speeds`` [rad/s], ``wheel_torques`` [N m] and ``wheel_heights`` [m] of the wheel
    centres, all (N, 4); ``contacts`` (N,). ``exploded`` with its ``reason`` when the run was
    stopped because the numbers left physics. ``wall_time`` [s] of stepping, ``real_time_factor``
    simulated over wall time [-], ``picture`` (H, W, 3) uint8 when asked.
    """

    engine: str
    version: str
    times: Array
    pose: Array
    height: Array
    roll: Array
    pitch: Array
    wheel_angles: Array
    wheel_speeds: Array
    wheel_torques: Array
    wheel_heights: Array
    contacts: IntArray
    exploded: bool
    reason: str
    wall_time: float
    real_time_factor: float
    picture: NDArray[np.uint8] | None = None


Controller = Callable[[float, Observation], Array]


class Engine(Protocol):
    """A physics engine: a frozen dataclass of options, each with unit, default and source."""

    @property
    def name(self) -> str:
        """Name in the registry."""
        ...

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
        """Drive ``robot`` through ``scene``; see ``drive`` for the arguments."""
        ...


class Session(Protocol):
    """One running simulation, as ``drive`` steps it."""

    def advance(self, wheel_speeds: Array) -> None:
        """One time step with these wheel speed targets (4,) [rad/s]."""
        ...

    def observe(self) -> Observation:
        """State now."""
        ...

    def render(self, camera: Camera) -> NDArray[np.uint8]:
        """Picture (H, W, 3)."""
        ...


def make_engine(name: str) -> Engine:
    """The engine called ``name`` (one of ENGINES) with its default options; its package loads on
    first run.

    Raises ArgumentError for an unknown name.
    """
    if name == "pybullet":
        from trajopt.simulate.pybullet import PyBullet

        return PyBullet()
    if name == "mujoco":
        from trajopt.simulate.mujoco import MuJoCo

        return MuJoCo()
    raise ArgumentError("engine", name, "one of " + ", ".join(ENGINES))
