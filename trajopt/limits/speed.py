"""Translational speed of the robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import require_positive
from trajopt.limits.limit import Limit, Rows, speed_rows
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot


@dataclass(frozen=True)
class Speed(Limit):
    """Translational speed of the body origin <= ``largest``, m/s ([waheed2006], eq. 2.6).

    Where the robot turns on the spot only translation counts, so nothing is bounded there.
    Raises ArgumentError unless ``largest`` > 0.
    """

    largest: float  # m/s
    name: str = "speed"

    def __post_init__(self) -> None:
        require_positive(f"{self.name}.largest", self.largest, "m/s")

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:  # noqa: ARG002
        return speed_rows(self.name, np.hypot(path.twist[:, 0], path.twist[:, 1]), self.largest)
