"""Jerk-limited motions: the time-optimal profile, smoothed in the time domain by a nonlinear program.

Path parameter s, speed v and acceleration a are states at N + 1 equally spaced times, jerk is constant between
them, the duration is free. The limits' rows hold at every node. Jerk rows on an s-grid are not convex and
fail near rest (SOURCES 004), so time is the grid here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.limit import Limit
from trajopt.optimize.ipopt import numpy_on_symbols, smooth_table, solve_program, stacked, variables
from trajopt.paths.samples import sample_path
from trajopt.timing.stages import Stages, assemble
from trajopt.timing.trajectory import Trajectory

Array = NDArray[np.float64]

TABLE_POINTS = 600  # gridpoints of the rows' tables over s; chosen
_SPEED_CAP = 4.0  # times the warm start's top speed; stands for "no bound" in the tables
_FINE = 10  # checked points a node interval
_WANTED_SLOWDOWN = 1.01  # of time; chosen: beyond it the nodes are doubled once
_MOST_SLOWDOWN = 1.05  # of time; chosen: beyond it the result is refused
_TIGHTER = 1e-3  # share by which rows are tightened at the nodes, for what happens between them; chosen


@dataclass(frozen=True, eq=False)
class SmoothMotion:
    """A motion with bounded jerk along the path of ``source``.

    Arrays at N + 1 equally spaced ``times`` (s): ``s`` (m), ``v`` (m/s), ``a`` (m/s^2); ``jerk`` (N,), m/s^3,
    constant in between. ``slowdown`` >= 1 is the factor on time that removed what was broken between nodes.
    """

    source: Trajectory
    times: Array
    s: Array
    v: Array
    a: Array
    jerk: Array
    slowdown: float
    iterations: int

    @property
    def duration(self) -> float:
        return float(self.times[-1])

    def along(self, t: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """s, s', s'' and s''' at times t (N,), s. Raises ArgumentError outside [0, duration]."""
        time = np.atleast_1d(np.asarray(t, dtype=np.float64))
        if not np.all((time >= -1e-9) & (time <= self.duration * (1 + 1e-12) + 1e-9)):
            raise ArgumentError("t", np.asarray(t).tolist(), f"times in [0, {self.duration!r}] s")
        i = np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, len(self.jerk) - 1)
        h, j = time - self.times[i], self.jerk[i]
        a = self.a[i] + j * h
        v = self.v[i] + h * (self.a[i] + j * h / 2)
        s = self.s[i] + h * (self.v[i] + h * (self.a[i] / 2 + j * h / 6))
        return s, v, a, j

    def margins(self) -> dict[str, float]:
        """Least relative margin of every limit, and of the jerk's own bound, at ten points a node interval."""
        s, v, a, _ = self.along(np.linspace(0, self.duration, _FINE * len(self.jerk) + 1))
        rows = _rows(self.source, self.source.limits, np.clip(s, 0.0, self.source.path.length))
        return _margins(rows, v, a)


def limit_jerk(trajectory: Trajectory, jerk: float, *, nodes: int = 150, limits: tuple[Limit, ...] | None = None,
               tolerance: float = 1e-7) -> SmoothMotion:
    """The fastest motion found from rest to rest along the path of ``trajectory`` with |s'''| <= ``jerk``.

    ``limits`` replaces the trajectory's (for instance with a WheelAcceleration added). Starts from the
    time-optimal profile stretched to the jerk. Locally optimal; everything is checked again between the nodes
    and slowed uniformly by what is left. Raises ArgumentError for bad arguments (a trajectory that does not
    start and end at rest among them), InfeasibleError when IPOPT finds no motion or the slow-down is too large.
    """
    if not (np.isfinite(jerk) and jerk > 0):
        raise ArgumentError("jerk", jerk, "a finite value > 0 m/s^3")
    if nodes < 10:
        raise ArgumentError("nodes", nodes, "10 or more nodes")
    if trajectory.sd[0] > 1e-9 or trajectory.sd[-1] > 1e-9:
        raise ArgumentError("trajectory", (float(trajectory.sd[0]), float(trajectory.sd[-1])),
                            "a motion from rest to rest")
    used = trajectory.limits if limits is None else limits
    source = replace(trajectory, limits=used)
    best: SmoothMotion | None = None
    for count in (nodes, 2 * nodes):
        s, v, a, j, total, iterations = _solve(trajectory, used, jerk, count, tolerance)
        times = np.linspace(0.0, total, count + 1)
        motion = _slowed(SmoothMotion(source, times, s, v, a, j, 1.0, iterations))
        best = motion if best is None or motion.duration < best.duration else best
        if best.slowdown <= _WANTED_SLOWDOWN:
            break
    assert best is not None
    if best.slowdown <= _MOST_SLOWDOWN:
        return best
    name, margin = min(best.margins().items(), key=lambda item: item[1])
    raise InfeasibleError(name, 0.0, f"it is broken between {2 * nodes} nodes and would cost a factor of "
                                     f"{best.slowdown:.3g} on time (least margin {margin:.2g}); take more nodes")


