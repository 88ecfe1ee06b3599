"""Rows of limits that are not linear in (s'', s'^2): tangents to drive by, chords for the bound.

Such a limit bounds a u by a function f(y) that bends up (``Limit.linear``). Its tangent at a
profile is exact there and stricter elsewhere, so a profile found with tangents keeps the limit, and
the next, with tangents at it, is as fast or faster everywhere: they rise to the profile whose rows
are taken at itself, by Newton's steps. The fastest motion of all lies, place by place, between
one that keeps the limits and an upper bound; there f lies below its chord, and with chords instead
of f the bound of ``relaxed`` holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.limits.limit import Limit, is_linear
from trajopt.limits.torques import SLOWEST
from trajopt.timing.cells import Measure, Readable, Source, Spots, Table, per_sigma
from trajopt.timing.planar import planar_of
from trajopt.timing.track import Track

_SAME = 1e-9  # relative difference of y below which a chord is a tangent


@dataclass(frozen=True, eq=False)
class Curved:
    """Rows of limits (L,) of which ``bent`` are not linear; the others' come from ``steady``."""

    limits: tuple[Limit, ...]
    steady: Source | None
    straight: IndexArray
    bent: IndexArray

    def edges(self, track: Track, u: Array) -> tuple[float, ...]:
        """Path parameters where the linear limits jump or bend, m."""
        return () if self.steady is None else self.steady.edges(track, u)

    def table(self, track: Track, measure: Measure, spots: Spots) -> Table:
        """Rows that hold at rest: of bent limits the loosest, where they bound anything there."""
        a, b, c, scale, bounds, owner = self._rows(track, measure, spots, None)
        whole = np.empty((len(self.limits), len(spots.u)))
        whole[self.bent] = bounds
        names = tuple(limit.name for limit in self.limits)
        rows, mine = (a / scale, b / scale, c / scale), self.bent[owner]
        if self.steady is None:
            return Table(*rows, whole, names, mine, ())
        steady = self.steady.table(track, measure, spots)
        whole[self.straight] = steady.bounds
        owners = np.concatenate([self.straight[steady.owner], mine])
        known = Table(steady.a, steady.b, steady.c, whole, names, owners, ())
        return _beside(known, steady.a.shape[1], *rows)

    def tangent(
        self, track: Track, measure: Measure, spots: Spots, table: Table, y: Array
    ) -> Table:
        """``table`` with bent rows that are exact at y (P,)."""
        a, b, c, scale, _, _ = self._rows(track, measure, spots, y)
        return _with(table, a / scale, b / scale, c / scale)

    def chord(
        self,
        track: Track,
        measure: Measure,
        spots: Spots,
        table: Table,
        between: tuple[Array, Array],
    ) -> Table:
        """``table`` with bent rows that are nowhere stricter than the limit for y from low (P,) to
        high (P,)."""
        low, high = between
        a, b, c, scale, _, _ = self._rows(track, measure, spots, low)
        rest = self._rows(track, measure, spots, None)
        _, b1, c1, _, _, _ = self._rows(track, measure, spots, high)
        lowest, highest = low[:, None], high[:, None]
        first, last = c - b * lowest, c1 - b1 * highest
        apart = highest - lowest > _SAME * highest
        slope = np.where(apart, (last - first) / np.where(apart, highest - lowest, 1.0), -b)
        c, b = first - slope * lowest, -slope
        g, _ = measure.stretch(spots.u)
        slow = (low < (SLOWEST * g) ** 2)[:, None]  # tangents are not taken there
        a, b, c = (np.where(slow, r, m) for r, m in zip(rest[:3], (a, b, c), strict=True))
        scale = np.where(slow, rest[3], scale)
        return _with(table, a / scale, b / scale, c / scale)

    def _rows(
        self, track: Track, measure: Measure, spots: Spots, y: Array | None
    ) -> tuple[Array, Array, Array, Array, Array, IndexArray]:
        """a, b, c, scale (P, R) of the bent limits at y, bounds (B, P) and owner (R,)."""
        s = track.path.parameter(spots.u)
        samples = track.samples(s, spots.u)
        if y is not None:
            g, _ = measure.stretch(spots.u)
            samples = replace(samples, sd2=y / (g * g))
        rows = [self.limits[int(k)].rows(samples, track.robot) for k in self.bent]
        a, b, c, scale = (
            np.hstack([getattr(r, k) for r in rows]) for k in ("a", "b", "c", "scale")
        )
        owner = np.repeat(np.arange(len(rows)), [r.a.shape[1] for r in rows])
        bounds = np.stack([r.sd2_max for r in rows])
        a, b, bounds = per_sigma(measure, spots.u, s, a, b, bounds)
        return a, b, c, scale, bounds, owner


def _with(table: Table, a: Array, b: Array, c: Array) -> Table:
    """``table`` with other last columns."""
    return _beside(table, table.a.shape[1] - a.shape[1], a, b, c)


def _beside(table: Table, first: int, a: Array, b: Array, c: Array) -> Table:
    """``table`` with the columns a, b, c after its ``first`` ones."""
    return Table(
        np.hstack([table.a[:, :first], a]),
        np.hstack([table.b[:, :first], b]),
        np.hstack([table.c[:, :first], c]),
        table.bounds,
        table.names,
        table.owner,
        table.edges,
    )


def source_of(track: Track, measure: Measure, limits: Sequence[Limit]) -> Source:
    """What gives rows: compiled where it can."""
    bent = np.array([not is_linear(limit) for limit in limits])
    if bent.any():
        steady = [limit for limit, other in zip(limits, bent, strict=True) if not other]
        return Curved(
            tuple(limits),
            source_of(track, measure, steady) if steady else None,
            np.flatnonzero(~bent),
            np.flatnonzero(bent),
        )
    return planar_of(track, measure, limits) or Readable(tuple(limits))
