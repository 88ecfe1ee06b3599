"""Rows of all limits at the ends and in the middle of every cell of a grid, per unit of sigma.

Limits give rows per unit of the path parameter s. With g = dsigma/ds, a s'' + b s'^2 <= c becomes

    (a / g) sigma'' + (b - a g_s / g) / g^2 sigma'^2 <= c

whose coefficients stay bounded where the path turns in no length (``timing/spread.py``).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from trajopt.arrays import Array, BoolArray, IndexArray
from trajopt.errors import InfeasibleError
from trajopt.limits.limit import Limit
from trajopt.paths.path import Path
from trajopt.timing.stages import SD2_CAP, assemble
from trajopt.timing.track import Track

SHARPEST = 1e9  # dsigma/ds up to which rows per unit of s keep seven digits per unit of sigma


@dataclass(frozen=True)
class Measure:
    """What cells of a path are measured in: see ``timing/spread.py``. ``length`` (m) is L; 0 where
    sigma is s. ``size`` (m) is L for grading the grid."""

    path: Path
    length: float
    size: float

    @classmethod
    def of(cls, track: Track) -> Measure:
        path = track.path
        if path.heading is not None:
            return cls(path, path.turning_length, path.turning_length)
        own = path.length / 10 if track.robot is None else track.robot.turning_length
        own = min(own, path.length)
        spatial = not path.plain or path.coordinates.shape[1] == 3
        return cls(path, 0.0 if spatial else own, own)

    @property
    def bends(self) -> bool:
        """Whether sigma is another measure than s."""
        return self.path.heading is None and self.length > 0

    @cached_property
    def cubics(self) -> tuple[Array, Array]:
        knots, cubics = self.path._cubics
        return knots, np.ascontiguousarray(cubics)

    def sigma(self, u: Array) -> Array:
        """(N,): sigma gained in every cell of the grid u (N+1,)."""
        if not self.path.plain:
            return np.diff(self.path.parameter(u))
        from trajopt.timing import spread

        free = self.path.heading is not None
        if self.length == 0:  # in space
            return np.diff(self.path.parameter(u))
        return spread.measured(*self.cubics, self.length, free, u)

    def paces(self, u: Array) -> Array:
        """(N,): dsigma/du."""
        if not self.bends or not self.path.plain:
            return self.path.rate(u)
        from trajopt.timing import spread

        return spread.paces(*self.cubics, self.length, False, u)

    def stretch(self, u: Array) -> tuple[Array, Array]:
        """(N,) each: g = dsigma/ds and its derivative along s."""
        if not self.bends:
            return np.ones(len(u)), np.zeros(len(u))
        from trajopt.timing import spread

        return spread.stretch(*self.cubics, self.length, u)


@dataclass(frozen=True, eq=False)
class Spots:
    """P places u (ascending) of cells: where each begins and ends, ``left`` and ``right`` (N,), and
    at quarters of its sigma ``d`` (N,), at left + 1, 2, 3."""

    u: Array
    left: IndexArray
    right: IndexArray
    d: Array


@dataclass(frozen=True, eq=False)
class Table:
    """Rows a sigma'' + b sigma'^2 <= c (P, R) at places, divided by their scale, and bounds (L, P)
    on sigma'^2."""

    a: Array
    b: Array
    c: Array
    bounds: Array
    names: tuple[str, ...]
    owner: IndexArray  # (R,)
    edges: tuple[float, ...]  # m


@dataclass(frozen=True, eq=False)
class Cells:
    """Rows at P places of a grid of N cells: at a quarter, half and three quarters of the sigma of
    each, and at gridpoints, which are two places where rows may jump."""

    u: Array  # (N+1,) spline parameter at the gridpoints
    spots: Spots
    table: Table
    path: Path

    @property
    def d(self) -> Array:
        """(N,): sigma of the cells."""
        return self.spots.d

    @property
    def places(self) -> Array:
        """(P,): spline parameters."""
        return self.spots.u

    @property
    def left(self) -> IndexArray:
        """(N,): the place where a cell begins; its quarters come next."""
        return self.spots.left

    @property
    def right(self) -> IndexArray:
        """(N,): the place where it ends."""
        return self.spots.right

    def s(self, j: int) -> float:
        """Path parameter of a place, m."""
        return float(self.path.parameter(self.places[[j]])[0])

    @property
    def middle(self) -> IndexArray:
        """(N,): the places in the middles of cells."""
        return self.left + 2

    @cached_property
    def solved(self) -> IndexArray:
        """Places at the ends and in the middles of cells, ascending."""
        kept = np.ones(len(self.places), dtype=np.bool_)
        kept[self.left + 1] = kept[self.left + 3] = False
        return np.flatnonzero(kept)

    @cached_property
    def spare(self) -> Array:
        """(P, R): room for tightened bounds of rows."""
        return np.empty_like(self.table.c)

    @cached_property
    def cap(self) -> Array:
        """(P,): the least bound on sigma'^2."""
        return np.asarray(np.minimum(self.table.bounds.min(axis=0), SD2_CAP))


