"""Jerk-limited motions: the time-optimal profile, smoothed in time by a nonlinear program.

Path parameter s, speed v and acceleration a are states at N + 1 times, jerk is constant between
them, the duration is free. The limits' rows hold at every node; rows that no motion of this kind
comes near are left out of the program, and every row is checked afterwards. Where rows are broken
between nodes the intervals are split, rows left out are put in, and the program is solved again
from where it was. Jerk rows on an s-grid are not convex and fail near rest, so time is the grid
here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray, as_numbers, require_positive, require_whole
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.limit import Limit
from trajopt.optimize.symbols import (
    numpy_on_symbols,
    smooth_table,
    solve_program,
    stacked,
    variables,
)
from trajopt.timing.stages import Stages, assemble
from trajopt.timing.trajectory import Trajectory

TABLE_POINTS = 1200  # gridpoints of the rows' tables over s; chosen
_REACH = 2  # cells that a cubic B-spline mixes on either side: where rows jump, a table takes the strictest of them
_SPEED_CAP = 4.0  # times the warm start's top speed; stands for "no bound" in the tables
_FINE = 10  # checked points a node interval
_WANTED_SLOWDOWN = 1.01  # of time; chosen: beyond it intervals are split
_MOST_SLOWDOWN = 1.05  # of time; chosen: beyond it the result is refused
# Tables as the rows are, then the strictest rows around a place, and programs solved with each at
# most; chosen: the first are closer where rows are smooth, the second hold where they jump (ramps).
_STARTS = 1.0, 1.3  # times the stretched time-optimal motion: there are several optima; chosen
_ATTEMPTS = ((False, 2), (True, 3))
_PARTS = 3  # an interval is split into; chosen
_SPLIT_ABOVE = 1e-3  # relative violation that splits an interval, or puts a row in; chosen
_NEAR = 0.4  # share of a row's limit that the time-optimal motion uses somewhere, from which it is put in; chosen
_TIGHTER = 1e-3  # share by which rows are tightened at the nodes, for what is between; chosen


@dataclass(frozen=True, eq=False)
class SmoothMotion:
    """A motion with bounded jerk along the path of ``source``.

    Arrays at N + 1 ``times`` (s): ``s`` (m), ``v`` (m/s), ``a`` (m/s^2); ``jerk`` (N,), m/s^3,
    constant in between. ``slowdown`` >= 1 is the factor on time that removed what was broken
    between nodes.
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
        time = np.atleast_1d(as_numbers("t", t, f"times in [0, {self.duration!r}] s"))
        if not np.all((time >= -1e-9) & (time <= self.duration * (1 + 1e-12) + 1e-9)):
            raise ArgumentError("t", np.asarray(t).tolist(), f"times in [0, {self.duration!r}] s")
        i = np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, len(self.jerk) - 1)
        h, j = time - self.times[i], self.jerk[i]
        a = self.a[i] + j * h
        v = self.v[i] + h * (self.a[i] + j * h / 2)
        s = self.s[i] + h * (self.v[i] + h * (self.a[i] / 2 + j * h / 6))
        return s, v, a, j

    def margins(self) -> dict[str, float]:
        """Least relative margin of every limit, and of the jerk's own bound, at ten points a node
        interval."""
        rows, v, a = self.checked()
        slack = rows.c - rows.a * a[:, None] - rows.b * (v**2)[:, None]
        found = {}
        for k, name in enumerate(rows.names):
            mine = slack[:, rows.row_owner == k]
            speed = 1 - np.sqrt(v**2 / rows.bounds[k])
            found[name] = float(min(mine.min(initial=np.inf), speed.min()))
        return found

    def checked(self) -> tuple[Stages, Array, Array]:
        """Rows, speeds and accelerations at ``_FINE`` times in every node interval, and the
        last."""
        inside = self.times[:-1, None] + np.diff(self.times)[:, None] * (np.arange(_FINE) / _FINE)
        s, v, a, _ = self.along(np.append(inside.ravel(), self.times[-1]))
        return _rows(self.source, np.clip(s, 0.0, self.source.path.length)), v, a


