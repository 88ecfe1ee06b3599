"""A factor of its own for every spline segment, to follow a given profile ([waheed2006], eqs. 2.40
and 2.41).

The thesis scales the time of each segment so that the motion touches the limits (or the given speed
profile) once a segment. The speed then jumps at the knots, which no robot can do.
``segment_factors`` gives the thesis's factors; as an engine, the scaled speeds are taken as a
ceiling, and the fastest profile below it that keeps all limits is driven.
"""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array
from trajopt.timing.cells import Cells
from trajopt.timing.steps import used


def segment_factors(cells: Cells) -> Array:
    """(K-1,): factor on the time of each segment, whose nominal time is its span of spline
    parameter (s).

    0 where nothing bounds the motion of a segment. The thesis's duration is factors @ diff(knots).
    """
    worst = used(cells, cells.path.rate(cells.u) ** 2)
    first = np.searchsorted(cells.u, np.asarray(cells.path.basis.knots[:-1]))
    return np.asarray(np.sqrt(np.maximum.reduceat(worst, first)))


def segment_ceiling(cells: Cells) -> Array:
    """(2 N,) s'^2 at both ends of every interval when every segment runs with its own factor."""
    u, path, factors = cells.u, cells.path, segment_factors(cells)
    middle = (u[:-1] + u[1:]) / 2
    mine = factors[np.searchsorted(np.asarray(path.basis.knots), middle) - 1]
    with np.errstate(divide="ignore"):
        rate2 = np.repeat(path.rate(u) ** 2, 2)[1:-1]
        return np.asarray(rate2 / np.repeat(mine, 2) ** 2)
