"""The robot on split offset casters in a physics engine: what both engines share ([udengaard2008],
section 4.3).

Robot: a body plate, N modules on vertical springs, each free to turn (alpha), its axle pivoted
(beta, passive or driven), two driven wheels. Masses are the thesis's shares of 65 kg; what it does
not print is chosen. The controller is that of trajopt.systems.asoc.tracking; wheels follow velocity
commands.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from trajopt.arrays import AnyArray, Array, BoolArray, require_positive
from trajopt.errors import SimulationError
from trajopt.robots.description import PivotSection, RobotDescription
from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.systems.asoc.modules import AsocGeometry, asoc_robot
from trajopt.systems.asoc.reference import Reference
from trajopt.systems.asoc.tracking import (
    Knowledge,
    body_twist,
    commanded_twist,
    ground_angles,
    moved_poses,
    wheel_commands,
)
from trajopt.world.height_map import HeightMap

FRICTION = 0.6  # [udengaard2008], section 4.3
STEP = 0.002  # s, of the engines; measured on other robots of this package: 10 ms drifts
CONTROL_STRIDE = 5  # steps between two commands: 10 ms, chosen
SETTLE = 0.5  # s on the springs before the motion starts, chosen
WHEEL_GAIN = 7.3  # N m s/rad, K_p of section 4.3 (unit inferred)
PIVOT_GAIN = 60.0  # N m/rad of driven pivots, chosen
ALPHA_DAMPING = 0.05  # N m s/rad of the module axes, chosen
LARGEST_TILT = 1.2  # rad of body roll or pitch beyond which the robot has tipped over, chosen


@dataclass(frozen=True)
class AsocBody:
    """The robot as both engines build it: its description, and springs. N modules."""

    geometry: AsocGeometry
    friction: float = FRICTION
    driven_pivots: bool = False

    def __post_init__(self) -> None:
        require_positive("friction", self.friction, "(friction coefficient)")
        _ = self.description  # refuses wheels that leave no mass for the body

    @cached_property
    def description(self) -> RobotDescription:
        return asoc_robot(self.geometry).description

    @property
    def pivot(self) -> PivotSection:
        """Of each module."""
        return self.description.pivots[0]

    @property
    def wheel_mass(self) -> float:
        """kg"""
        return self.description.wheels[0].mass

    @property
    def link_mass(self) -> float:
        """kg of a module's link; its axle weighs the same."""
        return self.pivot.mass / 2

    @property
    def body_mass(self) -> float:
        modules = self.geometry.modules
        return self.description.body.mass - modules * (self.pivot.mass + 2 * self.wheel_mass)

    @property
    def body_size(self) -> tuple[float, float, float]:
        """m"""
        return self.description.body.chassis

    @property
    def body_height(self) -> float:
        """m of the plate's middle above the ground."""
        return self.description.body.clearance + self.body_size[2] / 2

    @property
    def sag(self) -> float:
        """m of the springs under the robot's weight."""
        return self.pivot.sag or 0.0

    @property
    def torque(self) -> float:
        """N m a wheel."""
        return self.description.motors[0].torque

    @property
    def stiffness(self) -> float:
        """N/m of a module's spring: the body's weight presses it in by ``sag``."""
        return self.body_mass * STANDARD_GRAVITY / self.geometry.modules / self.sag

    @property
    def damping(self) -> float:
        """N s/m of a module's spring."""
        share = self.body_mass / self.geometry.modules
        return 2 * self.pivot.damping_ratio * float(np.sqrt(self.stiffness * share))


@dataclass(frozen=True, eq=False)
class AsocState:
    """``position`` (3,) m of the body plate, its ``rotation`` (3, 3), module angles ``alpha`` (N,)
    rad, wheel ``spins`` (N, 2) rad/s, and which wheels ``touch`` the ground (N, 2)."""

    position: Array
    rotation: Array
    alpha: Array
    spins: Array
    touch: BoolArray


class AsocSession(Protocol):
    """A robot in an engine."""

    def advance(self, wheel_speeds: Array, pivots: Array) -> None:
        """One step with wheel speed targets (N, 2) rad/s and, where pivots are driven, tilts (N,)
        rad."""
        ...

    def state(self) -> AsocState:
        """State now."""
        ...


