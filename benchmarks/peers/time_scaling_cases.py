"""What the time scaling engines are timed on: a robot, a path, rows of both kinds."""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array
from trajopt.limits.slip import Slip
from trajopt.limits.tip import Tip
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.paths.path import Path
from trajopt.paths.samples import sample_at
from trajopt.robots.robot import Robot
from trajopt.robots.robot import robot as shipped
from trajopt.timing.stages import Stages, assemble

SPEED, ACCELERATION = (1.0, 1.5), (2.0, 1.5)  # of the two coordinates, m/s and m/s^2; chosen


def robot() -> Robot:
    """A differential drive with castors, PowerBot with half track, mass and inertia chosen."""
    return shipped(
        "powerbot",
        {
            "body.mass": 120.0,
            "body.yaw_inertia": 8.0,
            "wheels.left.position": [0.0, 0.2],
            "wheels.right.position": [0.0, -0.2],
            "wheels.all.radius": 0.12,
            "wheels.castor-left.position": [-0.31, 0.2],
            "wheels.castor-right.position": [-0.31, -0.2],
        },
    )


def curve(seed: int = 0) -> Path:
    """A path of seven points that wanders."""
    steps = np.cumsum(np.random.default_rng(seed).uniform(-0.7, 0.7, 6))
    return Path.through(
        np.vstack([[0, 0], np.cumsum(np.column_stack([np.cos(steps), np.sin(steps)]), axis=0)])
    )


def force_stages(points: int, seed: int = 0) -> Stages:
    """Slip as a 16-gon, tip, wheel acceleration and wheel speed at ``points`` gridpoints."""
    path = curve(seed)
    u = np.linspace(path.start, path.end, points)
    limits = (Slip(0.332, rule="load"), Tip(), WheelAcceleration(8.0), WheelSpeed(12.0))
    return assemble(sample_at(path, path.parameter(u), u), limits, robot())


def coordinate_stages(points: int) -> tuple[Stages, Array, Array, Array]:
    """Rows of |q'| sd <= V, |q' s'' + q'' s'^2| <= A for x and y, and q, q', q''."""
    path = curve()
    u = np.linspace(path.start, path.end, points)
    q, dq, ddq = (path.position(u, k)[:, :2] for k in range(3))
    return coordinate_rows(u - u[0], dq, ddq), q, dq, ddq


def coordinate_rows(s: Array, dq: Array, ddq: Array) -> Stages:
    """The rows alone, from q' and q''."""
    limits = np.array(ACCELERATION)
    a, b = np.hstack([dq, -dq]) / np.tile(limits, 2), np.hstack([ddq, -ddq]) / np.tile(limits, 2)
    sd2_max = np.min((np.array(SPEED) / np.maximum(np.abs(dq), 1e-12)) ** 2, axis=1)
    owner = np.zeros(4, dtype=np.intp)
    return Stages(s, a, b, np.ones_like(a), sd2_max, ("coordinates",), owner, sd2_max[None, :], ())
