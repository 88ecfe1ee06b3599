"""Speed of every driven wheel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import require_positive
from trajopt.limits.limit import Rows, require_robot, speed_rows
from trajopt.paths.samples import PathSamples
from trajopt.robots.platform import Platform


@dataclass(frozen=True)
class WheelSpeed:
    """|wheel rate| <= ``largest``, rad/s, on every driven wheel (rolling rows of lecture 003).

    For two fixed wheels at +-b it is s'^2 <= (r largest / (1 + b |kappa|))^2.
    Raises ArgumentError unless ``largest`` > 0, or when there is no robot.
    """

    largest: float  # rad/s
    name: str = "wheel_speed"

    def __post_init__(self) -> None:
        require_positive(f"{self.name}.largest", self.largest, "rad/s")

    def rows(self, path: PathSamples, robot: Platform | None) -> Rows:
        rates = path.twist @ require_robot(self.name, robot).inverse.T
        return speed_rows(self.name, np.max(np.abs(rates), axis=1), self.largest)