@dataclass(frozen=True, eq=False)
class AsocRun:
    """A run: ``times`` (n,) s, ``pose`` (n, 3) x, y (m), yaw (rad), ``roll_pitch`` (n, 2) rad,
    ``touch`` (n, W), the ``wanted`` position (n, 2) and the distance from the path (n,), m."""

    engine: str
    version: str
    times: Array
    pose: Array
    roll_pitch: Array
    touch: BoolArray
    wanted: Array
    cross_track: Array
    wall_time: float

    @property
    def rms(self) -> float:
        """RMS distance (m) from the point of the path that was due at the time."""
        return float(np.sqrt(np.mean(np.sum((self.pose[:, :2] - self.wanted) ** 2, axis=1))))

    @property
    def rms_across(self) -> float:
        """RMS distance (m) from the nearest point of the path."""
        return float(np.sqrt(np.mean(self.cross_track**2)))

    @property
    def losses(self) -> int:
        """How often a wheel lost the ground."""
        return int(np.sum(self.touch[:-1] & ~self.touch[1:]))

    @property
    def airborne_share(self) -> float:
        """Share of time a wheel is off the ground, mean over wheels."""
        return float(1.0 - self.touch.mean())


def run_asoc(
    session: AsocSession,
    robot: AsocBody,
    ground: HeightMap,
    reference: Reference,
    *,
    label: tuple[str, str],
    knowledge: Knowledge | None = None,
) -> AsocRun:
    """Settle, then drive along ``reference``; pose and ground are known unless ``knowledge`` says
    otherwise (between updates the pose is that of odometry, from wheel speeds and module angles).
    Raises SimulationError when the numbers leave physics, the robot tips over or leaves the height
    map."""
    known = knowledge or Knowledge()
    geometry, still = robot.geometry, np.zeros((robot.geometry.modules, 2))
    begun = time.perf_counter()
    for _ in range(round(SETTLE / STEP)):
        session.advance(still, still[:, 0])
    rows: list[tuple[AnyArray, ...]] = []
    control = STEP * CONTROL_STRIDE
    estimate, due = np.zeros(3), 0.0
    for moment in np.arange(0.0, reference.duration + control / 2, control):
        now = session.state()
        pose, lean = _pose(now, float(moment))
        _require_ground(pose, robot, ground, float(moment))
        place, velocity = reference.at(float(moment))
        rows.append((pose, lean, now.touch.ravel(), place))
        tilt, slope = still[:, 0], still
        if known.terrain:
            tilt, slope, _ = ground_angles(geometry, ground, pose, now.alpha)
        if moment >= due - 1e-9:
            estimate, due = pose, due + known.update_period
        else:
            moved = body_twist(geometry, now.alpha, now.spins * geometry.wheel_radius, tilt, slope)
            estimate = moved_poses(estimate[None], moved[None], control)[0]
        twist = commanded_twist(estimate[None], place, velocity)[0]
        speeds = wheel_commands(geometry, now.alpha, twist, tilt, slope) / geometry.wheel_radius
        for _ in range(CONTROL_STRIDE):
            session.advance(speeds, tilt)
    pose, lean, touch, wanted = (np.array(column) for column in zip(*rows, strict=True))
    pose[:, 2] = np.unwrap(pose[:, 2])
    times = np.asarray(control * np.arange(len(rows)), dtype=np.float64)
    return AsocRun(
        label[0],
        label[1],
        times,
        pose,
        lean,
        touch.astype(bool),
        wanted,
        reference.distance(pose[:, :2]),
        time.perf_counter() - begun,
    )


def _require_ground(pose: Array, robot: AsocBody, ground: HeightMap, moment: float) -> None:
    """SimulationError where the module axes no longer stand over the map: the engines have nothing
    beyond it."""
    low = np.array(ground.origin) + robot.geometry.module_radius
    high = low + np.array(ground.size) - 2 * robot.geometry.module_radius
    if np.any(pose[:2] < low) or np.any(pose[:2] > high):
        raise SimulationError(
            f"the robot left the height map {moment:.3g} s after the start, at "
            f"({pose[0]:.3g}, {pose[1]:.3g}) m; take a larger map"
        )


def _pose(now: AsocState, moment: float) -> tuple[Array, Array]:
    """(x, y, yaw) and (roll, pitch), or SimulationError."""
    r = now.rotation
    if not (np.all(np.isfinite(now.position)) and np.all(np.isfinite(r))):
        raise SimulationError(f"the state is not finite {moment:.3g} s after the start")
    roll, pitch = float(np.arctan2(r[2, 1], r[2, 2])), float(-np.arcsin(np.clip(r[2, 0], -1, 1)))
    if max(abs(roll), abs(pitch)) > LARGEST_TILT:
        raise SimulationError(
            f"the robot tipped over {moment:.3g} s after the start, at "
            f"({now.position[0]:.3g}, {now.position[1]:.3g}) m"
        )
    return np.array([*now.position[:2], np.arctan2(r[1, 0], r[0, 0])]), np.array([roll, pitch])
