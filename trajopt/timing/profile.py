"""How fast a path is driven: in every cell sigma'' is linear in sigma."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.limits.limit import Limit
from trajopt.timing.cells import Cells, Measure, cells_of
from trajopt.timing.curved import Curved, source_of
from trajopt.timing.track import Track


@dataclass(frozen=True, eq=False)
class Profile:
    """sigma'^2 at the gridpoints and sigma'' at both ends of N cells; sigma is arc length and
    turning together (``timing/spread.py``)."""

    measure: Measure
    u: Array  # (N+1,) spline parameter
    d: Array  # (N,) sigma of the cells
    y: Array  # (N+1,) sigma'^2
    first: Array  # (N,) sigma'' where a cell begins
    last: Array  # (N,) and where it ends

    def slower(self, factor: float) -> Profile:
        """The same motion with all times multiplied by ``factor``."""
        square = factor * factor
        return Profile(
            self.measure,
            self.u,
            self.d,
            self.y / square,
            self.first / square,
            self.last / square,
        )

    @cached_property
    def seconds(self) -> Array:
        """(N,): what each cell takes, s."""
        from trajopt.timing import reach

        return reach.cell_times(self.d, self.y, self.first, self.last)

    def along(self, i: IndexArray, after: Array) -> tuple[Array, Array, Array]:
        """(M,) each: spline parameter, sigma' and sigma'' so long (s) after cells i were entered."""
        from trajopt.timing import reach

        moments = reach.moments(self.d, self.y, self.first, self.last, i, after)
        return self.place(i, moments[0]), moments[1], moments[2]

    def place(self, i: IndexArray, gained: Array) -> Array:
        """(M,): spline parameters where sigma has grown by ``gained`` in cells i."""
        path, measure = self.measure.path, self.measure
        if measure.bends:
            from trajopt.timing import spread

            return spread.inside(
                *measure.cubics, measure.length, False, self.u[i], self.u[i + 1], self.d[i], gained
            )
        found = path.locate(self._s[i] + gained)
        return np.clip(found, self.u[i], self.u[i + 1])

    @cached_property
    def _s(self) -> Array:
        return self.measure.path.parameter(self.u)


def margins_of(track: Track, profile: Profile, limits: Sequence[Limit]) -> Array:
    """(N, L): least relative margin of every limit in every cell, at its ends (from inside) and
    quarters and where a parabola through these is highest."""
    source = source_of(track, profile.measure, limits)
    cells = cells_of(track, profile.measure, profile.u, source, profile.u)
    motion = profile.y, profile.first, profile.last
    if isinstance(source, Curved):
        where = track, profile.measure, cells.spots, cells.table
        cells = replace(cells, table=source.tangent(*where, between(cells, *motion)))
    return margins(cells, *motion)


def margins(cells: Cells, y: Array, u0: Array, u1: Array) -> Array:
    """(N, L): as ``margins_of``, by the rows of cells."""
    from trajopt.timing import reach

    table = cells.table
    slack = np.empty((len(cells.d), len(table.names)))
    rows = table.a, table.b, table.c, table.bounds, table.owner
    reach.margins(cells.d, cells.left, cells.right, *rows, y, u0, u1, slack)
    return slack


def excess(cells: Cells, y: Array, u0: Array, u1: Array) -> tuple[Array, Array]:
    """(N,) each: share of a row's scale by which it is broken in every cell, and the factor on y
    that removes that."""
    from trajopt.timing import reach

    over, factor, table = np.empty(len(cells.d)), np.empty(len(cells.d)), cells.table
    rows = table.a, table.b, table.c, table.bounds
    reach.excess(cells.d, cells.left, cells.right, *rows, y, u0, u1, over, factor)
    return over, factor


def between(cells: Cells, y: Array, u0: Array, u1: Array) -> Array:
    """(P,): y at all places of a profile."""
    found = np.empty(len(cells.places))
    for k in range(4):
        u = u0 + k / 4 * (u1 - u0)
        found[cells.left + k] = y[:-1] + k / 4 * cells.d * (u0 + u)
    found[cells.right] = y[1:]
    return np.maximum(found, 0.0)
