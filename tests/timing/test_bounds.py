"""The lower bound on time against motions on many points and a convex program."""

from __future__ import annotations

import numpy as np
import pytest
from wild import wild

from trajopt.arrays import Array
from trajopt.errors import TrajoptError
from trajopt.limits.limit import is_linear
from trajopt.limits.power import Power
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.paths.path import Path
from trajopt.robots.robot import robot
from trajopt.timing.cells import Cells, Measure, cells_of
from trajopt.timing.curved import source_of
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory

LINE = Path.through([[0, 0], [2, 0]])
NEAR = 5e-5
MOST = 2500  # cells of a convex program


def cases(seeds: range, count: int) -> list[tuple[int, Trajectory]]:
    """Motions of the first wild cases that have one."""
    found: list[tuple[int, Trajectory]] = []
    for seed in seeds:
        case = wild(seed)
        if len(case.points) > 60:
            continue
        try:
            motion = time_scale(case.path(), case.limits, robot=case.robot)
        except TrajoptError:
            continue
        found.append((seed, motion))
        if len(found) == count:
            break
    return found


def on_many_points(motion: Trajectory, count: int) -> float:
    fine = time_scale(motion.path, motion.limits, robot=motion.robot, gridpoints=count, gap=1e-4)
    return fine.duration


def finer(motion: Trajectory, parts: int) -> Cells:
    """Rows on the motion's grid with cells cut in ``parts``."""
    u, limits = motion.u, motion.limits
    inside = u[:-1, None] + np.diff(u)[:, None] * np.arange(parts) / parts
    grid = np.append(inside.ravel(), u[-1])
    measure = Measure.of(motion.track)
    source = source_of(motion.track, measure, limits)
    jumps = np.asarray(motion.path.basis.knots)
    return cells_of(motion.track, measure, grid, source, jumps)


def convex_time(cells: Cells) -> float:
    """Least sum of 2 d / (w0 + w1), w^2 <= y, with rows at both ends of every cell in which u is
    linear, from rest to rest: second-order cones, solved by Clarabel."""
    import clarabel
    from scipy import sparse

    n = len(cells.d)
    # Scaled: y in units of the largest bound, sigma of the whole length.
    size, top = cells.d.sum(), float(np.min([cells.cap.max(), 1e4]))
    d, table = cells.d / size, cells.table
    y, u0, w, t = 0, n + 1, 2 * n + 1, 3 * n + 2  # where variables begin
    total = 4 * n + 2
    i, blocks, right = np.arange(n), [], []

    def rows(parts: list[tuple[Array, Array]], limit: Array) -> None:
        columns = np.concatenate([c for c, _ in parts])
        values = np.concatenate([v for _, v in parts])
        matrix = sparse.csc_matrix((values, (np.tile(i, len(parts)), columns)), shape=(n, total))
        blocks.append(matrix)
        right.append(limit)

    scale = top / size  # of u
    for r in range(table.a.shape[1]):
        j, k = cells.left, cells.right
        rows(
            [(u0 + i, table.a[j, r] * scale), (y + i, table.b[j, r] * top)],
            table.c[j, r],
        )
        rows(  # u1 = (y1 - y0) / d - u0
            [
                (u0 + i, -table.a[k, r] * scale),
                (y + i, -table.a[k, r] / d * scale),
                (y + i + 1, table.a[k, r] / d * scale + table.b[k, r] * top),
            ],
            table.c[k, r],
        )
    node = np.append(cells.cap[cells.left], np.inf)
    node[1:] = np.minimum(node[1:], cells.cap[cells.right])
    upper = np.minimum(node / top, 1e4)
    eye = sparse.eye(n + 1, total)
    blocks += [eye, -eye]
    right += [upper, np.zeros(n + 1)]
    inequality = sum(len(v) for v in right)
    ends = sparse.csc_matrix((np.ones(2), ([0, 1], [y, y + n])), shape=(2, total))
    entries, offsets = [], []
    for k in range(n + 1):  # w^2 <= y: (y + 1, y - 1, 2 w)
        entries += [[(y + k, -1.0)], [(y + k, -1.0)], [(w + k, -2.0)]]
        offsets += [1.0, -1.0, 0.0]
    for k in range(n):  # 1 <= t (w0 + w1)
        q = [(w + k, 1.0), (w + k + 1, 1.0)]
        entries += [
            [(t + k, -1.0), *((c, -v) for c, v in q)],
            [(t + k, -1.0), *q],
            [],
        ]
        offsets += [0.0, 0.0, 2.0]
    flat = [(row, c, v) for row, items in enumerate(entries) for c, v in items]
    rows_, columns, values = zip(*flat, strict=True)
    cones_matrix = sparse.csc_matrix((values, (rows_, columns)), shape=(len(entries), total))
    matrix = sparse.vstack([ends, *blocks, cones_matrix]).tocsc()
    cost = np.zeros(total)
    cost[t : t + n] = 2 * d
    cones = [
        clarabel.ZeroConeT(2),
        clarabel.NonnegativeConeT(inequality),
        *[clarabel.SecondOrderConeT(3) for _ in range(2 * n + 1)],
    ]
    options = clarabel.DefaultSettings()
    options.verbose = False
    options.tol_gap_abs = options.tol_gap_rel = options.tol_feas = 1e-6
    solver = clarabel.DefaultSolver(
        sparse.csc_matrix((total, total)),
        cost,
        matrix,
        np.concatenate([[0.0, 0.0], *right, offsets]),
        cones,
        options,
    )
    found = solver.solve()
    if str(found.status) != "Solved":
        return np.nan
    return float(found.obj_val * size / np.sqrt(top))


