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
from dataclasses import dataclass, field, replace

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.limits.limit import Limit, is_linear
from trajopt.limits.power import Power
from trajopt.limits.torques import SLOWEST
from trajopt.paths.samples import PathSamples
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
    _last: dict[Spots, PathSamples] = field(default_factory=dict)

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

    def roots(
        self, track: Track, measure: Measure, spots: Spots, between: tuple[Array, Array]
    ) -> tuple[Array, Array, Array]:
        """a, b, c (P, Q) of rows (y^(3/2))' <= 2 (c - b y^(3/2)) / a where a > 0, >= where a < 0, for y
        from low (P,) to high (P,): a power a u + b y + c <= P / sqrt(y), times 3 sqrt(y) / a."""
        samples = self._samples(track, spots)
        g, slope = measure.stretch(spots.u)
        found = []
        for limit in (self.limits[int(k)] for k in self.bent):
            if not isinstance(limit, Power):
                continue
            a, b, c = (v[:, 0] for v in vars(limit.work(samples, track.robot)).values())
            least = limit.largest * g - np.minimum(c * np.sqrt(between[0]), c * np.sqrt(between[1]))
            rows = a / g, 1.5 * (b - a * slope / g) / (g * g), 1.5 * least
            found.append(np.stack(rows) / (limit.largest * g))
        a, b, c = np.stack(found, axis=-1) if found else np.zeros((3, len(g), 0))
        return a, b, c

    def _rows(
        self, track: Track, measure: Measure, spots: Spots, y: Array | None
    ) -> tuple[Array, Array, Array, Array, Array, IndexArray]:
        """a, b, c, scale (P, R) of the bent limits at y, bounds (B, P) and owner (R,)."""
        samples = self._samples(track, spots)
        if y is not None:
            g, _ = measure.stretch(spots.u)
            samples = replace(samples, sd2=y / (g * g))
        rows = [self.limits[int(k)].rows(samples, track.robot) for k in self.bent]
        a, b, c, scale = (
            np.hstack([getattr(r, k) for r in rows]) for k in ("a", "b", "c", "scale")
        )
        owner = np.repeat(np.arange(len(rows)), [r.a.shape[1] for r in rows])
        bounds = np.stack([r.sd2_max for r in rows])
        a, b, bounds = per_sigma(measure, spots.u, samples.s, a, b, bounds)
        return a, b, c, scale, bounds, owner

    def _samples(self, track: Track, spots: Spots) -> PathSamples:
        """At the places asked for last, which are asked for many times."""
        if spots not in self._last:
            self._last.clear()
            found = track.samples(track.path.parameter(spots.u), spots.u)
            wheels = found.wheels
            self._last[spots] = replace(
                found, wheel_states=None if wheels is None else lambda: wheels
            )
        return self._last[spots]


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
