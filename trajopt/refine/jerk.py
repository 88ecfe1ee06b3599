"""Jerk-limited motions: the time-optimal profile, smoothed in the time domain by a nonlinear
program.

Path parameter s, speed v and acceleration a are states at N + 1 times, jerk is constant between
them, the duration is free. The limits' rows hold at every node; rows that no motion of this kind
comes near are left out of the program, and every row is checked afterwards. Where rows are broken
between nodes the intervals are split, rows left out are put in, and the program is solved again
from where it was. Jerk rows on an s-grid are not convex and fail near rest, so time is the grid
here.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trajopt.arrays import Array, BoolArray, require_positive, require_whole
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.limit import Limit
from trajopt.refine.jerk_program import solve_jerk
from trajopt.refine.jerk_start import first_guess
from trajopt.refine.smooth import FINE, SmoothMotion, rows_at, smooth_motion
from trajopt.timing.trajectory import Trajectory

_WANTED_SLOWDOWN = 1.002  # of time; chosen: beyond it intervals are split
_MOST_SLOWDOWN = 1.05  # of time; chosen: beyond it the result is refused
# Tables as the rows are, then the strictest rows around a place, and programs solved with each at
# most; chosen: the first are closer where rows are smooth, the second hold where they jump (edges
# of ramps).
_STARTS = (
    1.0,
    1.3,
)  # times the stretched time-optimal motion: the program has several optima; chosen
_ATTEMPTS = ((False, 1), (True, 3))
_PARTS = 3  # an interval is split into; chosen
_SPLIT_ABOVE = 1e-3  # relative violation that splits an interval, or puts a row in; chosen
_NEAR = 0.75  # share of a row's limit that the time-optimal motion uses somewhere, from which it is put in; chosen


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
    the time-optimal profile stretched to the jerk, or where jerk alone binds from the motion that
    turns it over at the quarters of (32 length / jerk)^(1/3). ``nodes`` are spread evenly; more are
    added where the time-optimal acceleration jumps, as fine as the jerk lets it build up. Locally
    optimal; everything is checked again between the nodes and slowed uniformly by what is left.
    The result is a trajectory as any other: states, margins, export, pictures. Raises ArgumentError for bad arguments
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
    halts = trajectory.s[1:-1][trajectory.sd[1:-1] == 0]
    if len(halts):
        raise ArgumentError("trajectory", halts.tolist(), "a motion that does not stop on the way")
    used = trajectory.limits if limits is None else limits
    source = replace(trajectory, limits=used)
    found: list[SmoothMotion] = []
    failure: InfeasibleError | None = None
    for slower in _STARTS:
        try:
            shares, guess = first_guess(trajectory, jerk, nodes, slower)
            found.append(_from(source, jerk, shares, guess, tolerance))
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
    source: Trajectory, jerk: float, evenly: Array, guess: Array, tolerance: float
) -> SmoothMotion:
    """The shortest motion found from one start. Raises InfeasibleError."""
    best: SmoothMotion | None = None
    failure: InfeasibleError | None = None
    first = guess
    for strict, rounds in _ATTEMPTS:
        shares, put_in, guess = evenly, _near(source), first
        for _ in range(rounds):
            if best is not None and best.slowdown <= _WANTED_SLOWDOWN:
                return best
            try:
                found = solve_jerk(source, jerk, shares, put_in, guess, tolerance, strict)
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
    rows = rows_at(source, source.s, source.sd**2)
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
    s, v, a = motion.along(np.minimum(times, motion.duration))
    jerk = np.repeat(motion.jerk, np.where(broken, _PARTS, 1))
    return shares / times[-1], np.concatenate([s, v, a, jerk, [motion.duration]])


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
    excess = worst[:-1].reshape(len(motion.jerk), FINE).max(axis=1) - 1
    slowed = smooth_motion(
        motion,
        motion.times * factor,
        motion.s,
        motion.v / factor,
        motion.a / factor**2,
        motion.jerk / factor**3,
        factor,
        motion.iterations,
    )
    return slowed, excess, np.asarray((needed > 1 + _SPLIT_ABOVE).any(axis=0))
