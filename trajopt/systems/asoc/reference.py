"""What a tracked robot should do: positions and velocities over time along a closed or open path,
and whether the ground asks more tilt of the modules than their pivots allow."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, require_positive
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.speed import Speed
from trajopt.paths.path import Path
from trajopt.systems.asoc.modules import AsocGeometry, largest_pivot, wheel_positions
from trajopt.timing.scaling import time_scale
from trajopt.world.height_map import HeightMap
from trajopt.world.wheel_contact import wheel_contact

SIDE = 4.5  # m, square of [udengaard2008], section 4.3
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


def square_corners(side: float = SIDE) -> Array:
    """(5, 2): corners of the square, counter-clockwise from the origin, m."""
    return side * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]])


def constant_speed(corners: ArrayLike, speed: float = SPEED) -> Reference:
    """The thesis's command: one speed along every side, turned in no time at the corners."""
    points = _checked(corners)
    require_positive("speed", speed, "m/s")
    sides = np.diff(points, axis=0)
    length = np.linalg.norm(sides, axis=1)
    times = np.concatenate([[0.0], np.cumsum(length / speed)])
    return Reference(
        times, points, np.vstack([sides / length[:, None] * speed, np.zeros(2)]), points
    )


def planned_speed(
    corners: ArrayLike, speed: float = SPEED, acceleration: float = PLANNED_ACCELERATION
) -> Reference:
    """The improvement: each side timed by ``time_scale`` under speed and acceleration limits, from
    rest to rest, since a sharp corner allows no speed."""
    points = _checked(corners)
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


def require_pivots(
    geometry: AsocGeometry, ground: HeightMap, reference: Reference, *, every: float = 0.02
) -> float:
    """Largest tilt (rad) that the ground asks of a module along the path, body level, modules
    trailing.

    Raises InfeasibleError, with place (m along the path) and angle, where it is more than eq. 8
    allows.
    """
    allowed = float(largest_pivot(geometry.offset, geometry.split, geometry.wheel_radius))
    worst, done = 0.0, 0.0
    for a, b in pairwise(reference.corners):
        length, heading = float(np.linalg.norm(b - a)), float(np.arctan2(*(b - a)[::-1]))
        s = np.linspace(0.0, length, int(length / every) + 2)
        centres = a + s[:, None] * (b - a) / length
        local = wheel_positions(geometry, np.full(geometry.modules, heading))
        places = (local + centres[:, None, None]).reshape(-1, 2)
        heights = wheel_contact(
            ground, places[:, 0], places[:, 1], heading, geometry.wheel_radius
        ).centre_height
        tilt = np.abs(np.arctan(np.diff(heights.reshape(-1, 2), axis=1) / geometry.split)).reshape(
            len(s), -1
        )
        i, module = np.unravel_index(int(np.argmax(tilt)), tilt.shape)
        if tilt[i, module] > allowed:
            x, y = places.reshape(len(s), -1, 2, 2)[i, module].mean(axis=0)
            raise InfeasibleError(
                "pivot",
                done + float(s[i]),
                f"module {module} at ({x:.3g}, {y:.3g}) m must tilt "
                f"{np.degrees(tilt[i, module]):.3g} deg, the pivots allow "
                f"{np.degrees(allowed):.3g} deg",
            )
        worst, done = max(worst, float(tilt[i, module])), done + length
    return worst


def _checked(corners: ArrayLike) -> Array:
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
