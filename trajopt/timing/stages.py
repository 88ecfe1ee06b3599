"""Rows of all limits on a grid, and how far a profile stays inside them.

A profile is s'^2 at the gridpoints; between them s'' is constant, so s'^2 is linear in s. An interval i obeys
the rows at both of its ends with its own s'' (the interpolation scheme of TOPP-RA).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trajopt.errors import ArgumentError
from trajopt.limits.limit import Limit
from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples, sample_at
from trajopt.robots.platform import Platform
from trajopt.timing.grid import fine_grid, with_left_limits

Array = NDArray[np.float64]
Index = NDArray[np.intp]

SD2_CAP = 1e8  # m^2/s^2; stands for "no bound": 10 km/s, far beyond any ground robot
_CHUNK = 2000  # intervals checked at once, to bound memory


@dataclass(frozen=True)
class Stages:
    """Rows a s'' + b s'^2 <= c at G gridpoints, divided by their scale, and bounds on s'^2.

    A knot is there twice (left and right limit), as an interval of length zero.
    """

    s: Array  # (G,) path parameter, m
    a: Array  # (G, R)
    b: Array  # (G, R)
    c: Array  # (G, R)
    sd2_max: Array  # (G,) m^2/s^2, inf where nothing bounds the speed alone
    names: tuple[str, ...]  # limits
    row_owner: Index  # (R,) which limit a row belongs to
    bounds: Array  # (L, G) m^2/s^2, what each limit says of the speed alone
    edges: tuple[float, ...]  # path parameters that should be gridpoints

    @property
    def kept(self) -> Index:
        """Indices of the gridpoints without the second of each pair: the grid the caller knows."""
        return np.flatnonzero(np.concatenate([[True], np.diff(self.s) > 0]))


@dataclass(frozen=True)
class Check:
    """How far a profile keeps the limits on the fine grid.

    ``slack`` (N, L): least relative margin of each limit in each interval. ``factor`` (N,): the s'^2 of the
    profile divided by it would keep all limits that rest keeps.
    """

    slack: Array
    factor: Array


def assemble(samples: PathSamples, limits: Sequence[Limit], robot: Platform | None) -> Stages:
    """Rows of all limits at the samples. Raises ArgumentError where a limit's rows are not finite."""
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
        raise ArgumentError(f"limits[{which}] '{rows[which].name}'", "not finite", "finite rows on the path")
    edges = tuple(sorted({edge for r in rows for edge in r.edges}))
    names = tuple(r.name for r in rows)
    return Stages(samples.s, a, b, c, np.min(bounds, axis=0), names, owner, bounds, edges)


def stages_on(path: Path, u: Array, limits: Sequence[Limit], robot: Platform | None) -> Stages:
    """Rows on the grid u (N+1,), with left and right limits at knots."""
    doubled = with_left_limits(path, u)
    s = path.parameter(doubled)
    inner = np.searchsorted(doubled, np.asarray(path.basis.knots[1:-1]))
    s[inner - 1] = s[inner]
    return assemble(sample_at(path, s, doubled), limits, robot)


def check(path: Path, u: Array, sd2: Array, sdd: Array, limits: Sequence[Limit],
          robot: Platform | None) -> Check:
    """Margins of the profile sd2 (N+1,), sdd (N,) on a grid ten times finer than u (N+1,)."""
    slack = np.empty((len(sdd), len(limits)))
    factor = np.empty(len(sdd))
    for first in range(0, len(sdd), _CHUNK):
        part = slice(first, min(first + _CHUNK, len(sdd)))
        ends = slice(part.start, part.stop + 1)
        slack[part], factor[part] = _check_part(path, u[ends], sd2[ends], sdd[part], limits, robot)
    return Check(slack, factor)


def _check_part(path: Path, u: Array, sd2: Array, sdd: Array, limits: Sequence[Limit],
                robot: Platform | None) -> tuple[Array, Array]:
    fine = fine_grid(u)
    s = path.parameter(fine.ravel())
    rows = assemble(sample_at(path, s, fine.ravel()), limits, robot)
    grid = s.reshape(fine.shape)
    share = np.clip((grid - grid[:, :1]) / (grid[:, -1:] - grid[:, :1]), 0.0, 1.0)
    x = sd2[:-1, None] * (1 - share) + sd2[1:, None] * share
    used = rows.a * np.repeat(sdd, fine.shape[1])[:, None] + rows.b * x.reshape(-1, 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = np.where(rows.c > 0, used / rows.c, 1.0)
        speed = x.ravel() / rows.bounds  # (L, M), 0 where nothing bounds the speed
    speed = np.where(np.isnan(speed), 0.0, speed)  # 0/0: at rest under a bound of zero
    fastest = np.max(speed, axis=0, initial=0.0)
    factor = np.maximum(fastest, needed.max(axis=1, initial=0.0)).reshape(fine.shape).max(axis=1)
    slack = np.ones((len(sdd), len(limits)))
    margin = (rows.c - used).reshape(*fine.shape, -1).min(axis=1)
    for k in range(len(limits)):
        mine = rows.row_owner == k
        if mine.any():
            slack[:, k] = margin[:, mine].min(axis=1)
        slack[:, k] = np.minimum(slack[:, k], 1 - np.sqrt(speed[k].reshape(fine.shape).max(axis=1)))
    return slack, factor
