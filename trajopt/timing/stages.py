"""Rows of all limits at places of a path, and what of s'^2 they leave where s'' is constant between
gridpoints: an interval obeys the rows at both of its ends with its own s'' (the interpolation scheme
of TOPP-RA)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.errors import ArgumentError
from trajopt.limits.limit import Limit
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot

SD2_CAP = 1e8  # m^2/s^2; stands for "no bound": 10 km/s, far beyond any ground robot


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


def controllable(
    s: Array, a: Array, b: Array, c: Array, sd2_max: Array, last: tuple[float, float]
) -> tuple[Array, int]:
    """(N+1, 2): least and greatest s'^2 at the gridpoints of places s (G,), with rows (G, R), from
    which the end is reached in ``last`` with s'' constant between gridpoints; and the place whose set
    is empty, -1 where none is."""
    from trajopt.timing import reach

    d = np.diff(s)
    left = np.flatnonzero(d > 0)
    top, sets = np.minimum(sd2_max, SD2_CAP), np.empty((len(left) + 1, 2))
    sets[-1] = last
    rests, constant = np.all(c >= 0, axis=1), np.ones(len(left), dtype=np.bool_)
    none, node = np.zeros(len(s)), np.full(len(sets), np.inf)
    failed = reach.backward(
        d[left], left, left + 1, a, b, c, top, none, rests, node, constant, sets
    )
    return sets, -1 if failed < 0 else int(left[failed])
