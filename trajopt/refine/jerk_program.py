"""The program of a jerk-limited motion, written in its own units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from trajopt.arrays import Array, BoolArray
from trajopt.errors import InfeasibleError
from trajopt.optimize.symbols import (
    numpy_on_symbols,
    smooth_table,
    solve_program,
    stacked,
    variables,
)
from trajopt.refine.jerk_start import least_time
from trajopt.refine.smooth import SmoothMotion, rows_at, smooth_motion
from trajopt.timing.trajectory import Trajectory

TABLE_POINTS = 1200  # gridpoints of the rows' tables over s; chosen
_REACH = 2  # cells that a cubic B-spline mixes on either side: where rows jump, a table takes the strictest of them
_SPEED_CAP = 4.0  # times the warm start's top speed; stands for "no bound" in the tables
# Share by which rows are tightened at the nodes, for what happens between them; chosen.
_TIGHTER = 1e-4


@numpy_on_symbols(False)
def solve_jerk(
    source: Trajectory,
    jerk: float,
    shares: Array,
    put_in: BoolArray,
    start: Array,
    tolerance: float,
    strict: bool,
) -> SmoothMotion:
    """The program's motion on intervals that are ``shares`` (N,) of the duration, with the rows
    ``put_in`` (R,)."""
    length, top = source.path.length, float(source.sd.max())
    grid = np.linspace(0.0, length, TABLE_POINTS)
    rows = rows_at(source, grid, np.interp(grid, source.s, source.sd**2))
    n = len(shares)
    scale = _Scale.of(start, n, length, jerk)
    cap = max(_SPEED_CAP * top, 2 * scale.v)
    use = 1 / np.minimum(rows.sd2_max, cap**2)
    width = int(put_in.sum())
    values = np.column_stack([rows.a[:, put_in], rows.b[:, put_in], rows.c[:, put_in], use])
    if strict:
        a, b, c, speed = np.split(values, [width, 2 * width, 3 * width], axis=1)
        held = [a, _strictest(b), -_strictest(-c), _strictest(speed)]
        values = _without_ringing(np.column_stack(held))
    values *= np.repeat([scale.a, scale.v**2, 1.0, scale.v**2], [width, width, width, 1])
    table = smooth_table(grid / length, values)
    x = variables(4 * n + 4)
    s, v, a, j, total = (
        x[: n + 1],
        x[n + 1 : 2 * n + 2],
        x[2 * n + 2 : 3 * n + 3],
        x[3 * n + 3 : -1],
        x[-1],
    )
    h = total * shares
    p, q, r = scale.v * scale.t / length, scale.a * scale.t / scale.v, jerk * scale.t / scale.a
    dynamics = stacked(
        [
            s[1:] - (s[:-1] + p * h * (v[:-1] + q * h * (a[:-1] / 2 + r * j * h / 6))),
            v[1:] - (v[:-1] + q * h * (a[:-1] + r * j * h / 2)),
            a[1:] - (a[:-1] + r * j * h),
        ]
    )
    at = table(s.T)
    square, rate = (v * v).T, a.T
    # The middle one of the Bernstein coefficients of v: with both ends it bounds v in between.
    between = (v[:-1] + q * h * a[:-1] / 2).T
    cap_between = (at[3 * width, :-1] + at[3 * width, 1:]) / 2
    used: list[Any] = [(at[3 * width, :] * square).T, (cap_between * between * between).T]
    used += [
        (at[k, :] * rate + at[width + k, :] * square - (1 - _TIGHTER) * at[2 * width + k, :]).T
        for k in range(width)
    ]
    equal, above = np.zeros(3 * n), np.full(n + (n + 1) * (width + 1), -np.inf)
    below = np.concatenate([np.full(2 * n + 1, 1.0 - _TIGHTER), np.zeros((n + 1) * width)])
    free, floor = np.full(n + 1, np.inf), least_time(length, jerk) * (1 - 1e-6) / scale.t
    lower = np.concatenate([np.zeros(2 * (n + 1)), -free, np.full(n, -1.0), [floor]])
    upper = np.concatenate([np.ones(n + 1), free, free, np.ones(n), [np.inf]])
    ends = [0, n, n + 1, 2 * n + 1, 2 * n + 2, 3 * n + 2]  # of s, v, a: from rest to rest
    lower[ends] = upper[ends] = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    units = scale.units(n)
    result = solve_program(
        x,
        total,
        stacked([dynamics, *used]),
        start=start / units,
        lower=lower,
        upper=upper,
        constraint_lower=np.concatenate([equal, above]),
        constraint_upper=np.concatenate([equal, below]),
        tolerance=tolerance,
    )
    if not result.solved:
        raise InfeasibleError(
            "jerk",
            0.0,
            f"IPOPT found no motion with at most {jerk:g} m/s^3 "
            f"({result.status}); take more nodes or a larger jerk",
        )
    s, v, a, j, total = np.split(result.x * units, [n + 1, 2 * n + 2, 3 * n + 3, 4 * n + 3])
    times = np.concatenate([[0.0], np.cumsum(shares)]) * float(total[0])
    return smooth_motion(source, times, s, np.maximum(v, 0.0), a, j, 1.0, result.iterations)


@dataclass(frozen=True)
class _Scale:
    """Sizes of speed, acceleration and time (m, s) in which the program is written, beside the
    length and the jerk: the same program for every size of motion."""

    v: float
    a: float
    t: float
    length: float
    jerk: float

    @classmethod
    def of(cls, start: Array, n: int, length: float, jerk: float) -> _Scale:
        v, a = start[n + 1 : 2 * n + 2], start[2 * n + 2 : 3 * n + 3]
        return cls(float(v.max()), float(np.abs(a).max()), float(start[-1]), length, jerk)

    def units(self, n: int) -> Array:
        """(4 N + 4,): of s, v, a, jerk and the duration."""
        sizes = [self.length, self.v, self.a, self.jerk, self.t]
        return np.repeat(sizes, [n + 1, n + 1, n + 1, n, 1])


def _strictest(values: Array) -> Array:
    """(M, K): the largest values within _REACH cells. Coefficients of s'' need none of it: they do
    not jump on a path of class C2."""
    padded = np.pad(values, ((_REACH, _REACH), (0, 0)), mode="edge")
    return np.asarray(
        np.lib.stride_tricks.sliding_window_view(padded, 2 * _REACH + 1, axis=0).max(axis=-1)
    )


def _without_ringing(values: Array) -> Array:
    """(M, K): what the cubic B-spline with coefficients ``values`` is on the grid, so that
    interpolation gives that spline: a mean of the values within _REACH cells, while one through the
    values would ring at jumps and peaks."""
    around = np.pad(values, ((1, 1), (0, 0)), mode="edge")
    return np.asarray((around[:-2] + 4 * around[1:-1] + around[2:]) / 6)
