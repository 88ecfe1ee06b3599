"""The steepest slope that a robot holds and climbs straight ahead."""

from __future__ import annotations

import numpy as np

from trajopt.limits.motor_curve import at_wheel
from trajopt.limits.slip import Slip
from trajopt.limits.torques import ground_torques
from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples, sample_path
from trajopt.robots.robot import Robot

_STEPS = 40  # of bisection: to 1e-12 rad


def grade_by_torque(robot: Robot) -> float:
    """rad: from standing still, by the torque of the motors there; pi/2 where they lift the robot's
    weight. Raises ArgumentError as ``limits.torques.ground_torques``."""
    most = robot.motor_array("torque")
    for motor in robot.description.motors:
        for i in (robot.wheel_names.index(name) for name in motor.wheels):
            most[i] = min([most[i], *(torque for _, torque in at_wheel(motor)[:1])])
    # at rest torques are proportional to the part of gravity along the slope, which is its sine
    one = 0.5
    needed = np.abs(ground_torques(_uphill(one), robot).c[0]) / np.sin(one)
    return float(np.arcsin(min(1.0, float((most[needed > 0] / needed[needed > 0]).min()))))


def grade_by_friction(robot: Robot, friction: float) -> float:
    """rad: by what all wheels together hold at rest with a friction coefficient. Raises
    ArgumentError as ``Slip``."""
    slip, still = Slip(friction, rule="capacity"), np.zeros(1)
    low, high = 0.0, np.pi / 2 - 1e-3
    for _ in range(_STEPS):
        middle = (low + high) / 2
        holds = float(slip.needed(_uphill(middle), robot, still, still)[0]) <= 1
        low, high = (middle, high) if holds else (low, middle)
    return low


def _uphill(angle: float) -> PathSamples:
    path = Path.through([[0.0, 0.0, 0.0], [np.cos(angle), 0.0, np.sin(angle)]])
    return sample_path(path, np.array([0.5]))
