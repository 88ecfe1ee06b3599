"""Speed of every wheel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.limits.limit import (
    Limit,
    Rows,
    by_wheel,
    require_each_positive,
    require_robot,
    speed_rows,
    spins,
)
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot


@dataclass(frozen=True)
class WheelSpeed(Limit):
    """|wheel rate| <= ``largest``, rad/s, of every wheel (rolling rows of [wheels-lecture]); one
    number, or one a wheel (W,), inf where a wheel has no limit.

    With steered wheels and castors where they stand; for two fixed wheels at +-b it is s'^2 <= (r largest / (1 + b |kappa|))^2.
    Raises ArgumentError unless ``largest`` > 0, when there is no robot, or for another number of
    values than wheels.
    """

    largest: float | tuple[float, ...]  # rad/s
    name: str = "wheel_speed"

    def __post_init__(self) -> None:
        require_each_positive(f"{self.name}.largest", self.largest, "rad/s")

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        spin, _ = spins(path, require_robot(self.name, robot))
        least, shares = by_wheel(f"{self.name}.largest", self.largest, spin.shape[1])
        return speed_rows(self.name, np.max(np.abs(spin) * shares, axis=1), least)
