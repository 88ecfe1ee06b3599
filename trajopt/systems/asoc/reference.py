"""What a tracked robot should do: positions and velocities over time along a closed or open path,
and whether the ground asks more tilt of the modules than their pivots allow."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.speed import Speed
from trajopt.paths.path import Path
from trajopt.timing.scaling import time_scale

SPEED = 1.5  # m/s, section 4.3
PLANNED_ACCELERATION = 1.5  # m/s^2, a quarter of what friction 0.6 allows, chosen
_SAMPLES = 0.01  # s between samples of a planned motion, chosen


@dataclass(frozen=True, eq=False)
class Reference:
    """Positions (n, 2) m and velocities (n, 2) m/s at times (n,) s; a velocity holds until the next
    time."""

    times: Array
    positions: Array
    velocities: Array
    corners: Array  # (k, 2) the path itself, straight between corners

    @property
    def duration(self) -> float:
        return float(self.times[-1])

    def at(self, moment: float) -> tuple[Array, Array]:
        """Position and velocity wanted at a time, s; at rest at the end."""
        i = int(
            np.clip(np.searchsorted(self.times, moment, side="right") - 1, 0, len(self.times) - 1)
        )
        place = [float(np.interp(moment, self.times, self.positions[:, k])) for k in (0, 1)]
        return np.array(place), self.velocities[i].copy()

    def distance(self, points: Array) -> Array:
        """(m,): distance of points (m, 2) from the path, m."""
        start, along = self.corners[:-1], np.diff(self.corners, axis=0)
        share = np.einsum("mki,ki->mk", points[:, None] - start, along) / np.sum(along**2, axis=1)
        foot = start + np.clip(share, 0.0, 1.0)[..., None] * along
        return np.asarray(np.min(np.linalg.norm(points[:, None] - foot, axis=-1), axis=1))


def planned_speed(
    corners: ArrayLike, speed: float = SPEED, acceleration: float = PLANNED_ACCELERATION
) -> Reference:
    """The improvement: each side timed by ``time_scale`` under speed and acceleration limits, from
    rest to rest, since a sharp corner allows no speed."""
    points = checked_corners(corners)
    limits = (Speed(speed), Acceleration(acceleration, acceleration))
    start, parts = 0.0, []
    for a, b in pairwise(points):
        trajectory = time_scale(Path.through([a, b], heading=[0.0, 0.0]), limits)
        t = np.linspace(0.0, trajectory.duration, int(trajectory.duration / _SAMPLES) + 2)[:-1]
        state = trajectory.at(t)
        parts.append((t + start, state.pose[:, :2], state.twist[:, :2]))
        start += trajectory.duration
    parts.append((np.array([start]), points[-1:], np.zeros((1, 2))))
    times, positions, velocities = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Reference(times, positions, velocities, points)


def checked_corners(corners: ArrayLike) -> Array:
    points = np.asarray(corners, dtype=np.float64)
    if (
        points.ndim != 2
        or points.shape[1] != 2
        or len(points) < 2
        or not np.all(np.isfinite(points))
    ):
        raise ArgumentError("corners", points.tolist(), "finite points, shape (k, 2), k >= 2, m")
    if np.any(np.linalg.norm(np.diff(points, axis=0), axis=1) == 0):
        raise ArgumentError("corners", points.tolist(), "neighbouring corners that differ")
    return points
