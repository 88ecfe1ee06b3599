"""Rows of all limits on a grid, and how far a profile stays inside them.

A profile is s'^2 at the gridpoints; between them s'' is constant, so s'^2 is linear in s. An
interval obeys the rows at both of its ends with its own s'' (the interpolation scheme of TOPP-RA);
whether it obeys them in between is checked on a grid ten times finer. Rows of linear limits depend on
the path alone: each interval's are computed once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.errors import ArgumentError
from trajopt.limits.limit import Limit
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot
from trajopt.timing.track import Track

SD2_CAP = 1e8  # m^2/s^2; stands for "no bound": 10 km/s, far beyond any ground robot
FINER = 10  # intervals of the fine grid in one of the solver's; chosen
_CHUNK = 1000  # intervals worked on at once, to bound memory


@dataclass(frozen=True, eq=False)
class Stages:
    """Rows a s'' + b s'^2 <= c at G places, divided by their scale, and bounds on s'^2.

    A place between two intervals is there twice, once for each of them (limits from the left and
    from the right differ at knots), as an interval of length zero.
    """

    s: Array  # (G,) path parameter, m, not decreasing
    a: Array  # (G, R)
    b: Array  # (G, R)
    c: Array  # (G, R)
    sd2_max: Array  # (G,) m^2/s^2, inf where nothing bounds the speed alone
    names: tuple[str, ...]  # limits
    row_owner: IndexArray  # (R,) which limit a row belongs to
    bounds: Array  # (L, G) m^2/s^2, what each limit says of the speed alone
    edges: tuple[float, ...]  # path parameters that should be gridpoints

    @property
    def kept(self) -> IndexArray:
        """Indices of the gridpoints, each once."""
        return np.flatnonzero(np.concatenate([[True], np.diff(self.s) > 0]))


@dataclass(frozen=True, eq=False)
class FineRows:
    """Rows on the fine grid of N intervals, F = FINER + 1 places each, ends included."""

    u: Array  # (N+1,) spline parameter at the gridpoints
    s: Array  # (N+1,) path parameter at the gridpoints, m
    share: Array  # (N, F) how far along its interval a place lies, 0 to 1 in s
    a: Array  # (N, F, R)
    b: Array  # (N, F, R)
    c: Array  # (N, F, R)
    bounds: Array  # (N, F, L)
    names: tuple[str, ...]
    row_owner: IndexArray  # (R,)
    edges: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Check:
    """How far a profile keeps the limits on the fine grid.

    ``slack`` (N, L): least relative margin of each limit in each interval. ``factor`` (N,): the
    s'^2 of the profile divided by it would keep all limits that rest keeps.
    """

    slack: Array
    factor: Array


def assemble(samples: PathSamples, limits: Sequence[Limit], robot: Robot | None) -> Stages:
    """Rows of all limits at the samples. Raises ArgumentError where a limit's rows are not
    finite."""
    rows = [limit.rows(samples, robot) for limit in limits]
    counts = [r.a.shape[1] for r in rows]
    shape = (len(samples.s), sum(counts))
    a, b, c = np.empty(shape), np.empty(shape), np.empty(shape)
    bounds = np.empty((len(rows), len(samples.s)))
    column = 0
    for k, r in enumerate(rows):
        here = slice(column, column + counts[k])
        np.divide(r.a, r.scale, out=a[:, here])
        np.divide(r.b, r.scale, out=b[:, here])
        np.divide(r.c, r.scale, out=c[:, here])
        bounds[k] = r.sd2_max
        column += counts[k]
    owner = np.repeat(np.arange(len(rows)), counts)
    bad = ~(np.isfinite(a) & np.isfinite(b) & np.isfinite(c))
    if bad.any() or np.isnan(bounds).any():
        in_bounds = int(np.argmax(np.isnan(bounds).any(axis=1)))
        which = int(owner[np.argmax(bad.any(axis=0))]) if bad.any() else in_bounds
        raise ArgumentError(
            f"limits[{which}] '{rows[which].name}'", "not finite", "finite rows on the path"
        )
    edges = tuple(sorted({edge for r in rows for edge in r.edges}))
    names = tuple(r.name for r in rows)
    return Stages(samples.s, a, b, c, np.min(bounds, axis=0), names, owner, bounds, edges)


def fine_rows(
    track: Track, u: Array, limits: Sequence[Limit], sd2: Array | None = None
) -> FineRows:
    """Rows of all limits inside every interval of the grid u (N+1,), at the profile ``sd2`` (N+1,)
    where they are not linear."""
    (share, a, b, c, bounds), some = _rows_inside(track, u[:-1], u[1:], limits, sd2)
    return FineRows(
        u, track.path.parameter(u), share, a, b, c, bounds, some.names, some.row_owner, some.edges
    )


def _rows_inside(
    track: Track,
    left: Array,
    right: Array,
    limits: Sequence[Limit],
    sd2: Array | None = None,
) -> tuple[tuple[Array, ...], Stages]:
    """share, a, b, c, bounds of FineRows for intervals from left (N,) to right (N,) with s'^2 at
    their ends (N+1,); and the last of the pieces that they were assembled in, which has names,
    owners, and the edges of all."""
    found: tuple[Array, ...] = ()
    edges: set[float] = set()
    for first in range(0, len(left), _CHUNK):
        part = slice(first, min(first + _CHUNK, len(left)))
        fine = _fine_grid(left[part], right[part])
        s = track.path.parameter(fine.ravel())
        samples, s = track.samples(s, fine.ravel()), s.reshape(fine.shape)
        share = (s - s[:, :1]) / (s[:, -1:] - s[:, :1])
        if sd2 is not None:
            between = sd2[:-1][part, None] * (1 - share) + sd2[1:][part, None] * share
            samples = replace(samples, sd2=between.ravel())
        rows = assemble(samples, limits, track.robot)
        edges.update(rows.edges)
        pieces = (
            share,
            *(
                values.reshape(*fine.shape, -1)
                for values in (rows.a, rows.b, rows.c, rows.bounds.T)
            ),
        )
        if not found:
            found = tuple(np.empty((len(left), *piece.shape[1:])) for piece in pieces)
        for target, piece in zip(found, pieces, strict=True):
            target[part] = piece
    return found, replace(rows, edges=tuple(sorted(edges)))


def refined(track: Track, fine: FineRows, u: Array, limits: Sequence[Limit]) -> FineRows:
    """Rows on the grid u (M+1,), which contains that of ``fine``: what is known is taken over."""
    at = np.searchsorted(u, fine.u)
    whole = np.flatnonzero(np.diff(at) == 1)  # intervals of the old grid that stay
    fresh = np.ones(len(u) - 1, dtype=bool)
    fresh[at[whole]] = False
    if not fresh.any():
        return fine
    new, _ = _rows_inside(track, u[:-1][fresh], u[1:][fresh], limits)

    def merged(known: Array, added: Array) -> Array:
        values = np.empty((len(u) - 1, *known.shape[1:]))
        values[at[whole]] = known[whole]
        values[fresh] = added
        return values

    return FineRows(
        u,
        track.path.parameter(u),
        merged(fine.share, new[0]),
        merged(fine.a, new[1]),
        merged(fine.b, new[2]),
        merged(fine.c, new[3]),
        merged(fine.bounds, new[4]),
        fine.names,
        fine.row_owner,
        fine.edges,
    )


def stages_of(fine: FineRows) -> Stages:
    """The two ends of every interval, as the engines want them."""
    places = 2 * len(fine.share)

    def ends(values: Array) -> Array:
        return values[:, [0, -1]].reshape(places, -1)

    bounds = ends(fine.bounds)
    s = np.repeat(fine.s, 2)[1:-1]
    return Stages(
        s,
        ends(fine.a),
        ends(fine.b),
        ends(fine.c),
        np.min(bounds, axis=1),
        fine.names,
        fine.row_owner,
        bounds.T,
        fine.edges,
    )


def check(fine: FineRows, sd2: Array) -> Check:
    """Margins of the profile s'^2 (N+1,) on the fine grid."""
    count = len(fine.share)
    sdd = np.diff(sd2) / (2 * np.diff(fine.s))
    slack, factor = np.ones((count, len(fine.names))), np.empty(count)
    for first in range(0, count, _CHUNK):
        part = slice(first, min(first + _CHUNK, count))
        share = fine.share[part]
        x = sd2[:-1][part, None] * (1 - share) + sd2[1:][part, None] * share
        used = fine.a[part] * sdd[part, None, None] + fine.b[part] * x[:, :, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            speed = np.max(x[:, :, None] / fine.bounds[part], axis=1)
            needed = np.where(fine.c[part] > 0, used / fine.c[part], 1.0)
        speed = np.where(np.isnan(speed), 0.0, speed)  # 0/0: at rest under a bound of zero
        factor[part] = np.maximum(speed.max(axis=1), needed.max(axis=(1, 2), initial=0.0))
        margin = (fine.c[part] - used).min(axis=1)
        slack[part] = 1 - np.sqrt(speed)
        for k in range(len(fine.names)):
            mine = fine.row_owner == k
            if mine.any():
                slack[part, k] = np.minimum(slack[part, k], margin[:, mine].min(axis=1))
    return Check(slack, factor)


def _fine_grid(left: Array, right: Array) -> Array:
    """(N, F): spline parameters inside every interval. Its right end is the limit from the left."""
    fine = left[:, None] + (right - left)[:, None] * (np.arange(FINER + 1) / FINER)
    fine[:, 0] = left
    fine[:, -1] = np.nextafter(right, -np.inf)
    return np.asarray(fine)
