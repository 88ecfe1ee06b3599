"""Acceleration and braking along the direction of travel, asymmetric."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import require_positive
from trajopt.limits.limit import Limit, Rows, linear_rows
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot

_MOVING = (
    1e-6  # translation per path parameter below which it is a turn on the spot; as in paths/samples
)


@dataclass(frozen=True)
class Acceleration(Limit):
    """Rate of translational speed between -``braking`` and ``forward``, m/s^2 ([waheed2006], eqs.
    2.7, 2.8).

    The speed is v = p s' with p = |(twist_x, twist_y)|, so v' = p s'' + (d . twist_rate) s'^2 with
    d the direction of travel in the body frame: exactly linear, and equal to s'' where the robot
    drives along its heading. Centripetal acceleration does not count (that is what ``Slip`` is
    for), nor what the robot does along its normal over a crest, and a turn on the spot is not
    bounded (that is what ``WheelAcceleration`` is for). Raises ArgumentError unless both are > 0.
    """

    forward: float  # m/s^2
    braking: float  # m/s^2, a magnitude
    name: str = "acceleration"

    def __post_init__(self) -> None:
        require_positive(f"{self.name}.forward", self.forward, "m/s^2")
        require_positive(f"{self.name}.braking", self.braking, "m/s^2 (a magnitude)")

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:  # noqa: ARG002
        travel = path.twist[:, :2]
        p = np.hypot(travel[:, 0], travel[:, 1])
        moving = p > _MOVING
        direction = np.where(moving[:, None], travel / np.where(moving, p, 1.0)[:, None], 0.0)
        a = np.where(moving, p, 0.0)
        b = np.sum(direction * path.twist_rate[:, :2], axis=1)
        limits = np.tile([self.forward, self.braking], (len(p), 1))
        return linear_rows(
            self.name, np.column_stack([a, -a]), np.column_stack([b, -b]), limits, limits
        )