_QUARTERS = np.array([0.25, 0.5, 0.75])


def spots_of(measure: Measure, u: Array, breaks: BoolArray) -> Spots:
    """Places of the grid u (N+1,). ``breaks`` (N+1,) marks gridpoints that are two places."""
    d = measure.sigma(u)
    left = 4 * np.arange(len(d)) + np.concatenate([[0], np.cumsum(breaks[1:-1])])
    right = left + 4
    places = np.empty(int(right[-1]) + 1)
    places[right] = np.nextafter(u[1:], -np.inf)
    places[left] = u[:-1]
    with np.errstate(divide="ignore"):
        slope = 1 / measure.paces(u)
    width, t = np.diff(u), _QUARTERS
    first, last = (d * slope[:-1])[:, None], (d * slope[1:])[:, None]
    # The inverse of sigma(u) by cubic Hermite interpolation; evenly in u where that leaves the cell.
    bend = t * (1 - t) * ((1 - t) * (first - width[:, None]) - t * (last - width[:, None]))
    steep = np.maximum(first, last)[:, 0] > 2.5 * width
    inside = width[:, None] * t + np.where(steep[:, None], 0.0, bend)
    places[left[:, None] + [1, 2, 3]] = u[:-1, None] + inside
    return Spots(places, left, right, d)


class Source(Protocol):
    """What gives rows at the places of cells. Raises InfeasibleError."""

    def edges(self, track: Track, u: Array) -> tuple[float, ...]: ...

    def table(self, track: Track, measure: Measure, spots: Spots) -> Table: ...


@dataclass(frozen=True)
class Readable:
    """Rows of any limits, from NumPy."""

    limits: tuple[Limit, ...]

    def edges(self, track: Track, u: Array) -> tuple[float, ...]:
        """Path parameters where the limits jump or bend, m, seen from the grid u (N+1,) and four
        times as many places."""
        parts = u[:-1, None] + np.diff(u)[:, None] * [0.0, 0.25, 0.5, 0.75]
        places = np.append(parts.ravel(), np.nextafter(u[-1], -np.inf))
        s = track.path.parameter(places)
        return assemble(track.samples(s, places), self.limits, track.robot).edges

    def table(self, track: Track, measure: Measure, spots: Spots) -> Table:
        """Raises InfeasibleError where the path turns too sharply for rows per unit of s."""
        s = track.path.parameter(spots.u)
        rows = assemble(track.samples(s, spots.u), self.limits, track.robot)
        a, b, bounds = per_sigma(measure, spots.u, s, rows.a, rows.b, rows.bounds)
        return Table(a, b, rows.c, bounds, rows.names, rows.row_owner, rows.edges)


def per_sigma(
    measure: Measure, u: Array, s: Array, a: Array, b: Array, bounds: Array
) -> tuple[Array, Array, Array]:
    """a, b (P, R) and bounds (L, P) per unit of sigma from those per unit of s. Raises
    InfeasibleError where the path turns too sharply for that."""
    if not measure.bends:
        return a, b, bounds
    g, slope = measure.stretch(u)
    if g.max() > SHARPEST:
        raise InfeasibleError(
            "path",
            float(s[int(np.argmax(g))]),
            "the path turns round in no length here; give the turn a radius, or split the path",
        )
    b = (b - a * (slope / g)[:, None]) / (g * g)[:, None]
    return a / g[:, None], b, bounds * (g * g)


def cells_of(track: Track, measure: Measure, u: Array, source: Source, jumps: Array) -> Cells:
    """Rows on the grid u (N+1,); ``jumps`` are spline parameters where rows may jump. Raises as the
    source."""
    spots = spots_of(measure, u, np.isin(u, jumps))
    return Cells(u, spots, source.table(track, measure, spots), track.path)
