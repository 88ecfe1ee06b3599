"""Yaw rate of the robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import require_positive
from trajopt.limits.limit import Limit, Rows, speed_rows
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot


@dataclass(frozen=True)
class YawRate(Limit):
    """|yaw rate| <= ``largest``, rad/s. Raises ArgumentError unless ``largest`` > 0."""

    largest: float  # rad/s
    name: str = "yaw_rate"

    def __post_init__(self) -> None:
        require_positive(f"{self.name}.largest", self.largest, "rad/s")

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:  # noqa: ARG002
        return speed_rows(self.name, np.abs(path.twist[:, 2]), self.largest)
