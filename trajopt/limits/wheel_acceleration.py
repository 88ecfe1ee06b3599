"""Acceleration of every wheel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.limits.limit import (
    Limit,
    Rows,
    by_wheel,
    linear_rows,
    require_each_positive,
    require_robot,
    spins,
)
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot


@dataclass(frozen=True)
class WheelAcceleration(Limit):
    """|angular acceleration| <= ``largest``, rad/s^2, of every wheel; one number, or one a wheel
    (W,), inf where a wheel has no limit.

    Wheel rates are spin s', so their derivative is spin s'' + spin_rate s'^2: for two fixed wheels
    at +-b, |(1 +- b kappa) s'' +- b kappa' s'^2| <= r largest. Two rows a wheel. Raises ArgumentError unless ``largest`` > 0, when there is no robot, or for another
    number of values than wheels.
    """

    largest: float | tuple[float, ...]  # rad/s^2
    name: str = "wheel_acceleration"

    def __post_init__(self) -> None:
        require_each_positive(f"{self.name}.largest", self.largest, "rad/s^2")

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        spin, spin_rate = spins(path, require_robot(self.name, robot))
        least, shares = by_wheel(f"{self.name}.largest", self.largest, spin.shape[1])
        a, b = spin * shares, spin_rate * shares
        a, b = np.hstack([a, -a]), np.hstack([b, -b])
        return linear_rows(self.name, a, b, np.full_like(a, least), least)
