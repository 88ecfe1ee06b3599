"""Random motions of all kinds and sizes: near-cusps, loops, narrow lanes, noise, far from zero."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from graded import ball_robot, plate_robot
from scaling_cases import limit

from trajopt.limits.limit import Limit
from trajopt.paths.path import Path
from trajopt.robots.robot import Robot

BALLS, PLATES = ball_robot(), plate_robot()
FAR = 1e6  # m


@dataclass(frozen=True)
class Wild:
    """One case: what time scaling is given."""

    kind: str
    points: np.ndarray
    heading: np.ndarray | None
    limits: tuple[Limit, ...]
    robot: Robot

    def path(self) -> Path:
        """Raises as ``Path.through``."""
        if self.heading is None:
            return Path.through(self.points)
        return Path.through(self.points, heading=self.heading, turning_length=0.5)


def wild(seed: int) -> Wild:
    """Case ``seed``."""
    rng = np.random.default_rng(seed)
    kind = rng.choice(
        ["wander", "walk", "loop", "lane", "needle", "centre line", "long"],
        p=[0.25, 0.15, 0.15, 0.2, 0.1, 0.13, 0.02],
    )
    points, far = _points(rng, str(kind))
    heading = None
    if rng.random() < 0.3:
        heading = rng.normal(0, 10 ** rng.uniform(-2, 0.5), len(points))
        if rng.random() < 0.5:
            heading = np.cumsum(heading)
    if far:
        points = points + FAR * rng.uniform(-1, 1, 2)
    robot = BALLS if heading is None else PLATES
    return Wild(str(kind), points, heading, _limits(rng), robot)


def _points(rng: np.random.Generator, kind: str) -> tuple[np.ndarray, bool]:
    """Points, and whether they may be moved far from zero."""
    count = int(rng.choice([2, 3, 4, 6, 10, 20, 60], p=[0.05, 0.2, 0.2, 0.25, 0.15, 0.1, 0.05]))
    size = 10 ** rng.uniform(-3, 3)
    far = rng.random() < 0.15
    if kind == "wander":
        return rng.normal(0, 1, (count, 2)) * size, far
    if kind == "walk":
        steps = rng.normal(0, 1, (count, 2)) + np.array([0.8, 0])
        return np.cumsum(steps, axis=0) * size, far
    if kind == "loop":
        turns, count = rng.uniform(0.5, 3), max(count, 8)
        at = np.linspace(0, 2 * np.pi * turns, count)
        wide = 1 + rng.normal(0, 0.1, count) + rng.choice([0.0, 0.1]) * at
        return np.column_stack([wide * np.cos(at), wide * np.sin(at)]) * size, far
    if kind == "lane":
        apart = 10 ** rng.uniform(-8, -2)
        far = far and apart > 1e-5  # what numbers can hold at 1,000 km: 1e-10 m
        points = np.array([[0, 0], [1, 0], [2, apart], [1, 2 * apart], [0, 2 * apart]])
        return points * (1.0 if far else 10 ** rng.uniform(-1, 1)), far
    if kind == "needle":
        apart = 10 ** rng.uniform(-6, -1)
        points = np.array([[0, 0], [1, 0], [rng.uniform(0, 0.9), apart]])
        return points * (1.0 if far else size), far and apart > 1e-4
    count = int(rng.choice([30, 100, 300]) if kind == "centre line" else rng.choice([1000, 2000]))
    along = np.arange(count) * rng.choice([0.5, 2.0, 10.0])
    bend = np.cumsum(np.cumsum(rng.normal(0, 0.03, count)))
    noise = 10 ** rng.uniform(-4, -1) * rng.normal(0, 1, (count, 2))
    return np.column_stack([along, bend]) + noise, far


def _limits(rng: np.random.Generator) -> tuple[Limit, ...]:
    """Some of all limits of level ground, of many sizes; one at least bounds speed and
    acceleration."""
    largest = 10 ** rng.uniform(-0.7, 0.7, 10)
    choices: dict[str, dict[str, object]] = {
        "speed": {"largest": largest[0]},
        "acceleration": {"forward": largest[1], "braking": largest[2]},
        "yaw_rate": {"largest": largest[3]},
        "wheel_speed": {"largest": 10 * largest[4]},
        "wheel_acceleration": {"largest": 10 * largest[5]},
        "slip": {"friction": 0.2 * largest[6]},
        "tip": {},
        "contact": {},
        "wheel_torque": {"largest": 3 * largest[7]},
        "power": {"largest": 50 * largest[8]},
        "motor_curve": {},
    }
    often = {"power": 0.08, "motor_curve": 0.08, "contact": 0.2, "wheel_torque": 0.25}
    names = [n for n in choices if rng.random() < often.get(n, 0.5)]
    names += ["wheel_speed", "wheel_acceleration"]
    return tuple(limit(n, **choices[n]) for n in dict.fromkeys(names))