def compare(seeds: range, count: int, points: int) -> tuple[int, int]:
    """How many motions were compared with many points, and how many with Clarabel."""
    pytest.importorskip("clarabel")
    by_points = by_program = 0
    for seed, motion in cases(seeds, count):
        assert motion.bound <= motion.duration, seed
        fine = on_many_points(motion, points)
        assert motion.bound <= fine * (1 + NEAR), seed
        assert fine <= motion.duration * (1 + NEAR), seed
        by_points += 1
        if not all(map(is_linear, motion.limits)):
            continue
        parts = min(4, MOST // len(motion.sdd))
        if parts < 1:
            continue
        least = convex_time(finer(motion, parts))
        if np.isnan(least):
            continue
        assert motion.bound <= least * (1 + NEAR), seed
        assert least <= motion.duration * (1 + NEAR), seed
        by_program += 1
    return by_points, by_program


def test_the_bound_is_below_many_points_and_a_convex_program():
    by_points, by_program = compare(range(20_000, 21_000), 8, 8_000)
    assert by_points == 8
    assert by_program >= 4


@pytest.mark.parametrize("power", [1e-9, 1.0, 1e3])
def test_power_alone_from_rest_takes_its_closed_form(power):
    """v^3 = 3 P s / m, and nothing bounds braking: 3/2 s^(2/3) (m / 3 P)^(1/3)."""
    one = robot("powerbot")
    found = time_scale(LINE, [Power(power)], robot=one)
    mass = one.body.mass + sum(w.mass / 2 for w in one.rolling if w.name in one.driven)
    expected = 1.5 * 2.0 ** (2 / 3) * (mass / 3 / power) ** (1 / 3)
    assert found.bound == pytest.approx(expected, rel=5e-4)
    assert found.bound <= expected * (1 + 5e-5)
    assert expected <= found.duration <= expected * (1 + 1e-3)
    assert found.gap <= 1e-3


def test_power_where_a_needle_turns_in_no_length():
    """Wheels turn fast at path speeds of 1e-9 m/s."""
    limits = [Power(20.0), WheelSpeed(19.0), WheelAcceleration(48.0)]
    path = Path.through([[0, 0], [1, 0], [0.03, 1e-4]])
    found = time_scale(path, limits, robot=robot("powerbot"))
    assert found.gap <= 1e-3
    assert min(found.margins().values()) > -1e-9


@pytest.mark.slow
def test_the_bound_of_five_hundred_motions():
    by_points, by_program = compare(range(20_000, 30_000), 500, 40_000)
    assert by_points == 500
    assert by_program >= 250
