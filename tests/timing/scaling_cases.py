"""Robots, paths and limits that the time-scaling tests share."""

from __future__ import annotations

import numpy as np

from trajopt.limits.registry import LIMITS
from trajopt.paths.path import Path
from trajopt.robots.robot import Robot, robot

NAN = float("nan")
MOTOR = {"curve": [[0.0, 9.0], [60.0, 0.0]]}  # of a DC motor: stall torque, free speed


def rear_cog_robot(friction_height: float = 0.215) -> Robot:
    """Differential drive: axle at x = 0, casters at x = -0.35, centre of gravity 0.132 m behind the
    axle."""
    size = {"radius": 0.12, "width": 0.05, "mass": 2.0}
    wheels = [
        {"name": name, "kind": "fixed", "position": [0.0, y], **size}
        for name, y in (("left", 0.2), ("right", -0.2))
    ]
    wheels += [
        {"name": name, "kind": "castor", "position": [-0.3, y], "trail": 0.05, **size}
        for name, y in (("castor-left", 0.15), ("castor-right", -0.15))
    ]
    return Robot.of(
        {
            "name": "rear-cog",
            "body": {
                "mass": 120.0,
                "cog": [-0.132, 0.0, friction_height],
                "yaw_inertia": 8.0,
                "chassis": [0.7, 0.6, 0.2],
                "chassis_place": [-0.15, 0.0],
                "clearance": 0.1,
            },
            "wheels": wheels,
            "motors": [{"name": "drives", "wheels": ["left", "right"], "torque": 9.0} | MOTOR],
        }
    )


ROBOTS = {"loc8": robot("loc8"), "rear_cog": rear_cog_robot(), "swerve": robot("swerve")}


def robot_for(name: str, shape: str) -> Robot:
    """One that the limit ``name`` acts on and that drives the path ``shape``."""
    if name.startswith("steering"):
        return ROBOTS["swerve"]
    if name in ("motor_curve", "wheel_torque") and shape in HOLONOMIC_ONLY:
        return ROBOTS["loc8"].replace({"motors.all.curve": MOTOR["curve"]})
    return ROBOTS["loc8" if shape in HOLONOMIC_ONLY else "rear_cog"]


_SLALOM = [[0, 0], [1, 0.5], [2, -0.5], [3, 0.3]]
PATHS = {
    "straight": Path.through([[0, 0], [2, 0]]),
    "slalom": Path.through(_SLALOM),
    "hairpin": Path.through([[0, 0], [2, 0], [2.3, 0.4], [2, 0.8], [0, 0.8]]),
    "ramp": Path.through([[0, 0, 0], [1, 0, 0], [2, 0.2, 0.1], [3, 0.2, 0.2], [4, 0, 0.2]]),
    "turning": Path.through(_SLALOM, heading=[0, 1, 2, 0.5], turning_length=0.49),
    "sideways": Path.through([[0, 0], [0.2, 1], [0, 2]], heading=[0, 0, 0], turning_length=0.49),
}
HOLONOMIC_ONLY = {"turning", "sideways"}

ARGUMENTS: dict[str, dict[str, object]] = {
    "acceleration": {"forward": 0.7, "braking": 1.1},
    "contact": {},
    "motor_curve": {},
    "power": {"largest": 60.0},
    "slip": {"friction": 0.5},
    "speed": {"largest": 1.5},
    "speed_profile": {"places": (0.0, 0.5, 1.2), "speeds": (0.6, 1.0, 0.5)},
    "speed_zones": {"zones": ((0.3, 0.8, 0.4), (0.6, 1.4, 0.6))},
    "steering_acceleration": {"largest": 4.0},
    "steering_rate": {"largest": 0.8},
    "tip": {},
    "wheel_acceleration": {"largest": 15.0},
    "wheel_speed": {"largest": 12.0},
    "wheel_torque": {},
    "yaw_rate": {"largest": 0.9},
}


def limit(kind: str, **changes: object):
    return LIMITS[kind](**{**ARGUMENTS[kind], **changes})


def random_path(rng: np.random.Generator, *, free_heading: bool, knots: int) -> Path:
    """A path that wanders forward, so that it never doubles back on itself."""
    steps = np.cumsum(rng.uniform(-0.8, 0.8, knots - 1))
    points = np.vstack(
        [
            [0.0, 0.0],
            np.cumsum(
                np.column_stack([np.cos(steps), np.sin(steps)])
                * rng.uniform(0.4, 1.5, (knots - 1, 1)),
                axis=0,
            ),
        ]
    )
    heading = np.cumsum(rng.uniform(-0.8, 0.8, knots)) if free_heading else None
    return Path.through(points, heading=heading, turning_length=0.49)


def random_limits(rng: np.random.Generator) -> list:
    """Wheel, slip, speed and acceleration limits of random size; tip now and then."""
    limits = [
        limit("speed", largest=rng.uniform(0.3, 2.0)),
        limit("wheel_speed", largest=rng.uniform(3.0, 20.0)),
        limit("wheel_acceleration", largest=rng.uniform(3.0, 30.0)),
        limit("slip", friction=rng.uniform(0.1, 0.9)),
    ]
    if rng.random() < 0.5:
        limits.append(
            limit("acceleration", forward=rng.uniform(0.2, 2.0), braking=rng.uniform(0.2, 2.0))
        )
    if rng.random() < 0.5:
        limits.append(limit("tip"))
    return limits
