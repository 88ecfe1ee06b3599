"""Which contacts hold the robot, in which directions, and how they share its force.

Driven fixed and steered wheels hold along and across, free ones across. Swedish wheels hold along
the axis of the ground roller, where driven. Driven castors hold along and across as far as the
moments about their pivot, which turns freely, cancel. Free castors, free Swedish wheels and balls
hold nothing. Where more forces are possible than force and yaw moment need, those of least norm
act.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.errors import ArgumentError
from trajopt.limits.forces import (
    Affine,
    contact_arms,
    ground_moment,
    least_norm,
    specific_force,
)
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot
from trajopt.robots.steering import steering_of

_RANK = 1e-9  # of force directions: singular values below it do not count


@dataclass(frozen=True, eq=False)
class Holds:
    """F possible forces: the wheel of each (by its place in the file), its direction from the
    wheel's rolling direction (rad), and the castors' groups (index of their wheels) that turn
    freely."""

    wheel: IndexArray  # (F,)
    direction: Array  # (F,)
    free: tuple[IndexArray, ...]
    all_drive: bool  # whether every wheel that holds is driven, and fixed or steered

    @cached_property
    def wheels(self) -> IndexArray:
        """Wheels that hold, each once."""
        return np.unique(self.wheel)

    def columns(self, wheel: int) -> IndexArray:
        """Which forces are a wheel's."""
        return np.flatnonzero(self.wheel == wheel)


@lru_cache(maxsize=64)
def holds_of(robot: Robot) -> Holds:
    """Raises ArgumentError where no motor drives a wheel, or wheels must slide to turn."""
    if robot.description.skid is not None:
        raise ArgumentError(
            "robot.skid", robot.name, "wheels that roll: skid-steered ones slide at every turn"
        )
    driven = {name for motor in robot.description.motors for name in motor.wheels}
    if not driven:
        raise ArgumentError("robot.motors", robot.name, "at least one motor that drives a wheel")
    groups = {p.name: tuple(p.wheels) for p in robot.description.pivots}
    alone = {name for group in groups.values() for name in group}
    wheels = robot.description.wheels
    groups.update({w.name: (w.name,) for w in wheels if w.kind == "castor" and w.name not in alone})
    active = [group for group in groups.values() if driven.intersection(group)]
    on_active = {name for group in active for name in group}
    found: list[tuple[int, float]] = []
    for i, w in enumerate(wheels):
        if w.rollers is not None and w.name in driven:
            found.append((i, w.rollers.angle))
        elif w.kind in ("fixed", "steered") or w.name in on_active:
            found += [(i, 0.0)] if w.name in driven else []
            found.append((i, np.pi / 2))
    names = [w.name for w in wheels]
    held = [wheels[i] for i, _ in found]
    return Holds(
        np.array([i for i, _ in found], dtype=np.intp),
        np.array([angle for _, angle in found]),
        tuple(np.array([names.index(name) for name in group], dtype=np.intp) for group in active),
        all(w.kind in ("fixed", "steered") and w.name in driven for w in held),
    )


def ground_wrench(path: PathSamples, robot: Robot) -> Affine:
    """(N, 3): force x, y (m/s^2) and yaw moment (m^2/s^2) about the centre of gravity, per unit
    mass."""
    force = specific_force(path, robot.body).through(np.eye(3)[:2])
    moment = ground_moment(path, robot.body).through(np.eye(3)[2:])
    return Affine.beside(force, moment)


def contact_forces(path: PathSamples, robot: Robot) -> Affine:
    """(N, F): every possible force of ``holds_of``, per unit mass, m/s^2, of least norm.

    Raises ArgumentError where they cannot push along x and y and turn the robot.
    """
    return ground_wrench(path, robot).through(least_norm(wrench_of_forces(path, robot))[..., :3])


def wrench_of_forces(path: PathSamples, robot: Robot) -> Array:
    """(3 + P, F), or (N, 3 + P, F) where wheels turn: what a unit of every possible force gives
    along x, y and about the centre of gravity, and about each of the P pivots that turn freely.

    Raises ArgumentError where they cannot push along x and y and turn the robot.
    """
    holds, steering = holds_of(robot), steering_of(robot)
    arms = contact_arms(path, robot)
    angle = steering.angle
    if path.wheels is not None and steering.turns:
        angle = angle + path.wheels.steering
    direction = angle[..., holds.wheel] + holds.direction
    ex, ey = np.cos(direction), np.sin(direction)
    at = arms[..., holds.wheel, :]
    rows = [ex, ey, at[..., 0] * ey - at[..., 1] * ex]
    pivots = steering.place - np.asarray(robot.body.cog[:2])
    for group in holds.free:
        mine = np.isin(holds.wheel, group)
        arm = at - pivots[holds.wheel]
        rows.append(np.where(mine, arm[..., 0] * ey - arm[..., 1] * ex, 0.0))
    matrix = np.stack(np.broadcast_arrays(*rows), axis=-2)
    first = matrix[0] if matrix.ndim == 3 else matrix
    if np.linalg.matrix_rank(first, tol=_RANK) < len(first):
        raise ArgumentError(
            "robot.motors", robot.name, "driven wheels that can push along x and y and turn it"
        )
    return matrix
