"""The simulator's own test: drive straight and compare with kinematics ([guzman2015], section
5.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from trajopt.arrays import require_positive
from trajopt.errors import ArgumentError
from trajopt.robots.robot import Robot
from trajopt.simulate.engine import Command, Recording

# Body directions of the three tests [rad] ([guzman2015], Figure 5.6; left in right-handed axes).
DIRECTIONS: tuple[tuple[str, float], ...] = (
    ("forward", 0.0),
    ("lateral", math.pi / 2.0),
    ("diagonal", math.pi / 4.0),
)


@dataclass(frozen=True)
class Deviation:
    """Final place minus the commanded one: ``along``, ``across`` as shares of the distance, ``yaw``
    [rad]."""

    along: float
    across: float
    yaw: float


def straight_command(
    robot: Robot, direction: float, distance: float, speed: float, *, ramp: float = 0.5
) -> Command:
    """Wheel speeds that carry ``robot`` straight by ``distance`` [m] at ``speed`` [m/s].

    ``direction`` [rad] in the body, ``ramp`` [s] to full speed and to rest again (chosen: 1.7 m/s^2
    at 3 km/h, below what friction transmits). Raises ArgumentError for a distance, speed or ramp
    that is not positive, for a distance too short to reach full speed, and for a direction in which
    the robot's wheels do not roll.
    """
    for name, value in (("distance", distance), ("speed", speed), ("ramp", ramp)):
        require_positive(name, value)
    if distance < speed * ramp:
        raise ArgumentError("distance", distance, f"at least speed * ramp = {speed * ramp:.3g} m")
    twist = speed * np.array([math.cos(direction), math.sin(direction), 0.0])
    allowed = robot.admissible
    if np.abs(twist - allowed @ allowed.T @ twist).max() > 1e-9 * speed:
        raise ArgumentError("direction", direction, "one in which every wheel rolls")
    end = distance / speed + ramp
    share = np.array([0.0, 1.0, 1.0, 0.0]) if end > 2.0 * ramp else np.array([0.0, 1.0, 0.0])
    times = (
        np.array([0.0, ramp, end - ramp, end]) if end > 2.0 * ramp else np.array([0.0, ramp, end])
    )
    return Command(times, share[:, None] * (robot.inverse @ twist)[None, :])


def deviation(recording: Recording, direction: float, distance: float) -> Deviation:
    """How far the run ended from ``distance`` [m] in body ``direction`` [rad] of its first pose."""
    first, last = recording.pose[0], recording.pose[-1]
    heading = float(first[2]) + direction
    moved = last[:2] - first[:2]
    along = float(moved @ np.array([math.cos(heading), math.sin(heading)]))
    across = float(moved @ np.array([-math.sin(heading), math.cos(heading)]))
    return Deviation((along - distance) / distance, across / distance, float(last[2] - first[2]))
