"""Time scaling: the fastest motion along a path that keeps all limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, as_numbers, require_not_negative, require_positive
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.limit import Limit, is_linear
from trajopt.paths.path import Path
from trajopt.paths.samples import require_moving
from trajopt.robots.robot import Robot
from trajopt.timing.cells import Measure
from trajopt.timing.compiled import forward_profile
from trajopt.timing.curved import source_of
from trajopt.timing.engines import ENGINES, pick_engine, require_engine
from trajopt.timing.fastest import Ask, Stuck, fastest
from trajopt.timing.feasibility import require_motion
from trajopt.timing.grid import MOST_REFINED, graded_grid, initial_grid, insert, placed, split
from trajopt.timing.linear import linear_profile
from trajopt.timing.overspeed import yielding
from trajopt.timing.rests import AT, with_rests
from trajopt.timing.segments import segment_ceiling
from trajopt.timing.stages import FineRows, Stages, check, fine_rows, refined, stages_of
from trajopt.timing.tangents import settled
from trajopt.timing.track import Track, track
from trajopt.timing.trajectory import Trajectory
from trajopt.world.ground import Ground

REFINE_ABOVE = (
    1e-5  # violation of s'^2 between gridpoints, relative, that is refined away if it can; chosen
)
REFINE_ROUNDS = 4  # rounds spent on that; chosen
MOST_ROUNDS = 16  # rounds before giving up on a violation above the largest slow-down; chosen
LARGEST_SLOWDOWN = 1.001  # of time; chosen
_TRIALS = 3  # grids where a motion exists but is not found; chosen
_KEPT = 1e-9  # relative violation that counts as none
_TIGHTER = (
    0.0,
    1e-4,
    1e-3,
)  # shares taken off all limits, in turn, where slowing down does not help; chosen
_JUMP = 1e-2  # of a wheel speed, at a line of the ground; chosen: as much as tyres give way
_FASTEST = 1e6  # m/s, chosen: beyond it is an input error, and squares stay far from overflow


@dataclass(frozen=True, eq=False)
class _Job:
    """What to scale. Ends are s'^2; ``stops`` are path parameters where the robot comes to rest."""

    track: Track
    limits: tuple[Limit, ...]
    start: float
    end: float
    stops: Array
    engine: str
    start_wheels: Array

    @property
    def path(self) -> Path:
        return self.track.path


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
    "bounds" (only where s' and s'' alone are bounded) and "toppra" hold s'' constant between evenly
    spread gridpoints. Two more are slower motions: "linear" ([waheed2006]: one factor for the whole motion, uniform in the spline
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
    exists, and MissingDependencyError for "compiled" without numba.
    """
    speeds, start = (start_speed, end_speed), (start_wheels, start_steering)
    job = _job(path, limits, robot, ground, speeds, engine, stops, start)
    if gap is not None:
        require_positive("gap", gap, "(a share of the duration), or None")
    if too_fast not in ("refuse", "brake"):
        raise ArgumentError("too_fast", too_fast, "refuse or brake")
    second_order = engine in ("auto", "compiled")
    if second_order and not job.track.steers and too_fast == "refuse" and _drives_anywhere(job):
        require_moving(job.path)
        return _second_order(job, speeds, gridpoints, gap, np.zeros(0))
    u = insert(job.path, initial_grid(job.path, gridpoints), job.stops)
    rests = job.stops if start_speed > 0 or engine == "linear" else np.append(job.stops, 0.0)
    job = replace(job, track=with_rests(job.track, job.limits, u, rests))
    _require_drivable(job, u)
    if too_fast == "brake" and start_speed > 0:
        job = replace(
            job,
            limits=yielding(
                job.limits,
                fine_rows(job.track, u, job.limits, np.full(len(u), job.start)),
                job.start,
            ),
        )
    if engine == "linear":
        return _linear(job, fine_rows(job.track, u, job.limits))
    if second_order:
        return _second_order(
            job, speeds, gridpoints, gap, u if job.limits != tuple(limits) else u[:0]
        )
    for tighter in _TIGHTER:
        fine, sd2, worst, name = _refined(job, u, tighter)
        factor = max(1.0, worst)
        slack = check(fine, sd2 / factor).slack
        if slack.min() >= -_KEPT:
            return _trajectory(job, fine, sd2, factor, name)
    at, k = np.unravel_index(int(np.argmin(slack)), slack.shape)
    raise InfeasibleError(
        job.limits[int(k)].name,
        float(fine.s[int(at)]),
        f"it is broken by {-slack.min():.2g} of "
        "its size, and slowing down does not help (rest breaks it, or nearly)",
    )


def _second_order(
    job: _Job,
    speeds: tuple[float, float],
    gridpoints: int | ArrayLike | None,
    gap: float | None,
    also: Array,
) -> Trajectory:
    """The fastest motion on a graded grid, with gridpoints ``also`` (spline parameters)."""
    path, along = job.path, job.track
    measure = Measure.of(along)
    knots = np.asarray(path.basis.knots)
    source = source_of(along, measure, job.limits)
    u = graded_grid(measure, gridpoints)
    edges = np.asarray(source.edges(along, u), dtype=np.float64)
    edges = edges[(edges > 0) & (edges < path.length)]
    wanted = np.concatenate([path.locate(np.append(job.stops, edges)), along.rests, also])
    u, kept = placed(u, wanted, knots)
    ask = Ask(along, job.limits, *speeds, kept[: len(job.stops)], gap)
    jumps = np.concatenate([knots, kept])
    for done in range(_TRIALS):
        try:
            found = fastest(ask, source, u, jumps)
            break
        except Stuck:
            _refuse(job, insert(path, initial_grid(path, gridpoints), job.stops))
            if done == _TRIALS - 1:
                raise InfeasibleError(
                    job.limits[0].name, 0.0, "no profile was found on any grid"
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


def _refuse(job: _Job, u: Array) -> None:
    """Raises InfeasibleError with the limit that forbids every motion on the grid u, and where."""
    _fastest(job, _with_edges(job, u), 0.0)


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
    job = _job(path, limits, robot, None, (0.0, 0.0), "auto", ())
    u = initial_grid(path, gridpoints)
    _require_drivable(job, u)
    fine, sd2, _ = _fastest(job, _with_edges(job, u), 0.0)
    speed = np.sqrt(sd2)
    return float(
        np.sum(2 * np.diff(fine.s) / (speed[1:] + speed[:-1]))
    )  # s'' is constant between gridpoints


def _job(
    path: Path,
    limits: Sequence[Limit],
    robot: Robot | None,
    ground: Ground | None,
    speeds: tuple[float, float],
    engine: str,
    stops: ArrayLike,
    start: tuple[ArrayLike, Mapping[str, float] | None] = ((), None),
) -> _Job:
    """The checked arguments. Raises ArgumentError."""
    if not isinstance(path, Path):
        raise ArgumentError("path", path, "a Path")
    if not isinstance(limits, (list, tuple)) or not limits:
        raise ArgumentError("limits", limits, "a list or tuple of at least one limit")
    for limit in limits:
        if not hasattr(limit, "rows") or isinstance(limit, type):
            raise ArgumentError("limits", limit, "limits, as Speed(1.0)")
    if robot is not None and not isinstance(robot, Robot):
        raise ArgumentError("robot", robot, "a Robot, as robot('car'), or None")
    if ground is not None and not hasattr(ground, "check"):
        raise ArgumentError("ground", ground, "the shape of the ground, as Flat(), or None")
    names = [limit.name for limit in limits]
    if len(set(names)) < len(names):
        raise ArgumentError("limits", names, "limits with different names (pass name=...)")
    for argument, speed in zip(("start_speed", "end_speed"), speeds, strict=True):
        if require_not_negative(argument, speed, "m/s") > _FASTEST:
            raise ArgumentError(argument, speed, f"a path speed from 0 to {_FASTEST:g} m/s")
    require_engine(engine)
    bent = [limit.name for limit in limits if not is_linear(limit)]
    if bent and engine in ("linear", "segments"):
        raise ArgumentError("engine", engine, f"auto: '{bent[0]}' is no limit for one factor")
    along = track(path, robot, ground, start[1])
    path = along.path
    expected = f"path parameters between 0 and {path.length:.6g} m"
    places = np.atleast_1d(as_numbers("stops", stops, expected))
    if places.ndim != 1 or not np.all((places > 0) & (places < path.length)):
        raise ArgumentError("stops", stops, expected)
    if engine == "linear" and (any(speeds) or len(places)):
        raise ArgumentError(
            "start_speed, end_speed, stops",
            (*speeds, *places),
            "0 and none: linear scaling takes the path's own speeds",
        )
    wheels = as_numbers("start_wheels", start[0], "wheel angles, rad")
    squares = speeds[0] ** 2, speeds[1] ** 2
    return _Job(along, tuple(limits), *squares, places, engine, wheels)


def _drives_anywhere(job: _Job) -> bool:
    """Whether the robot's wheels allow every twist of a path of this kind, on level ground."""
    if not (job.track.ground.level and job.path.plain):
        return False
    robot = job.track.robot
    if robot is None:
        return True
    free = robot.drivable
    needed = np.eye(3) if job.path.heading is not None else np.eye(3)[[0, 2]]
    return bool(np.allclose(needed @ free @ free.T, needed, atol=1e-9))


def _require_drivable(job: _Job, u: Array) -> None:
    """Raises InfeasibleError where the path has no direction, or the robot's wheels forbid its
    twist."""
    require_moving(job.path)
    s, along = job.path.parameter(u), job.track
    twist = along.motion(s, u)[0].twist
    if along.robot is None:
        return
    along.robot.require_rolling(twist, s)
    if along.ground.lines:
        before = along.motion(s[1:-1], np.nextafter(u[1:-1], -np.inf))[0].twist
        jump = np.abs((before - twist[1:-1]) * [1.0, 1.0, along.robot.turning_length]).max(axis=1)
        if jump.max() > _JUMP * np.abs(twist).max():
            raise InfeasibleError(
                "ground",
                float(s[1:-1][int(np.argmax(jump))]),
                "the ground's curvature jumps where the path crosses it at an angle, and with it "
                'the wheel speeds: give the ramp smooth edges (edge = "smooth")',
            )


def _stages(job: _Job, fine: FineRows, tighter: float) -> Stages:
    """What the engine solves: rows at the ends of all intervals, stops, and the ceiling of
    "segments"."""
    stages = stages_of(fine)
    ceiling = stages.sd2_max * (1 - tighter)
    if job.engine == "segments":
        ceiling = np.minimum(ceiling, segment_ceiling(job.path, fine))
    if len(job.stops):
        near = np.abs(stages.s[:, None] - job.stops).min(axis=1)
        ceiling = np.where(near <= AT * job.path.length, 0.0, ceiling)
    return replace(stages, sd2_max=ceiling, c=stages.c - tighter if tighter else stages.c)


def _with_edges(job: _Job, u: Array) -> FineRows:
    """Rows on the grid u and on the edges of the limits."""
    fine = fine_rows(job.track, u, job.limits)
    if fine.edges:
        u = insert(job.path, u, np.asarray(fine.edges))
        fine = refined(job.track, fine, u, job.limits)
    return fine


def _fastest(job: _Job, fine: FineRows, tighter: float) -> tuple[FineRows, Array, str]:
    """Rows, s'^2 at the gridpoints, and engine of the fastest profile on a grid."""

    def solve(rows: FineRows) -> tuple[Array, str]:
        stages = _stages(job, rows, tighter)
        name = pick_engine(job.engine, stages)
        profile = ENGINES[name](stages, job.start, job.end)
        require_motion(stages, profile)
        return profile[stages.kept], name

    def reach(rows: FineRows) -> Array:
        stages = _stages(job, rows, tighter)
        return forward_profile(stages, job.start)[stages.kept]

    return settled(job.track, job.limits, fine, solve, reach)


def _refined(job: _Job, u: Array, tighter: float) -> tuple[FineRows, Array, float, str]:
    """Rows, s'^2, the factor on it that is left, and engine, on a grid refined where limits are
    broken."""
    plain, most = _with_edges(job, u), max(MOST_REFINED, 2 * len(u))
    for done in range(MOST_ROUNDS):
        fine, sd2, name = _fastest(job, plain, tighter)
        found = check(fine, sd2)
        excess = np.maximum(found.factor - 1, -found.slack.min(axis=1))
        worst = float(excess.max())
        if worst <= REFINE_ABOVE or (done >= REFINE_ROUNDS and worst <= LARGEST_SLOWDOWN - 1):
            return (
                fine,
                sd2,
                float(found.factor.max()),
                "segments" if job.engine == "segments" else name,
            )
        if done < MOST_ROUNDS - 1:
            grid = split(fine.u, excess > REFINE_ABOVE, 3, most)
            plain = refined(job.track, plain, grid, job.limits)
    at = int(np.argmax(excess))
    limit = job.limits[int(np.argmin(found.slack[at]))].name
    raise InfeasibleError(
        limit,
        float(fine.s[at]),
        "it is broken between gridpoints, however fine the grid: "
        "it jumps here, or falls to zero too fast to be followed",
    )


def _trajectory(job: _Job, fine: FineRows, sd2: Array, factor: float, engine: str) -> Trajectory:
    """The trajectory with s'^2 divided by ``factor``, reported as its slow-down."""
    sd2 = sd2 / factor
    return Trajectory(
        job.path,
        job.limits,
        job.track.robot,
        job.track.ground,
        fine.u,
        fine.s,
        np.sqrt(sd2),
        np.diff(sd2) / (2 * np.diff(fine.s)),
        engine,
        float(np.sqrt(factor)),
        job.start_wheels,
        job.track.start_steering,
    )


def _linear(job: _Job, fine: FineRows) -> Trajectory:
    """One factor on the time of the whole motion ([waheed2006], eqs. 2.34 to 2.39)."""
    if fine.edges:
        u = insert(job.path, fine.u, np.asarray(fine.edges))
        fine = refined(job.track, fine, u, job.limits)
    sd2 = linear_profile(job.path, fine.u)
    found = check(fine, sd2)
    worst = float(found.factor.max())
    if np.isfinite(worst) and worst > 0:
        sd2 = sd2 / worst
        found = check(fine, sd2)
        if found.slack.min() >= -_KEPT:
            return _trajectory(job, fine, sd2, 1.0, "linear")
    at, k = np.unravel_index(int(np.argmin(found.slack)), found.slack.shape)
    raise InfeasibleError(
        job.limits[int(k)].name,
        float(fine.s[int(at)]),
        "no factor on time keeps it: rest breaks it, it is zero here, or nothing bounds the motion",
    )
