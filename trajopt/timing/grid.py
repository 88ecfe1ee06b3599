"""Gridpoints of time scaling: spline parameters u with every knot among them.

The third derivative of a cubic spline jumps at knots, and with it every row that holds it (wheel
acceleration), so no interval may reach across one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray, as_numbers, require_whole
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path
from trajopt.timing.cells import Measure

_CELLS = (
    400  # intervals on a path when the caller does not say; chosen: refinement adds what is missing
)
_CELLS_PER_SEGMENT = 20  # at least this many on a spline segment; chosen
_MOST = 1_000_000  # gridpoints that a caller may ask for; chosen
MOST_REFINED = 100_000  # gridpoints that refinement may make: half a gigabyte of rows; chosen
_MOST_CELLS = 60_000  # for memory; chosen
_CLOSE = 1e-6  # of a cell: gridpoints closer than that are one; chosen
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


def graded_grid(measure: Measure, gridpoints: int | ArrayLike | None) -> Array:
    """As ``initial_grid``, with gridpoints where the motion varies: by arc length, turning, and
    change of the twist."""
    path = measure.path
    if not (gridpoints is None or isinstance(gridpoints, (int, np.integer))):
        return initial_grid(path, gridpoints)
    if gridpoints is not None and gridpoints < 2:
        raise ArgumentError("gridpoints", gridpoints, "2 or more gridpoints")
    from trajopt.timing import spread

    free = path.heading is not None
    left, sigma, weight, segment = spread.base_cells(*measure.cubics, measure.size, free)
    if len(left) >= spread.MOST_CELLS:
        raise InfeasibleError(
            "path",
            float(path.parameter(left[-1:])[0]),
            "the path has turned tens of thousands of times by here; move its points or headings",
        )
    share = sigma / sigma.sum() + weight
    wanted = min(_CELLS * max(1.0, share.sum() / 4), _MOST_CELLS)
    cells = wanted if gridpoints is None else gridpoints - 1.0
    least = 2 if gridpoints is None else 1
    knots = measure.cubics[0]
    u = spread.spread(knots, left, share, segment, float(cells), least)
    return np.asarray(u[np.concatenate([[True], np.diff(u) > 0])])


def placed(u: Array, wanted: Array, knots: Array) -> tuple[Array, Array]:
    """Grid u with gridpoints at spline parameters ``wanted``, and where these are now: on a knot
    next to them, or exactly there, in place of a gridpoint that is much closer than a cell."""
    found = np.array(wanted, dtype=np.float64)
    for n, place in enumerate(found):
        i = int(np.clip(np.searchsorted(u, place), 1, len(u) - 1))
        near = i if u[i] - place < place - u[i - 1] else i - 1
        if abs(u[near] - place) > _CLOSE * (u[i] - u[i - 1]):
            u = np.insert(u, i, place)
        elif u[near] in knots:
            found[n] = u[near]
        else:
            u[near] = place
    return u, found


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