def limit_jerk(
    trajectory: Trajectory,
    jerk: float,
    *,
    nodes: int = 150,
    limits: tuple[Limit, ...] | None = None,
    tolerance: float = 1e-7,
) -> SmoothMotion:
    """The fastest motion found from rest to rest along the path of ``trajectory`` with |s'''| <=
    ``jerk``.

    ``limits`` replaces the trajectory's (for instance with a WheelAcceleration added). Starts from
    the time-optimal profile stretched to the jerk. Locally optimal; everything is checked again
    between the nodes and slowed uniformly by what is left. Raises ArgumentError for bad arguments
    (a trajectory that does not start and end at rest among them), InfeasibleError when IPOPT finds
    no motion or the slow-down is too large.
    """
    require_positive("jerk", jerk, "m/s^3")
    require_whole("nodes", nodes, 10, "10 to 10,000 nodes", 10_000)
    if trajectory.sd[0] > 1e-9 or trajectory.sd[-1] > 1e-9:
        raise ArgumentError(
            "trajectory",
            (float(trajectory.sd[0]), float(trajectory.sd[-1])),
            "a motion from rest to rest",
        )
    if trajectory.rests:
        expected = "a motion whose wheels need not turn at rest on the way"
        raise ArgumentError("trajectory", [rest.s for rest in trajectory.rests], expected)
    used = trajectory.limits if limits is None else limits
    source = replace(trajectory, limits=used)
    found: list[SmoothMotion] = []
    failure: InfeasibleError | None = None
    for slower in _STARTS:
        try:
            guess = _first_guess(trajectory, jerk, nodes, slower)
            found.append(_from(source, jerk, nodes, guess, tolerance))
        except InfeasibleError as error:
            failure = error
    if not found:
        assert failure is not None
        raise failure
    best = min(found, key=lambda motion: (motion.slowdown > _MOST_SLOWDOWN, motion.duration))
    if best.slowdown <= _MOST_SLOWDOWN:
        return best
    name, margin = min(best.margins().items(), key=lambda item: item[1])
    raise InfeasibleError(
        name,
        0.0,
        f"it is broken between {len(best.jerk)} nodes and would cost a factor of "
        f"{best.slowdown:.3g} on time (least margin {margin:.2g}); take more nodes",
    )


def _from(
    source: Trajectory, jerk: float, nodes: int, guess: Array, tolerance: float
) -> SmoothMotion:
    """The shortest motion found from one start. Raises InfeasibleError."""
    best: SmoothMotion | None = None
    failure: InfeasibleError | None = None
    first = guess
    for strict, rounds in _ATTEMPTS:
        shares, put_in, guess = np.full(nodes, 1 / nodes), _near(source), first
        for _ in range(rounds):
            if best is not None and best.slowdown <= _WANTED_SLOWDOWN:
                return best
            try:
                found = _solve(source, jerk, shares, put_in, guess, tolerance, strict)
            except InfeasibleError as error:
                failure = error
                break
            motion, excess, rows = _slowed(found)
            best = motion if best is None or motion.duration < best.duration else best
            shares, guess = _finer(found, excess)
            put_in = put_in | rows
    if best is None:
        assert failure is not None
        raise failure
    return best


def _near(source: Trajectory) -> BoolArray:
    """(R,): which rows the time-optimal motion comes near to."""
    rows = _rows(source, source.s)
    sdd = np.append(source.sdd, source.sdd[-1])
    used = rows.a * sdd[:, None] + rows.b * source.sd[:, None] ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((np.where(rows.c > 0, used / rows.c, 1.0) > _NEAR).any(axis=0))


def _finer(motion: SmoothMotion, excess: Array) -> tuple[Array, Array]:
    """Shares (M,) of the duration with broken intervals (and their neighbours) split, and a start
    there."""
    broken = excess > _SPLIT_ABOVE
    broken = broken | np.append(broken[1:], False) | np.append(False, broken[:-1])
    steps = np.diff(motion.times)
    shares = np.concatenate(
        [np.full(_PARTS, h / _PARTS) if b else [h] for h, b in zip(steps, broken, strict=True)]
    )
    times = np.concatenate([[0.0], np.cumsum(shares)])
    s, v, a, _ = motion.along(np.minimum(times, motion.duration))
    jerk = np.repeat(motion.jerk, np.where(broken, _PARTS, 1))
    return shares / times[-1], np.concatenate([s, v, a, jerk, [motion.duration]])


