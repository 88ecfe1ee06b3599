"""Torque of every wheel's motor."""

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
)
from trajopt.limits.torques import wheel_torques
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot


@dataclass(frozen=True)
class WheelTorque(Limit):
    """|torque of its motor| <= ``largest``, N m, at every wheel; one number, or one a wheel (W,),
    inf where a wheel has no limit; None: what the robot's file gives.

    The torque carries the wheel's share of the force between robot and ground (load, slope and
    curvature count) and spins the wheel itself up (``limits/torques.py``). On a straight ramp of
    angle g, with W driven wheels of mass m_w in a robot of mass m: r m (s'' + 9.81 sin g) / W +
    m_w r s'' / 2. Motors brake as hard as they drive. Two rows a driven wheel, linear in
    (s'', s'^2).

    Raises ArgumentError unless ``largest`` > 0, for a robot without motors, skid-steered or without
    the motors to move as it may, for another number of values than wheels, or no robot.
    """

    largest: float | tuple[float, ...] | None = None  # N m
    name: str = "wheel_torque"

    def __post_init__(self) -> None:
        if self.largest is not None:
            require_each_positive(f"{self.name}.largest", self.largest, "N m")

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        robot = require_robot(self.name, robot)
        own = tuple(robot.motor_array("torque").tolist())
        asked = own if self.largest is None else self.largest
        least, shares = by_wheel(f"{self.name}.largest", asked, len(own))
        torque = wheel_torques(path, robot) * shares
        a, b, c = (np.hstack([part, -part]) for part in (torque.a, torque.b, torque.c))
        return linear_rows(self.name, a, b, least - c, least)
