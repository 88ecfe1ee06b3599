"""Points that a path is laid through: checks, knots, laps."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, Shape, as_numbers
from trajopt.errors import ArgumentError
from trajopt.paths.spline import chord_length_knots

_LARGEST = 1e7  # m (and rad): farther than any robot drives; squares of it keep nine digits of a metre. Chosen


def finite_numbers(
    name: str, values: ArrayLike, expected: str, shape: Shape | None = None
) -> Array:
    """``values`` as numbers that are finite and not beyond reach. Raises ArgumentError."""
    array = as_numbers(name, values, expected, shape)
    if not np.all(np.abs(array) <= _LARGEST):  # NaN is refused too
        raise ArgumentError(name, array.tolist(), f"finite numbers, at most {_LARGEST:g} in size")
    return array


def default_knots(points: Array, yaw: Array | None, turning_length: float) -> tuple[float, ...]:
    """Chord lengths, or with turns on the spot chord and turn together."""
    if yaw is None or np.all(np.any(np.diff(points, axis=0) != 0, axis=1)):
        return chord_length_knots(points)
    length = as_numbers("turning_length", turning_length, "a finite length > 0 m")
    return chord_length_knots(np.column_stack([points, length * yaw]))


def lap(points: Array, yaw: Array | None) -> tuple[Array, Array | None]:
    """Points and headings that end as they began."""
    if len(points) > 1 and np.array_equal(points[0], points[-1]):
        points = points[:-1]
        yaw = None if yaw is None else yaw[:-1]
    if len(points) < 3:
        raise ArgumentError("points", points.tolist(), "three or more points for a closed lap")
    if yaw is not None:
        turns = np.round((yaw[-1] - yaw[0]) / (2 * np.pi))
        yaw = np.append(yaw, yaw[0] + 2 * np.pi * turns)
    return np.vstack([points, points[:1]]), yaw
