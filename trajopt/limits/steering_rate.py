"""Rate of every steering angle."""

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
    steered_wheels,
    turns_of,
)
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot


@dataclass(frozen=True)
class SteeringRate(Limit):
    """|steering rate| <= ``largest``, rad/s, of every [[steering]] of the robot; one number, or one
    each (G,), inf where there is no limit; None: those of the robot's file.

    It holds for every wheel that the [[steering]] turns, the inner one of a car included, and for
    its angle, that of a wheel in their middle. Angles are functions of the path: rate = rate per
    path x s'.
    Raises ArgumentError unless ``largest`` > 0, for a robot that does not steer or whose file gives
    no rate where none is asked for, or without a robot.
    """

    largest: float | tuple[float, ...] | None = None  # rad/s
    name: str = "steering_rate"

    def __post_init__(self) -> None:
        if self.largest is not None:
            require_each_positive(f"{self.name}.largest", self.largest, "rad/s")

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        wheels, own = steered_wheels(self.name, path, robot, "rate")
        asked = own if self.largest is None else self.largest
        least, shares = by_wheel(f"{self.name}.largest", asked, len(own))
        turns = turns_of(wheels, require_robot(self.name, robot))
        each = np.broadcast_to(shares, len(own))[turns.group]
        return speed_rows(self.name, np.max(np.abs(turns.rate) * each, axis=1), least)