@numpy_on_symbols(False)
def _solve(
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
    rows = _rows(source, grid)
    use = 1 / np.minimum(rows.sd2_max, (_SPEED_CAP * top) ** 2)
    width, n = int(put_in.sum()), len(shares)
    values = np.column_stack([rows.a[:, put_in], rows.b[:, put_in], rows.c[:, put_in], use])
    if strict:
        a, b, c, cap = np.split(values, [width, 2 * width, 3 * width], axis=1)
        held = [a, _strictest(b), -_strictest(-c), _strictest(cap)]
        values = _without_ringing(np.column_stack(held))
    table = smooth_table(grid, values)
    x = variables(3 * (n + 1) + n + 1)
    s, v, a = (x[k * (n + 1) : (k + 1) * (n + 1)] for k in range(3))
    j, total = x[3 * (n + 1) : 4 * n + 3], x[-1]
    h = total * shares
    dynamics = stacked(
        [
            s[1:] - (s[:-1] + h * (v[:-1] + h * (a[:-1] / 2 + j * h / 6))),
            v[1:] - (v[:-1] + h * (a[:-1] + j * h / 2)),
            a[1:] - (a[:-1] + j * h),
        ]
    )
    at = table(s.T)
    square, rate = (v * v).T, a.T
    used: list[Any] = [(at[3 * width, :] * square).T]
    used += [
        (at[k, :] * rate + at[width + k, :] * square - (1 - _TIGHTER) * at[2 * width + k, :]).T
        for k in range(width)
    ]
    constraints = stacked([dynamics, *used])
    equal, above = np.zeros(3 * n), np.full((n + 1) * (width + 1), -np.inf)
    below = np.concatenate([np.full(n + 1, 1.0 - _TIGHTER), np.zeros((n + 1) * width)])
    lower = np.concatenate(
        [np.zeros(2 * (n + 1)), np.full(n + 1, -np.inf), np.full(n, -jerk), [0.1 * start[-1]]]
    )
    upper = np.concatenate(
        [np.full(n + 1, length), np.full(2 * (n + 1), np.inf), np.full(n, jerk), [10 * start[-1]]]
    )
    ends = [0, n, n + 1, 2 * n + 1, 2 * n + 2, 3 * n + 2]  # of s, v, a: from rest to rest
    lower[ends] = upper[ends] = [0.0, length, 0.0, 0.0, 0.0, 0.0]
    result = solve_program(
        x,
        total,
        constraints,
        start=start,
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
    s, v, a, j, total = np.split(result.x, [n + 1, 2 * n + 2, 3 * n + 3, 4 * n + 3])
    times = np.concatenate([[0.0], np.cumsum(shares)]) * float(total[0])
    return SmoothMotion(source, times, s, v, a, j, 1.0, result.iterations)


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


def _first_guess(trajectory: Trajectory, jerk: float, n: int, slower: float) -> Array:
    """The time-optimal motion, run slower by what its largest accelerations need to build up at
    ``jerk``, and by the factor ``slower``."""
    peak = float(np.abs(trajectory.sdd).max())
    stretch = slower * (1.0 + peak / jerk / trajectory.duration)
    t = np.linspace(0.0, trajectory.duration, n + 1)
    s, v, a = trajectory.along(t)
    v, a = v / stretch, a / stretch**2
    a[[0, -1]] = v[[0, -1]] = 0.0
    h = trajectory.duration * stretch / n
    return np.concatenate(
        [s, v, a, np.clip(np.diff(a) / h, -jerk, jerk), [trajectory.duration * stretch]]
    )


def _rows(trajectory: Trajectory, s: Array) -> Stages:
    samples = trajectory.track.samples(s, trajectory.path.locate(s))
    samples = replace(samples, sd2=np.interp(s, trajectory.s, trajectory.sd**2))
    return assemble(samples, trajectory.limits, trajectory.robot)


def _slowed(motion: SmoothMotion) -> tuple[SmoothMotion, Array, BoolArray]:
    """Slowed uniformly until every row holds on the fine grid (rest is feasible, so a factor
    exists); how far each interval (N,) was broken before; which rows (R,) were."""
    rows, v, a = motion.checked()
    used = rows.a * a[:, None] + rows.b * (v**2)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = np.where(rows.c > 0, used / rows.c, 1.0)
        speed = np.nan_to_num(v**2 / rows.sd2_max)
    worst = np.maximum(needed.max(axis=1, initial=1.0), speed)
    factor = float(np.sqrt(worst.max()))
    excess = worst[:-1].reshape(len(motion.jerk), _FINE).max(axis=1) - 1
    slowed = SmoothMotion(
        motion.source,
        motion.times * factor,
        motion.s,
        motion.v / factor,
        motion.a / factor**2,
        motion.jerk / factor**3,
        factor,
        motion.iterations,
    )
    return slowed, excess, np.asarray((needed > 1 + _SPLIT_ABOVE).any(axis=0))
