"""Time scaling with s'' constant between gridpoints: what the theses and other software do.

``toppra`` is there to compare with, ``linear`` and ``segments`` are those of [waheed2006]. Between
gridpoints limits are kept on a grid that is refined where they are broken, and what is left is
removed by slowing the whole motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import InfeasibleError
from trajopt.timing.engines import ENGINES, pick_engine
from trajopt.timing.feasibility import require_motion
from trajopt.timing.grid import MOST_REFINED, insert, split
from trajopt.timing.job import Job
from trajopt.timing.linear import linear_profile
from trajopt.timing.rests import AT
from trajopt.timing.segments import segment_ceiling
from trajopt.timing.stages import FineRows, Stages, check, fine_rows, refined, stages_of
from trajopt.timing.trajectory import Trajectory

REFINE_ABOVE = 1e-5  # relative violation between gridpoints that is refined away if it can; chosen
REFINE_ROUNDS = 4  # rounds spent on that; chosen
MOST_ROUNDS = 16  # rounds before giving up on a violation above the largest slow-down; chosen
LARGEST_SLOWDOWN = 1.001  # of time; chosen
_KEPT = 1e-9  # relative violation that counts as none
_TIGHTER = (0.0, 1e-4, 1e-3)  # off all limits, in turn, where slowing down does not help; chosen


def first_order(job: Job, u: Array) -> Trajectory:
    """The motion of the job's engine on the grid u, refined. Raises InfeasibleError."""
    if job.engine == "linear":
        return _linear(job, fine_rows(job.track, u, job.limits))
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


def refuse(job: Job, u: Array) -> None:
    """Raises InfeasibleError with the limit that forbids every motion on the grid u, and where, of
    limits that are not linear as they are at rest."""
    _fastest(job, _with_edges(job, u), 0.0)


def _stages(job: Job, fine: FineRows, tighter: float) -> Stages:
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


def _with_edges(job: Job, u: Array) -> FineRows:
    """Rows on the grid u and on the edges of the limits."""
    fine = fine_rows(job.track, u, job.limits)
    if fine.edges:
        u = insert(job.path, u, np.asarray(fine.edges))
        fine = refined(job.track, fine, u, job.limits)
    return fine


def _fastest(job: Job, fine: FineRows, tighter: float) -> tuple[Array, str]:
    """s'^2 at the gridpoints, and engine of the fastest profile on a grid."""
    stages = _stages(job, fine, tighter)
    name = pick_engine(job.engine, stages)
    profile = ENGINES[name](stages, *job.squares)
    require_motion(stages, profile)
    return profile[stages.kept], name


def _refined(job: Job, u: Array, tighter: float) -> tuple[FineRows, Array, float, str]:
    """Rows, s'^2, the factor on it that is left, and engine, on a grid refined where limits are
    broken."""
    fine, most = _with_edges(job, u), max(MOST_REFINED, 2 * len(u))
    for done in range(MOST_ROUNDS):
        sd2, name = _fastest(job, fine, tighter)
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
            fine = refined(job.track, fine, grid, job.limits)
    at = int(np.argmax(excess))
    limit = job.limits[int(np.argmin(found.slack[at]))].name
    raise InfeasibleError(
        limit,
        float(fine.s[at]),
        "it is broken between gridpoints, however fine the grid: "
        "it jumps here, or falls to zero too fast to be followed",
    )


def _trajectory(job: Job, fine: FineRows, sd2: Array, factor: float, engine: str) -> Trajectory:
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


def _linear(job: Job, fine: FineRows) -> Trajectory:
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
