"""Random robots, grounds, paths and limits for the check in space."""

from __future__ import annotations

import numpy as np

from trajopt.limits.acceleration import Acceleration
from trajopt.limits.contact import Contact
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.steering_acceleration import SteeringAcceleration
from trajopt.limits.steering_rate import SteeringRate
from trajopt.limits.tip import Tip
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.limits.yaw_rate import YawRate
from trajopt.paths.path import Path
from trajopt.robots.robot import Robot, robot
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory
from trajopt.world.ground import Ground
from trajopt.world.height_map import HeightMap
from trajopt.world.plane import Plane
from trajopt.world.ramp import Ramp, Ramps
from trajopt.world.rough import rough_ground
from trajopt.world.terrain import Flat

KINDS = (
    "powerbot",
    "small-differential",
    "loc8",
    "omni-3",
    "asoc-3",
    "asoc-4",
    "car",
    "tricycle",
    "swerve",
)
DRIVEN = ("powerbot", "small-differential", "car", "swerve")  # all that hold, along and across
GROUNDS = ("level", "plane", "ramp", "hills", "rough")


def random_ground(kind: str, rng: np.random.Generator) -> Ground:
    if kind == "level":
        return Flat()
    if kind == "plane":
        return Plane(np.radians(rng.uniform(0, 12)), rng.uniform(-np.pi, np.pi))
    if kind == "ramp":
        place, direction = rng.uniform(-0.5, 2.0, 2), rng.uniform(-np.pi, np.pi)
        ramp = Ramp(
            tuple(place), direction, rng.uniform(1, 3), rng.uniform(0.1, 0.4), 0.6, "smooth"
        )
        return Ramps((ramp,), 1.0)
    if kind == "rough":
        return rough_ground(0.02, rng=rng, size=16.0, correlation=1.2, spacing=0.2)
    axis = np.arange(-40, 41) * 0.2
    x, y = np.meshgrid(axis, axis)
    a, b, c, d = rng.uniform(0.3, 0.9, 4)
    heights = 0.12 * np.sin(a * x + c) * np.cos(b * y + d) + 0.05 * np.sin(1.3 * x - 0.7 * y)
    return HeightMap(heights, 0.2, (-8.0, -8.0))


def random_path(one: Robot, rng: np.random.Generator) -> Path:
    """Wanders forward; gently where steering has a range."""
    count = int(rng.integers(3, 6))
    bends = any(group.range for group in one.description.steering)
    turn = np.cumsum(rng.uniform(-1, 1, count) * (0.12 if bends else 0.7)) + rng.uniform(-3, 3)
    step = rng.uniform(0.5, 1.3, count)[:, None] * (1.5 if bends else 1.0)
    points = np.cumsum(np.column_stack([np.cos(turn), np.sin(turn)]) * step, axis=0)
    free = one.drivable.shape[1] == 3 and rng.random() < 0.8
    heading = turn[0] + np.cumsum(rng.uniform(-0.7, 0.7, count)) if free else None
    return Path.through(points - points[0], heading=heading, turning_length=one.turning_length)


def random_limits(one: Robot, rng: np.random.Generator) -> list:
    other = rng.choice(["capacity", "load"] if one.name in DRIVEN else ["capacity"])
    radius = min(wheel.radius for wheel in one.description.wheels)
    limits = [
        Speed(rng.uniform(0.4, 1.5)),
        WheelSpeed(rng.uniform(0.5, 2.0) / radius),
        Slip(rng.uniform(0.5, 0.9), rule="least_norm" if rng.random() < 0.5 else other),
        Tip(),
    ]
    if rng.random() < 0.5:
        limits.append(WheelAcceleration(rng.uniform(0.5, 3.0) / radius))
    if rng.random() < 0.3:
        limits.append(Acceleration(rng.uniform(0.3, 2.0), rng.uniform(0.3, 2.0)))
    if rng.random() < 0.3:
        limits.append(YawRate(rng.uniform(0.3, 2.0)))
    if rng.random() < 0.3:
        limits.append(Contact())
    if one.name == "swerve":
        limits += [SteeringRate(rng.uniform(0.5, 3.0)), SteeringAcceleration(rng.uniform(2, 9))]
    return limits


def random_motion(seed: int) -> Trajectory:
    """Raises InfeasibleError where there is none."""
    rng = np.random.default_rng(seed)
    one = robot(KINDS[seed % len(KINDS)])
    ground = random_ground(GROUNDS[(seed // len(KINDS)) % len(GROUNDS)], rng)
    return time_scale(
        random_path(one, rng), random_limits(one, rng), robot=one, ground=ground, gridpoints=120
    )
