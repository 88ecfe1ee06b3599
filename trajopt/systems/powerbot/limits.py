"""Limits as [waheed2006] writes them, so that its tables can be reproduced and its errors shown.

Wrong in them, and kept: braking slip is taken as minus the accelerating one (eq.
2.21), though braking loads the front drive axle: too strict on the flat, unsafe downhill; the
tipping bound of eq. 2.24 is a braking bound, but is used in both directions; the sliding speed
counts the whole weight and the sharpest bend of the whole path (eq. 2.15).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, require_positive
from trajopt.limits.limit import Limit, Rows, linear_rows, speed_rows
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot

GRAVITY = 9.81  # m/s^2, the thesis's
SLIP_COSINE = 9.95  # m/s^2 (eq. 2.20, printed coefficient)
SLIP_FRICTION = 16.2  # m/s^2 (eq. 2.20)
SLIP_OFFSET = 1.63  # dimensionless (eq. 2.20): 0.35 / 0.215
TIP_LEVER = 0.614  # dimensionless (eq. 2.24): 0.132 / 0.215
TIP_SINE = 1.63  # dimensionless (eq. 2.24): 0.215 / 0.132


def thesis_slip_acceleration(slope: Array, friction: float) -> Array:
    """Largest acceleration before the wheels slip, m/s^2, at slopes (N,), rad, uphill > 0 (eq.
    2.20)."""
    cos, sin = np.cos(slope), np.sin(slope)
    return np.asarray(
        SLIP_COSINE * cos - GRAVITY * sin - SLIP_FRICTION * cos / (SLIP_OFFSET + friction)
    )


def thesis_tip_acceleration(slope: Array) -> Array:
    """Largest acceleration before the robot tips, m/s^2, at slopes (N,), rad, uphill > 0 (eq.
    2.24)."""
    return np.asarray(TIP_LEVER * GRAVITY * (np.cos(slope) - TIP_SINE * np.sin(slope)))


def thesis_slide_speed(curvature: Array, friction: float) -> float:
    """Speed at which the sharpest bend of a path slides out, m/s (eq. 2.15); inf on a straight
    path."""
    sharpest = float(np.max(np.abs(curvature), initial=0.0))
    return float(np.sqrt(friction * GRAVITY / sharpest)) if sharpest > 0 else float("inf")


@dataclass(frozen=True)
class ThesisSlip(Limit):
    """|s''| <= eq. 2.20 at the place's slope, accelerating and braking alike (eqs. 2.20, 2.21)."""

    friction: float  # dimensionless
    name: str = "thesis_slip"

    def __post_init__(self) -> None:
        require_positive(f"{self.name}.friction", self.friction, "(friction coefficient)")

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:  # noqa: ARG002
        return _both_ways(self.name, thesis_slip_acceleration(path.slope, self.friction))


@dataclass(frozen=True)
class ThesisTip(Limit):
    """|s''| <= eq. 2.24 at the place's slope, accelerating and braking alike (eqs. 2.24, 2.25)."""

    name: str = "thesis_tip"

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:  # noqa: ARG002
        return _both_ways(self.name, thesis_tip_acceleration(path.slope))


@dataclass(frozen=True)
class ThesisSlide(Limit):
    """s' <= sqrt(mu g rho) with the smallest radius rho of the whole path (eq. 2.15).

    ``largest_curvature`` (1/m) is that of the whole path, as rows only see gridpoints.
    """

    friction: float  # dimensionless
    largest_curvature: float  # 1/m
    name: str = "thesis_slide"

    def __post_init__(self) -> None:
        require_positive(f"{self.name}.friction", self.friction, "(friction coefficient)")
        require_positive(f"{self.name}.largest_curvature", self.largest_curvature, "1/m")

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:  # noqa: ARG002
        speed = thesis_slide_speed(np.array([self.largest_curvature]), self.friction)
        return speed_rows(self.name, np.ones(len(path.s)), speed)


def _both_ways(name: str, largest: Array) -> Rows:
    n = len(largest)
    a = np.tile([1.0, -1.0], (n, 1))
    c = np.column_stack([largest, largest])
    return linear_rows(name, a, np.zeros((n, 2)), c, np.maximum(np.abs(c), 1e-3))
