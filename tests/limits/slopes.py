"""Paths and samples on slopes that tests of forces share."""

from __future__ import annotations

import numpy as np

from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import STANDARD_GRAVITY, Robot
from trajopt.timing.track import track
from trajopt.world.ground import Ground
from trajopt.world.plane import Plane

G, UP = STANDARD_GRAVITY, np.pi / 2  # planes of most tests rise along y
CURVE = [[0, 0], [1, 0.4], [2, -0.2], [3, 0.5]]
GENTLE = [[0, 0], [1.5, 0.2], [3, -0.1], [4.5, 0.3]]


def along_of(one: Robot, ground: Ground, path: Path, s: np.ndarray) -> PathSamples:
    found = track(path, one, ground)
    return found.samples(s, found.path.locate(s))


def rest_on(one: Robot, slope: float, heading: float) -> PathSamples:
    """One sample of a straight path in a direction (rad, x across the slope)."""
    line = Path.through([[0, 0], [5 * np.cos(heading), 5 * np.sin(heading)]])
    return along_of(one, Plane(slope, UP), line, np.array([2.0]))
