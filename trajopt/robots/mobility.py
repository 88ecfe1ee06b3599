"""What motions a robot allows: Pfaffian matrix, degrees of mobility, kinematics at given steering
angles.

Steering angles are one a wheel (W,), as the wheels' ``beta``; entries of wheels that cannot turn
are not used. Every function takes them from the wheels where they are not given. Rows come from
wheel.py only, so numbers and symbolic expressions (CasADi, for ``pfaffian_rows``) go through the
same formulas.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.robots.robot import Robot
from trajopt.robots.wheel import Row, Wheel, WheelKind, null_space, wheel_rates

_TURNS = (WheelKind.STEERED, WheelKind.CASTOR)
_SLIDE = (WheelKind.FIXED, WheelKind.STEERED)  # whose sliding rows forbid motions


@dataclass(frozen=True)
class Mobility:
    """Degrees of mobility, steerability and manoeuvrability [wheels-lecture, campion1996]."""

    mobility: int
    steerability: int

    @property
    def manoeuvrability(self) -> int:
        return self.mobility + self.steerability


def pfaffian_rows(robot: Robot, steering: Sequence[Any] | None = None) -> list[list[Any]]:
    """Rows of the Pfaffian matrix A as nested lists, so that steering angles may be symbols.

    A @ (vx, vy, wz, phi'_1 .. phi'_W, beta'_1 .. beta'_W) = 0: a rolling and a sliding row a wheel,
    the twist in the body frame. Rows that constrain nothing (Swedish sliding, spherical) are left
    out.
    """
    angles = _angles(robot, steering)
    count = len(robot.wheels)
    matrix: list[list[Any]] = []
    for index, (wheel, beta) in enumerate(zip(robot.wheels, angles, strict=True)):
        for row in _constraints(wheel, beta):
            spins: list[Any] = [0.0] * count
            steers: list[Any] = [0.0] * count
            spins[index], steers[index] = -row.spin, -row.steer
            matrix.append([row.x, row.y, row.yaw, *spins, *steers])
    return matrix


def pfaffian(robot: Robot, steering: ArrayLike | None = None, *, yaw: float | None = None) -> Array:
    """(R, 3 + 2 W): the Pfaffian matrix A of ``pfaffian_rows`` as numbers.

    With ``yaw`` (rad) the twist is (x', y', yaw') in the world frame, as in [wheels-lecture];
    R^T(yaw) stands where the lecture's eqs. 5-10 print R.
    """
    matrix = np.array(pfaffian_rows(robot, _checked(robot, steering).tolist()), dtype=np.float64)
    if yaw is not None:
        c, s = np.cos(yaw), np.sin(yaw)
        to_body = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        matrix[:, :3] = matrix[:, :3] @ to_body
    return matrix


def inverse_at(robot: Robot, steering: ArrayLike | None = None) -> Array:
    """(W, 3): wheel rates (rad/s) = inverse @ (vx, vy, wz) at steering angles (W,), rad."""
    if steering is None or robot.description.skid is not None:
        return robot.inverse
    angles = _checked(robot, steering)
    return wheel_rates([w.driving(b) for w, b in zip(robot.wheels, angles, strict=True)])


def forward_at(robot: Robot, steering: ArrayLike | None = None) -> Array:
    """(3, W): body twist = forward @ wheel rates at steering angles (W,), rad; least squares where
    wheels disagree, sliding rows exactly kept. Zero where no motion is possible."""
    allowed = admissible_at(robot, steering)
    return np.asarray(
        allowed @ np.linalg.pinv(inverse_at(robot, steering) @ allowed), dtype=np.float64
    )


def steering_rates(robot: Robot, steering: ArrayLike, twist: ArrayLike) -> Array:
    """(W,): steering rates beta' (rad/s) that castors must have at a body twist; 0 for other
    wheels."""
    velocity = np.asarray(twist, dtype=np.float64)
    rates = np.zeros(len(robot.wheels))
    for i, (wheel, beta) in enumerate(zip(robot.wheels, _checked(robot, steering), strict=True)):
        if wheel.kind is WheelKind.CASTOR:
            row = wheel.sliding(beta)
            rates[i] = float(np.dot((row.x, row.y, row.yaw), velocity)) / row.steer
    return rates


def admissible_at(robot: Robot, steering: ArrayLike | None = None) -> Array:
    """(3, m): orthonormal basis of the body twists that no sliding row forbids at steering angles
    (W,), rad."""
    if steering is None or robot.description.skid is not None:
        return robot.admissible
    return null_space(_sliding(zip(robot.wheels, _checked(robot, steering), strict=True), _SLIDE))


def mobility_of(robot: Robot) -> Mobility:
    """Degrees of mobility and steerability of a robot, steered wheels turned to a common centre.

    Mobility is 3 - rank of the sliding rows of fixed and steered wheels, steerability the rank that
    steered wheels add to the fixed ones' (003: the rank of the steered rows, where they are
    independent of these).
    """
    if robot.description.skid is not None:
        return Mobility(2, 0)
    fixed = _rank(_sliding([(w, w.beta) for w in robot.wheels], (WheelKind.FIXED,)))
    if fixed == 3:
        return Mobility(0, 0)
    every = _rank(_sliding(zip(robot.wheels, generic_steering(robot), strict=True), _SLIDE))
    return Mobility(3 - every, every - fixed)


def generic_steering(robot: Robot) -> Array:
    """(W,): steering angles (rad) for a motion without special symmetry that fixed wheels allow."""
    basis = null_space(_sliding([(w, w.beta) for w in robot.wheels], (WheelKind.FIXED,)))
    return steering_for(robot, basis @ np.array([1.0, 0.618, 0.414])[: basis.shape[1]])


def steering_for(robot: Robot, twist: ArrayLike) -> Array:
    """(W,): steering angles (rad) at which every steered wheel follows a body twist (vx, vy, wz)
    without sliding. Fixed wheels, Swedish wheels and castors keep their ``beta``. A wheel at the
    centre of rotation keeps its angle too, since any serves."""
    vx, vy, wz = np.asarray(twist, dtype=np.float64)
    angles = [w.beta for w in robot.wheels]
    for i, wheel in enumerate(robot.wheels):
        if wheel.kind is WheelKind.STEERED:
            x, y = wheel.position
            along, across = vx - wz * y, vy + wz * x
            if np.hypot(along, across) > 1e-12:
                angles[i] = float(np.arctan2(across, along)) + np.pi / 2 - wheel.alpha
    return np.array(angles, dtype=np.float64)


def rotation_centre(twist: ArrayLike) -> Array:
    """(3,): instantaneous centre of rotation of a body twist in homogeneous coordinates (x w, y w,
    w), body frame, scaled to unit length; w = 0 where the body translates (the centre lies at
    infinity, across the motion). Raises ArgumentError for a body at rest."""
    vx, vy, wz = np.asarray(twist, dtype=np.float64)
    centre = np.array([-vy, vx, wz])
    size = float(np.linalg.norm(centre))
    if not size > 0:
        raise ArgumentError("twist", [vx, vy, wz], "a twist different from zero")
    return centre / size


def _constraints(wheel: Wheel, beta: Any) -> list[Row]:
    if wheel.kind is WheelKind.SPHERICAL:
        return []  # the ball rolls whichever way it is pushed
    slide = wheel.sliding(beta)
    return [wheel.rolling(beta)] if slide.free else [wheel.rolling(beta), slide]


def _sliding(wheels: Any, kinds: tuple[WheelKind, ...]) -> Array:
    rows = [w.sliding(b) for w, b in wheels if w.kind in kinds]
    return np.array([[r.x, r.y, r.yaw] for r in rows], dtype=np.float64).reshape(-1, 3)


def _rank(rows: Array) -> int:
    return 3 - int(null_space(rows).shape[1])


def _angles(robot: Robot, steering: Sequence[Any] | None) -> list[Any]:
    if steering is None:
        return [w.beta for w in robot.wheels]
    if len(steering) != len(robot.wheels):
        raise ArgumentError("steering", len(steering), f"one angle a wheel ({len(robot.wheels)})")
    return [b if w.kind in _TURNS else w.beta for w, b in zip(robot.wheels, steering, strict=True)]


def _checked(robot: Robot, steering: ArrayLike | None) -> Array:
    if steering is None:
        return np.array([w.beta for w in robot.wheels], dtype=np.float64)
    array = np.asarray(steering, dtype=np.float64)
    if array.shape != (len(robot.wheels),) or not np.all(np.isfinite(array)):
        raise ArgumentError(
            "steering", array.tolist(), f"{len(robot.wheels)} finite angles, one a wheel, rad"
        )
    return np.array(_angles(robot, array.tolist()), dtype=np.float64)
