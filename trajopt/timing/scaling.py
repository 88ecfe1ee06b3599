"""Time scaling: the fastest motion along a path that keeps all limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, require_choice, require_positive
from trajopt.errors import InfeasibleError
from trajopt.limits.limit import Limit, is_linear
from trajopt.paths.path import Path
from trajopt.paths.samples import require_moving
from trajopt.robots.robot import Robot
from trajopt.timing.cells import Measure, Source
from trajopt.timing.curved import source_of
from trajopt.timing.engines import is_second_order
from trajopt.timing.fastest import Ask, Stuck, fastest, roughly
from trajopt.timing.first_order import first_order, refuse
from trajopt.timing.grid import graded_grid, initial_grid, insert, placed
from trajopt.timing.job import Job, checked_job
from trajopt.timing.overspeed import yielding
from trajopt.timing.rests import with_rests
from trajopt.timing.steps import steps
from trajopt.timing.trajectory import Trajectory
from trajopt.world.ground import Ground

_TRIALS = 3  # grids where a motion exists but is not found; chosen


def time_scale(
    path: Path,
    limits: Sequence[Limit],
    *,
    robot: Robot | None = None,
    ground: Ground | None = None,
    start_speed: float = 0.0,
    end_speed: float = 0.0,
    gridpoints: int | ArrayLike | None = None,
    engine: str = "auto",
    stops: ArrayLike = (),
    too_fast: Literal["refuse", "brake"] = "refuse",
    start_wheels: ArrayLike = (),
    start_steering: Mapping[str, float] | None = None,
    gap: float | None = 1e-3,
) -> Trajectory:
    """Fastest motion along ``path`` within ``limits``, from ``start_speed`` to ``end_speed`` (s',
    m/s).

    ``ground``: a plane path is laid onto it (the trajectory's path is then the laid one, and path
    parameters are arc lengths in space); a path in space must lie on it. Without ground, or with
    ``Flat``, the path itself is the ground, level across its direction.

    ``engine``: "auto" and "compiled" are of second order: s'' is linear between gridpoints, which lie
    where the motion varies. The motion is checked inside every cell, and a lower bound on the time of
    any motion that keeps the limits stands beside it: the grid is refined until both are within
    ``gap`` of the duration, if that can be reached (``Trajectory.gap`` tells; None: no bound is made).
    "toppra" holds s'' constant between evenly spread gridpoints. Two more are slower motions: "linear" ([waheed2006]: one factor for the whole motion, uniform in the spline
    parameter, with the end speeds that the path gives it, so start and end speed must stay 0) and
    "segments" (below the speed of a factor for each spline segment). ``gridpoints``: how many, or
    path parameters (m); more are added where limits are broken between them. ``stops``: path
    parameters (m) where the robot comes to rest on the way, and steered wheels turn if they must
    (``Trajectory.rests``). ``too_fast``: what to do where a bound
    on the speed alone (speed, zone, profile, wheel speed, yaw rate) lies below what braking from
    ``start_speed`` can reach, as when a zone appears in front of a moving robot: "refuse" raises
    InfeasibleError, "brake" brakes into it as fast as the other limits allow (with 99.9 % of it);
    the trajectory's limits, and so its margins, then hold the bound that was raised to that
    braking. ``start_wheels`` (W,): wheel angles at the start, rad; () for zeros. ``start_steering``:
    steering and castor angles at the start, rad, by wheel; castors that are not named start as the
    robot's file draws them, steered wheels as the path begins; those that stand otherwise turn
    first, if the robot starts from rest.

    What is still broken between gridpoints is removed by slowing the whole motion, end speeds
    included, by at most 0.1 % (``Trajectory.slowdown``). Where standing still breaks a limit
    (momentum over a slope that is too slippery) slowing does not help; then all limits are taken
    0.01 or 0.1 % tighter instead.

    Raises ArgumentError for bad arguments, InfeasibleError (limit and place) where no motion
    exists.
    """
    speeds, start = (start_speed, end_speed), (start_wheels, start_steering)
    job = checked_job(path, limits, robot, ground, speeds, engine, stops, start)
    if gap is not None:
        require_positive("gap", gap, "(a share of the duration), or None")
    require_choice("too_fast", too_fast, ("refuse", "brake"))
    second_order = is_second_order(engine)
    if second_order and not job.track.steers and too_fast == "refuse" and job.drives_anywhere():
        require_moving(job.path)
        return _second_order(job, gridpoints, gap, np.zeros(0))
    u = insert(job.path, initial_grid(job.path, gridpoints), job.stops)
    rests = job.stops if start_speed > 0 or engine == "linear" else np.append(job.stops, 0.0)
    job = replace(job, track=with_rests(job.track, job.limits, u, rests))
    job.require_drivable(u)
    raised: tuple[Limit, ...] = job.limits
    if too_fast == "brake" and start_speed > 0:
        square = job.squares[0]
        rows = steps(job.track, u, job.limits, np.full(len(u), square))
        raised = yielding(job.limits, rows, square)
    places = u if raised != job.limits else u[:0]
    job = replace(job, limits=raised)
    return _second_order(job, gridpoints, gap, places) if second_order else first_order(job, u)


def _second_order(
    job: Job,
    gridpoints: int | ArrayLike | None,
    gap: float | None,
    also: Array,
) -> Trajectory:
    """The fastest motion on a graded grid, with gridpoints ``also`` (spline parameters)."""
    path, along = job.path, job.track
    ask, source, u, jumps = _asked(job, gridpoints, gap, also)
    measure = Measure.of(along)
    for done in range(_TRIALS):
        try:
            found = fastest(ask, source, u, jumps)
            break
        except Stuck:
            refuse(job, insert(path, initial_grid(path, gridpoints), job.stops))
            if done == _TRIALS - 1:
                bent = [limit.name for limit in job.limits if not is_linear(limit)]
                raise InfeasibleError(
                    (bent or [job.limits[0].name])[0], 0.0, "no profile was found on any grid"
                ) from None
            u = np.sort(np.concatenate([u, (u[:-1] + u[1:]) / 2]))
    profile = found.profile
    s = path.parameter(profile.u)
    g, _ = measure.stretch(profile.u)
    sd = np.sqrt(profile.y) / g
    return Trajectory(
        path,
        job.limits,
        along.robot,
        along.ground,
        profile.u,
        s,
        sd,
        np.diff(sd**2) / (2 * np.maximum(np.diff(s), 1e-300)),
        "compiled",
        found.slowdown,
        job.start_wheels,
        along.start_steering,
        profile,
        found.bound,
        found.reason,
    )


def _asked(
    job: Job, gridpoints: int | ArrayLike | None, gap: float | None, also: Array
) -> tuple[Ask, Source, Array, Array]:
    """What the core is asked, its rows, its first grid u, and where rows may jump."""
    path, along = job.path, job.track
    measure, knots = Measure.of(along), np.asarray(path.basis.knots)
    source = source_of(along, measure, job.limits)
    u = graded_grid(measure, gridpoints)
    edges = np.asarray(source.edges(along, u), dtype=np.float64)
    edges = edges[(edges > 0) & (edges < path.length)]
    wanted = np.concatenate([path.locate(np.append(job.stops, edges)), along.rests, also])
    u, kept = placed(u, wanted, knots)
    ask = Ask(along, job.limits, job.start, job.end, kept[: len(job.stops)], gap)
    return ask, source, u, np.concatenate([knots, kept])


def rough_duration(
    path: Path,
    limits: Sequence[Limit],
    *,
    robot: Robot | None = None,
    gridpoints: int | ArrayLike | None = None,
) -> float:
    """Duration (s) from rest to rest of the fastest profile that keeps the limits at the
    gridpoints; between them nothing is checked or refused. It ranks paths faster than
    ``time_scale``, on flat ground; raises as that does at the gridpoints.
    """
    job = checked_job(path, limits, robot, None, (0.0, 0.0), "auto", ())
    u = initial_grid(path, gridpoints)
    job.require_drivable(u)
    try:
        return roughly(*_asked(job, gridpoints, None, u[:0]))
    except Stuck:
        refuse(job, u)
        raise InfeasibleError(job.limits[0].name, 0.0, "no profile was found") from None
