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

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from trajopt.errors import ArgumentError


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
