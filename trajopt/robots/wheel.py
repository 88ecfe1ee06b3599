"""Rolling and sliding constraints of the five kinds of wheel [wheels-lecture].

A wheel is described by the lecture's polar data: its centre (for a castor, its pivot) sits at
distance ``l`` and angle ``alpha`` in the body frame; ``beta`` turns the wheel plane so that the
rolling direction is t = (sin(alpha + beta), -cos(alpha + beta)) and the axle n = (cos(alpha +
beta), sin(alpha + beta)); ``gamma`` is the angle between the roller's rolling direction and the
wheel plane (Swedish wheels); ``radius`` is the wheel radius. A castor's wheel sits at ``offset``
along t from its pivot (negative: it trails) and at ``lateral`` along n, 0 for a single wheel and
+-half the split for a split castor.

The rows act on the body twist (vx, vy, wz), in the body frame, and on the joint rates:

    rolling @ twist = spin_rolling * phi'  + steer_rolling * beta'
    sliding @ twist = spin_sliding * phi'  + steer_sliding * beta'  + free

where ``free`` says that a passive roller (Swedish) or the ball (spherical) takes up the rest, so
the row constrains nothing. Formulas are on component arrays, so angles may be NumPy arrays or
CasADi expressions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.robots.description import WheelSection

_RANK = 1e-9  # singular values below this share of the largest count as zero

_AROUND = 48  # directions of a wheel that turns, for the outline; a multiple of 4


class WheelKind(Enum):
    """The five kinds of wheel of [wheels-lecture]."""

    FIXED = "fixed"
    STEERED = "steered"
    CASTOR = "castor"
    SWEDISH = "swedish"
    SPHERICAL = "spherical"


@dataclass(frozen=True)
class Row:
    """One scalar constraint: (x, y, yaw) . twist = spin * phi' + steer * beta' (+ anything if
    free)."""

    x: Any
    y: Any
    yaw: Any
    spin: Any
    steer: Any = 0.0
    free: bool = False


@dataclass(frozen=True)
class Wheel:
    """A wheel on a body: lengths in m, angles in rad, in the body frame (x forward, y left).

    Raises ArgumentError for a radius that is not positive, a negative ``l``, or a Swedish wheel
    whose rollers lie along the wheel plane (cos(gamma) = 0: the wheel could not drive).
    """

    kind: WheelKind
    l: float  # noqa: E741 - the lecture's name for the distance of the wheel from the body origin
    alpha: float
    beta: float
    radius: float
    gamma: float = 0.0
    offset: float = 0.0
    lateral: float = 0.0

    def __post_init__(self) -> None:
        if not self.radius > 0:
            raise ArgumentError("radius", self.radius, "a wheel radius > 0 m")
        if not self.l >= 0:
            raise ArgumentError("l", self.l, "a distance >= 0 m from the body origin")
        if self.kind is WheelKind.SWEDISH and abs(np.cos(self.gamma)) < 1e-9:
            raise ArgumentError("gamma", self.gamma, "a roller angle with cos(gamma) != 0")
        if self.kind is WheelKind.CASTOR and not abs(self.offset) > 0:
            raise ArgumentError("offset", self.offset, "a castor arm different from 0 m")
        if self.kind is not WheelKind.CASTOR and self.lateral != 0:
            raise ArgumentError(
                "lateral", self.lateral, "0 m: only a castor's wheel stands beside its pivot"
            )

    @property
    def position(self) -> tuple[float, float]:
        """Wheel centre (castor: pivot) in the body frame, m."""
        return self.l * float(np.cos(self.alpha)), self.l * float(np.sin(self.alpha))

    def rolling(self, beta: Any = None) -> Row:
        """Pure rolling along the wheel plane (003, eqs. for each kind). ``beta``: steering angle,
        rad.

        A wheel beside its castor's pivot also rolls when the arm turns: its speed is less by
        lateral (wz + beta').
        """
        b = self.beta if beta is None else beta
        turn = b + (self.gamma if self.kind is WheelKind.SWEDISH else 0.0)
        spin = self.radius * np.cos(self.gamma) if self.kind is WheelKind.SWEDISH else self.radius
        return Row(
            np.sin(self.alpha + turn),
            -np.cos(self.alpha + turn),
            -self.l * np.cos(turn) - self.lateral,
            spin,
            self.lateral,
        )

    def sliding(self, beta: Any = None) -> Row:
        """No sideways slip (003). For Swedish and spherical wheels the row is free.

        The castor's row carries its arm: [.., offset + l sin(beta)] twist + offset beta' = 0. The
        Swedish row keeps the term - radius sin(gamma) phi' that the lecture's print lost, the
        spherical one its l sin(beta).
        """
        b = self.beta if beta is None else beta
        swedish = self.kind is WheelKind.SWEDISH
        turn = b + (self.gamma if swedish else 0.0)
        arm = self.offset if self.kind is WheelKind.CASTOR else 0.0
        return Row(
            np.cos(self.alpha + turn),
            np.sin(self.alpha + turn),
            arm + self.l * np.sin(turn),
            -self.radius * np.sin(self.gamma) if swedish else 0.0,
            -arm,
            free=self.kind in (WheelKind.SWEDISH, WheelKind.SPHERICAL),
        )

    def driving(self, beta: Any = None) -> Row:
        """The rolling row once a castor's steering rate is taken from its sliding row: (x, y, yaw)
        . twist = spin phi'. The rolling row itself for wheels that roll in the plane of their
        pivot."""
        roll = self.rolling(beta)
        if self.lateral == 0:
            return roll
        slide = self.sliding(beta)
        share = roll.steer / slide.steer
        return Row(
            roll.x - share * slide.x,
            roll.y - share * slide.y,
            roll.yaw - share * slide.yaw,
            roll.spin,
        )


def wheel_rates(rows: list[Row]) -> Array:
    """(W, 3): wheel rates (rad/s) that rolling rows give to each component of the body twist."""
    matrix = np.array([[r.x / r.spin, r.y / r.spin, r.yaw / r.spin] for r in rows]).reshape(-1, 3)
    matrix[np.abs(matrix) < 1e-12 * np.abs(matrix).max(initial=0.0)] = 0.0
    return np.asarray(matrix, dtype=np.float64)


def null_space(rows: Array) -> Array:
    """(3, m): orthonormal basis of the body twists that no row (R, 3) forbids."""
    if len(rows) == 0:
        return np.eye(3)
    _, singular, vt = np.linalg.svd(np.asarray(rows, dtype=np.float64))
    return np.asarray(vt[int(np.sum(singular > _RANK * singular.max())) :].T, dtype=np.float64)


def kinematic(wheel: WheelSection) -> Wheel:
    """Rolling and sliding rows of a described wheel at steering angle 0."""
    x, y = wheel.position
    alpha = math.atan2(y, x)
    return Wheel(
        WheelKind(wheel.kind),
        math.hypot(x, y),
        alpha,
        wheel.angle + math.pi / 2 - alpha,
        wheel.radius,
        gamma=wheel.rollers.angle if wheel.rollers else 0.0,
        offset=-wheel.trail,
        lateral=wheel.lateral,
    )


def outline(wheel: WheelSection, turns: tuple[float, float] | None) -> Array:
    """(K, 2): places that a wheel reaches seen from above, m. A steered wheel ``turns`` from, to
    (rad); without, it turns all round as a castor does."""
    x, y = wheel.position
    if wheel.kind in ("steered", "castor") and turns is None:
        reach = math.hypot(wheel.trail + wheel.radius, abs(wheel.lateral) + wheel.width / 2)
        around = 2 * np.pi / _AROUND * np.arange(_AROUND)
        return np.column_stack([x + reach * np.cos(around), y + reach * np.sin(around)])
    low, high = (0.0, 0.0) if turns is None else turns
    angle = wheel.angle + np.linspace(low, high, _AROUND)[:, None]
    ahead = np.array([1, 1, -1, -1]) * wheel.radius
    left = np.array([1, -1, 1, -1]) * wheel.width / 2
    corners = [
        x + ahead * np.cos(angle) - left * np.sin(angle),
        y + ahead * np.sin(angle) + left * np.cos(angle),
    ]
    return np.stack(corners, axis=-1).reshape(-1, 2)