@numpy_on_symbols(False)
def _solve(trajectory: Trajectory, limits: tuple[Limit, ...], jerk: float, nodes: int,
           tolerance: float) -> tuple[Array, Array, Array, Array, float, int]:
    length, top = trajectory.path.length, float(trajectory.sd.max())
    grid = np.linspace(0.0, length, TABLE_POINTS)
    rows = _rows(trajectory, limits, grid)
    bound = np.minimum(rows.sd2_max, (_SPEED_CAP * top) ** 2)
    width = rows.a.shape[1]
    table = smooth_table(grid, np.column_stack([rows.a, rows.b, rows.c, 1 / bound]))
    n = nodes
    x = variables(3 * (n + 1) + n + 1)
    s, v, a = (x[k * (n + 1):(k + 1) * (n + 1)] for k in range(3))
    j, total = x[3 * (n + 1):4 * n + 3], x[-1]
    h = total / n
    dynamics = stacked([
        s[1:] - (s[:-1] + h * (v[:-1] + h * (a[:-1] / 2 + j * h / 6))),
        v[1:] - (v[:-1] + h * (a[:-1] + j * h / 2)),
        a[1:] - (a[:-1] + j * h)])
    at = table(s.T)
    square, rate = (v * v).T, a.T
    used: list[Any] = [(at[3 * width, :] * square).T]
    used += [(at[k, :] * rate + at[width + k, :] * square - (1 - _TIGHTER) * at[2 * width + k, :]).T
             for k in range(width)]
    constraints = stacked([dynamics, *used])
    equal, above = np.zeros(3 * n), np.full((n + 1) * (width + 1), -np.inf)
    below = np.concatenate([np.full(n + 1, 1.0 - _TIGHTER), np.zeros((n + 1) * width)])
    start = _first_guess(trajectory, jerk, n)
    lower = np.concatenate([np.zeros(2 * (n + 1)), np.full(n + 1, -np.inf), np.full(n, -jerk), [0.1 * start[-1]]])
    upper = np.concatenate([np.full(n + 1, length), np.full(2 * (n + 1), np.inf), np.full(n, jerk),
                            [10 * start[-1]]])
    for k, value in ((0, 0.0), (n, length), (n + 1, 0.0), (2 * n + 1, 0.0), (2 * n + 2, 0.0), (3 * n + 2, 0.0)):
        lower[k] = upper[k] = value
    result = solve_program(x, total, constraints, start=start, lower=lower, upper=upper,
                           constraint_lower=np.concatenate([equal, above]),
                           constraint_upper=np.concatenate([equal, below]), tolerance=tolerance)
    if not result.solved:
        raise InfeasibleError("jerk", 0.0, f"IPOPT found no motion with at most {jerk:g} m/s^3 "
                                           f"({result.status}); take more nodes or a larger jerk")
    parts = np.split(result.x, [n + 1, 2 * n + 2, 3 * n + 3, 4 * n + 3])
    return parts[0], parts[1], parts[2], parts[3], float(parts[4][0]), result.iterations


def _first_guess(trajectory: Trajectory, jerk: float, n: int) -> Array:
    """The time-optimal motion, run slower by what its largest accelerations need to build up at ``jerk``."""
    peak = float(np.abs(trajectory.sdd).max())
    stretch = 1.0 + peak / jerk / trajectory.duration
    t = np.linspace(0.0, trajectory.duration, n + 1)
    s, v, a = trajectory.along(t)
    v, a = v / stretch, a / stretch**2
    a[[0, -1]] = v[[0, -1]] = 0.0
    h = trajectory.duration * stretch / n
    return np.concatenate([s, v, a, np.clip(np.diff(a) / h, -jerk, jerk), [trajectory.duration * stretch]])


def _rows(trajectory: Trajectory, limits: tuple[Limit, ...], s: Array) -> Stages:
    return assemble(sample_path(trajectory.path, s), limits, trajectory.robot)


def _margins(rows: Stages, v: Array, a: Array) -> dict[str, float]:
    slack = rows.c - rows.a * a[:, None] - rows.b * (v**2)[:, None]
    found = {}
    for k, name in enumerate(rows.names):
        mine = slack[:, rows.row_owner == k]
        speed = 1 - np.sqrt(v**2 / rows.bounds[k])
        found[name] = float(min(mine.min(initial=np.inf), speed.min()))
    return found


def _slowed(motion: SmoothMotion) -> SmoothMotion:
    """Slowed uniformly until every row holds on the fine grid. Rest is feasible, so a factor exists."""
    s, v, a, _ = motion.along(np.linspace(0, motion.duration, _FINE * len(motion.jerk) + 1))
    rows = _rows(motion.source, motion.source.limits, np.clip(s, 0.0, motion.source.path.length))
    used = rows.a * a[:, None] + rows.b * (v**2)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = np.where(rows.c > 0, used / rows.c, 1.0).max(initial=1.0)
        needed = max(float(needed), float(np.nanmax((v**2) / rows.sd2_max)))
    factor = float(np.sqrt(max(1.0, needed)))
    return SmoothMotion(motion.source, motion.times * factor, motion.s, motion.v / factor, motion.a / factor**2,
                        motion.jerk / factor**3, factor, motion.iterations)
