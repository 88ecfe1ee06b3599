"""Cells in which s'' is constant, so that s'^2 is linear in s: what engines of first order drive in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from trajopt.arrays import Array
from trajopt.limits.limit import Limit, is_linear
from trajopt.timing.cells import Cells, Measure, Readable, cells_of
from trajopt.timing.curved import Curved, source_of
from trajopt.timing.profile import between
from trajopt.timing.stages import Stages
from trajopt.timing.track import Track


def steps(track: Track, u: Array, limits: Sequence[Limit], sd2: Array | None = None) -> Cells:
    """Rows per unit of s on the grid u (N+1,), each of whose gridpoints is two places; of limits that
    are not linear those at the profile ``sd2`` (N+1,), or else those of rest."""
    measure = Measure.of(track)
    if measure.bends:
        measure = replace(measure, length=0.0)
    linear = all(map(is_linear, limits))
    source = Readable(tuple(limits)) if linear else source_of(track, measure, limits)
    cells = cells_of(track, measure, u, source, u)
    if sd2 is None or not isinstance(source, Curved):
        return cells
    y = between(cells, sd2, *pulls(cells, sd2))
    return replace(cells, table=source.tangent(track, measure, cells.spots, cells.table, y))


def pulls(cells: Cells, sd2: Array) -> tuple[Array, Array]:
    """(N,) twice: s'' at both ends of cells with s'^2 (N+1,)."""
    sdd = np.diff(sd2) / (2 * cells.d)
    return sdd, sdd


def stages_of(cells: Cells) -> Stages:
    """The two ends of every cell, as engines want them."""
    ends, table = np.stack([cells.left, cells.right], axis=1).ravel(), cells.table
    s, bounds = np.repeat(cells.path.parameter(cells.u), 2)[1:-1], table.bounds[:, ends]
    a, b, c = (np.ascontiguousarray(m[ends]) for m in (table.a, table.b, table.c))
    return Stages(s, a, b, c, bounds.min(axis=0), table.names, table.owner, bounds, table.edges)


def used(cells: Cells, sd2: Array) -> Array:
    """(N,): what s'^2 of each cell would have to be divided by to touch the limits that rest keeps."""
    sdd, table = pulls(cells, sd2)[0], cells.table
    y = between(cells, sd2, sdd, sdd)
    rows = table.a * np.repeat(sdd, 5)[:, None] + table.b * y[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = np.nan_to_num(y / cells.cap, nan=0.0, posinf=np.inf)
        needed = np.where(table.c > 0, rows / table.c, 1.0).max(axis=1, initial=0.0)
    return np.asarray(np.maximum(speed, needed).reshape(-1, 5).max(axis=1))
