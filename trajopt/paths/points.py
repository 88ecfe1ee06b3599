"""Points that a path is laid through: checks, knots, laps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, Shape, as_numbers
from trajopt.errors import ArgumentError
from trajopt.paths.spline import SplineBasis, chord_length_knots

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


def interpolated(
    points: ArrayLike,
    heading: ArrayLike | None,
    knots: ArrayLike | None,
    ends: Mapping[str, ArrayLike | None],
    turning_length: float,
    closed: bool,
) -> tuple[SplineBasis, Array, Array | None]:
    """Basis and control values of ``Path.through``, coordinates and headings; ``ends``: directions at
    start and end, by the name of their argument."""
    array = finite_numbers("points", points, "shape (N, 2) or (N, 3) with N >= 2")
    if array.ndim != 2 or array.shape[0] < 2 or array.shape[1] not in (2, 3):
        raise ArgumentError("points", array.shape, "shape (N, 2) or (N, 3) with N >= 2")
    yaw = None
    if heading is not None:
        expected = f"one angle a point, shape ({len(array)},)"
        yaw = finite_numbers("heading", heading, expected, (len(array),))
    if closed:
        array, yaw = lap(array, yaw)
    given = (
        default_knots(array, yaw, turning_length)
        if knots is None
        else tuple(as_numbers("knots", knots, "increasing numbers").ravel().tolist())
    )
    if len(given) != len(array):
        raise ArgumentError("knots", len(given), f"one knot a point ({len(array)})")
    first, last = (end is not None for end in ends.values())
    basis = SplineBasis(given, first, last, bool(closed))
    dimensions = array.shape[1:]
    rates = [
        finite_numbers(name, end, f"{dimensions[0]} numbers", dimensions)
        for name, end in ends.items()
        if end is not None
    ]
    coordinates = np.vstack([array, *rates]) if rates else array
    if yaw is not None and rates:  # ends turn at the mean rate, if clamped
        span = (yaw[-1] - yaw[0]) / (given[-1] - given[0])
        yaw = np.concatenate([yaw, np.full(len(rates), span)])
    return basis, coordinates, yaw
