"""Acceleration of every steering angle."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trajopt.limits.limit import (
    Limit,
    Rows,
    by_wheel,
    linear_rows,
    require_each_positive,
    require_robot,
    steered_wheels,
    turns_of,
)
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot

_CORNER = 1e-3  # rad, chosen: a tenth of what a steering may deviate from its plan


@dataclass(frozen=True)
class SteeringAcceleration(Limit):
    """|steering acceleration| <= ``largest``, rad/s^2, of every [[steering]] of the robot; one number, or one
    each (G,), inf where there is no limit; None: those of the robot's file.

    It holds for every wheel that the [[steering]] turns, and for its angle, that of a wheel in their
    middle. Angles are functions of the path: acceleration = rate s'' + bend s'^2, each per path. Two
    rows a wheel and an angle.

    Where the rate itself jumps (a car's at the knots of a cubic spline, where curvature has a
    corner) steering takes the corner: with its acceleration a, evenly before and after, the angle
    deviates by jump^2 / (8 a) at most, which is bounded by 1 mrad, and so is the speed there.
    Raises ArgumentError unless ``largest`` > 0, for a robot that does not steer or whose file gives
    no acceleration where none is asked for, or without a robot.
    """

    largest: float | tuple[float, ...] | None = None  # rad/s^2
    name: str = "steering_acceleration"

    def __post_init__(self) -> None:
        if self.largest is not None:
            require_each_positive(f"{self.name}.largest", self.largest, "rad/s^2")

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        wheels, own = steered_wheels(self.name, path, robot, "acceleration")
        asked = own if self.largest is None else self.largest
        least, shares = by_wheel(f"{self.name}.largest", asked, len(own))
        turns = turns_of(wheels, require_robot(self.name, robot))
        each = np.broadcast_to(shares, len(own))
        a, b = turns.rate * each[turns.group], turns.bend * each[turns.group]
        a, b = np.hstack([a, -a]), np.hstack([b, -b])
        with np.errstate(divide="ignore"):
            corner = 8 * _CORNER * least / np.max(wheels.group_jump**2 * shares, axis=1)
        return replace(linear_rows(self.name, a, b, np.full_like(a, least), least), sd2_max=corner)
