"""Gridpoints of time scaling: spline parameters u with every knot among them.

The third derivative of a cubic spline jumps at knots, and with it every row that holds it (wheel
acceleration), so no interval may reach across one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray, as_numbers, require_whole
from trajopt.errors import ArgumentError
from trajopt.paths.path import Path

_CELLS = (
    400  # intervals on a path when the caller does not say; chosen: refinement adds what is missing
)
_CELLS_PER_SEGMENT = 20  # at least this many on a spline segment; chosen
_MOST = 1_000_000  # gridpoints that a caller may ask for; chosen
MOST_REFINED = 100_000  # gridpoints that refinement may make: half a gigabyte of rows; chosen
_MERGE = 1e-12  # gridpoints closer than this share of the path's length are one


def initial_grid(path: Path, gridpoints: int | ArrayLike | None) -> Array:
    """Spline parameters (N+1,) of the gridpoints, increasing, all knots among them.

    ``gridpoints``: None (chosen here), how many, or path parameters s in [0, length], m.
    Raises ArgumentError for fewer than two, or places off the path.
    """
    knots = np.asarray(path.basis.knots)
    spans = np.diff(path.knot_parameters)
    if gridpoints is None:
        cells = np.maximum(_CELLS_PER_SEGMENT, np.ceil(_CELLS * spans / spans.sum()))
    elif isinstance(gridpoints, (int, np.integer)):
        require_whole("gridpoints", gridpoints, 2, f"a number from 2 to {_MOST}", _MOST)
        cells = np.maximum(1, np.round((gridpoints - 1) * spans / spans.sum()))
    else:
        expected = f"path parameters in [0, {path.length:.6g}] m, or their number"
        places = as_numbers("gridpoints", gridpoints, expected, (None,))
        tolerance = 1e-9 * path.length
        if not np.all((places >= -tolerance) & (places <= path.length + tolerance)):
            raise ArgumentError("gridpoints", places.tolist(), expected)
        return insert(path, knots, places)
    s0 = path.knot_parameters
    steps = [
        a + h * np.arange(1, int(n)) / n for a, h, n in zip(s0[:-1], spans, cells, strict=True)
    ]
    return insert(path, knots, np.concatenate(steps))


def insert(path: Path, u: Array, places: Array) -> Array:
    """Grid u with gridpoints added at path parameters ``places``; those that are there already
    merge."""
    inside = places[(places > 0) & (places < path.length)]
    if not len(inside):
        return u
    new = path.locate(inside)
    merge = _MERGE * (path.end - path.start)
    near = np.abs(
        u[np.clip(np.searchsorted(u, new), 1, len(u) - 1)[:, None] - [[1, 0]]] - new[:, None]
    )
    new = np.sort(new[near.min(axis=1) > merge])
    new = new[np.concatenate([[True], np.diff(new) > merge])] if len(new) else new
    return np.sort(np.concatenate([u, new]))


def split(u: Array, where: BoolArray, parts: int, most: int) -> Array:
    """Grid with the intervals ``where`` (N,) cut into ``parts`` equal ones. Raises ArgumentError for
    more than ``most`` gridpoints."""
    if len(u) + (parts - 1) * int(where.sum()) > most:
        expected = f"a path whose limits are kept with at most {most} gridpoints"
        raise ArgumentError("path", f"{len(u)} gridpoints, which are not enough", expected)
    fractions = np.arange(1, parts) / parts
    new = u[:-1][where, None] + (u[1:] - u[:-1])[where, None] * fractions
    return np.sort(np.concatenate([u, new.ravel()]))
