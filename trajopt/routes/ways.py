"""Different ways around what stands there: shortest paths on a grid, one a homotopy class.

Every cell is joined with its eight neighbours where a disc fits; leaving room costs less than
grazing. Trees of shortest ways from the start and from the goal meet in every cell: through which
gaps a way through a cell goes, there and on, tells its class (so a way is found where it is the
shortest to some cell and on from it). Two ways are of one class where they pass every
island of blocked cells on the same side, which signed crossings of a ray from each island tell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, BoolArray, IndexArray, IntArray
from trajopt.routes.field import Field

MOST_CELLS = 60_000  # of the grid that is searched; chosen: 0.1 s a tree
_GRAZING = 1.5  # times the length, where a disc just fits; chosen
_LONGEST = 1.8  # times the best way's cost: longer ones are left out; chosen
_STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))  # to half of the neighbours


@dataclass(frozen=True, eq=False)
class Way:
    """``points`` (N, 2), m, from start to goal, of a disc's centre; ``length``, m."""

    points: Array
    length: float


def ways(
    field: Field, start: Array, goal: Array, radius: float, wide: float, most: int
) -> list[Way]:
    """Up to ``most`` ways of different classes for a disc of ``radius`` (m), cheapest first; room
    up to ``wide`` (m) makes a way cheaper. Empty where there is none."""
    from scipy.sparse.csgraph import dijkstra

    grid = field.coarse(MOST_CELLS)
    free = grid.distance >= radius
    ends = [_nearest(grid, free, place) for place in (start, goal)]
    if min(ends) < 0:
        return []
    graph = _graph(grid, free, radius, wide)
    cost, before = dijkstra(graph, indices=ends, return_predecessors=True)
    through = cost.sum(axis=0)
    best = float(through[ends[0]])
    if not np.isfinite(best):
        return []
    rays = _rays(free)
    gone = _passed(before[0], rays) - _passed(before[1], rays)
    order = np.argsort(through, kind="stable")
    order = order[: np.searchsorted(through[order], _LONGEST * best)]
    _, first = np.unique(gone[order], return_index=True)
    found: list[Way] = []
    for via in order[np.sort(first)]:
        cells = np.concatenate([_back(before[0], via)[::-1], _back(before[1], via)[1:]])
        if len(np.unique(cells)) < len(cells):  # it comes back the way it went
            continue
        row, column = np.divmod(cells, free.shape[1])
        points = grid.world(np.column_stack([column, row]).astype(np.float64))
        points = np.vstack([start, points[1:-1], goal])
        found.append(Way(points, float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())))
        if len(found) == most:
            break
    return found


def _nearest(grid: Field, free: BoolArray, place: Array) -> int:
    """Number of the free cell nearest to a place, among its neighbours; -1 where there is none."""
    column, row = np.rint(grid.grid(place[None])[0]).astype(int)
    reach = range(-2, 3)
    near = [(i * i + j * j, row + i, column + j) for i in reach for j in reach]
    for _, i, j in sorted(near):
        if 0 <= i < free.shape[0] and 0 <= j < free.shape[1] and free[i, j]:
            return int(i * free.shape[1] + j)
    return -1


def _graph(grid: Field, free: BoolArray, radius: float, wide: float) -> object:
    """Costs of steps between free neighbours."""
    from scipy.sparse import csr_array

    numbers = np.arange(free.size).reshape(free.shape)
    room = np.clip((grid.distance - radius) / max(wide - radius, grid.spacing), 0.0, 1.0)
    dear = 1.0 + _GRAZING * (1.0 - room) ** 2
    rows, columns, costs = list[IntArray](), list[IntArray](), list[Array]()
    for i, j in _STEPS:
        here = (slice(0, free.shape[0] - i), slice(max(-j, 0), free.shape[1] - max(j, 0)))
        there = (slice(i, None), slice(max(j, 0), free.shape[1] + min(j, 0)))
        both = free[here] & free[there]
        rows.append(numbers[here][both])
        columns.append(numbers[there][both])
        costs.append((dear[here][both] + dear[there][both]) / 2 * grid.spacing * np.hypot(i, j))
    a, b, c = np.concatenate(rows), np.concatenate(columns), np.concatenate(costs)
    pair = (np.concatenate([a, b]), np.concatenate([b, a]))
    return csr_array((np.concatenate([c, c]), pair), shape=(free.size, free.size))


def _back(before: IndexArray, at: int) -> IndexArray:
    """Cells from one back to the root of its tree."""
    cells = [at]
    while before[cells[-1]] >= 0:
        cells.append(int(before[cells[-1]]))
    return np.array(cells)


def _rays(free: BoolArray) -> IntArray:
    """(R + 1, C): for steps from column c to c + 1 below row r, the sum of the numbers of islands
    whose rays, up from a cell of theirs half a column off, they cross. Islands are blocked cells
    that ways can go around: those that touch the border are one with what lies beyond."""
    from scipy.ndimage import label

    names, count = label(np.pad(~free, 1, constant_values=True), np.ones((3, 3)))
    beyond, names = names[0, 0], names[1:-1, 1:-1]
    first = np.full(count + 1, -1)
    order = np.arange(names.size)[::-1]
    first[names.ravel()[order]] = order
    mine = np.array([first[k] for k in range(1, count + 1) if k != beyond], dtype=np.intp)
    row, column = np.divmod(mine, free.shape[1])
    crossed = np.zeros((free.shape[0] + 1, free.shape[1]), dtype=np.int64)
    # Numbers so large that no two sums of a few are alike, but by a chance of 1e-18.
    numbers = np.random.default_rng(0).integers(-(2**62), 2**62, len(mine))
    np.add.at(crossed, (row + 1, column), numbers)
    return np.asarray(np.cumsum(crossed, axis=0))


def _passed(before: IndexArray, rays: IntArray) -> IntArray:
    """For each cell the sum, with signs, of the numbers of islands passed on the way from its tree's
    root."""
    width = rays.shape[1]
    back = np.where(before >= 0, before, np.arange(len(before)))
    (row, column), (from_row, from_column) = (
        np.divmod(c, width) for c in (np.arange(len(back)), back)
    )
    height = np.maximum(row, from_row)
    step = column - from_column
    passed = step * rays[height, np.minimum(column, from_column)]
    for _ in range(int(np.ceil(np.log2(len(back)))) + 1):  # each time twice as far back
        passed = passed + passed[back]
        further = back[back]
        if np.array_equal(further, back):
            break
        back = further
    return np.asarray(passed)
