"""Power of all motors together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from trajopt.arrays import require_positive
from trajopt.limits.forces import Affine
from trajopt.limits.limit import Limit, Rows, linear_rows, require_robot
from trajopt.limits.torques import motor_power, tangent_speed
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot


@dataclass(frozen=True)
class Power(Limit):
    """Sum over the motors of torque times speed <= ``largest``, W: mechanical power, in which a
    motor that brakes feeds the others. Braking is not bounded.

    With G = sum spin_i torque_i it is G s' <= P, that is G <= P / sqrt(s'^2), whose right side bends
    up: its tangent at ``path.sd2``, G <= P / s'_k (3 - s'^2 / s'_k^2) / 2, is exact there and
    stricter everywhere else, as for ``MotorCurve``. Without ``path.sd2`` the row bounds nothing.
    One row. Raises ArgumentError unless ``largest`` > 0, and as ``WheelTorque``.
    """

    largest: float  # W
    name: str = "power"
    linear: ClassVar[bool] = False
    free_at_rest: ClassVar[bool] = True

    def __post_init__(self) -> None:
        require_positive(f"{self.name}.largest", self.largest, "W")

    def work(self, path: PathSamples, robot: Robot | None) -> Affine:
        """(N, 1): G, work of all motors per unit of path, N."""
        robot = require_robot(self.name, robot)
        return motor_power(path, robot).through(np.ones((1, len(robot.wheels))))

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        work = self.work(path, robot)
        speed = tangent_speed(path.sd2)
        if speed is None:
            nothing = np.zeros_like(work.a)
            return linear_rows(self.name, nothing, nothing, nothing + self.largest, self.largest)
        force = self.largest / speed[:, None]
        b = work.b + force / (2 * speed[:, None] ** 2)
        return linear_rows(self.name, work.a, b, 1.5 * force - work.c, force)
