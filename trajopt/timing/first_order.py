"""Time scaling with s'' constant between gridpoints: what the theses and other software do.

``toppra`` is there to compare with, ``linear`` and ``segments`` are those of [waheed2006]. Between
gridpoints limits are kept at quarters of cells, which are split where they are broken, and what is
left is removed by slowing the whole motion.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import InfeasibleError
from trajopt.timing.cells import Cells, Measure
from trajopt.timing.compiled import compiled_profile
from trajopt.timing.curved import source_of
from trajopt.timing.engines import ENGINES
from trajopt.timing.feasibility import require_motion
from trajopt.timing.grid import MOST_REFINED, insert, split
from trajopt.timing.job import Job
from trajopt.timing.profile import excess, margins
from trajopt.timing.rests import AT
from trajopt.timing.segments import segment_ceiling
from trajopt.timing.stages import Stages
from trajopt.timing.steps import pulls, stages_of, steps, used
from trajopt.timing.trajectory import Trajectory

REFINE_ABOVE = 1e-5  # relative violation between gridpoints that is refined away if it can; chosen
REFINE_ROUNDS = 4  # rounds spent on that; chosen
MOST_ROUNDS = 16  # rounds before giving up on a violation above the largest slow-down; chosen
LARGEST_SLOWDOWN = 1.001  # of time; chosen
_ROUNDS = 5  # of slowing a linear motion until it keeps all limits; chosen: two are usual
_KEPT = 1e-9  # relative violation that counts as none
_TIGHTER = (0.0, 1e-4, 1e-3)  # off all limits, in turn, where slowing down does not help; chosen


def first_order(job: Job, u: Array) -> Trajectory:
    """The motion of the job's engine on the grid u, refined. Raises InfeasibleError."""
    u = _with_edges(job, u)
    if job.engine == "linear":
        cells, sd2 = steps(job.track, u, job.limits), job.path.rate(u) ** 2
        worst = float(used(cells, sd2).max())
        for _ in range(_ROUNDS):  # the first between places, then where parabolas through them peak
            sd2 = sd2 / (worst if np.isfinite(worst) and worst > 0 else 1.0)
            worst = float(excess(cells, sd2, *pulls(cells, sd2))[1].max())
        reason = "no factor on time keeps it: rest breaks it, it is zero here, or nothing bounds the motion"
        return _kept(job, cells, sd2, 1.0, reason)
    for tighter in _TIGHTER:
        cells, sd2, factor = _refined(job, u, tighter)
        try:
            return _kept(
                job,
                cells,
                sd2 / factor,
                factor,
                "slowing down does not keep it (rest breaks it, or nearly)",
            )
        except InfeasibleError:
            if tighter == _TIGHTER[-1]:
                raise
    raise AssertionError


def refuse(job: Job, u: Array) -> None:
    """Raises InfeasibleError with the limit that forbids every motion on the grid u, and where, of
    limits that are not linear as they are at rest."""
    _fastest(job, steps(job.track, _with_edges(job, u), job.limits), 0.0)


def _with_edges(job: Job, u: Array) -> Array:
    """The grid with the edges of the limits."""
    edges = source_of(job.track, Measure.of(job.track), job.limits).edges(job.track, u)
    return insert(job.path, u, np.asarray(edges)) if edges else u


def _stages(job: Job, cells: Cells, tighter: float) -> Stages:
    """What the engine solves: rows at the ends of all intervals, stops, and the ceiling of
    "segments"."""
    stages = stages_of(cells)
    ceiling = stages.sd2_max * (1 - tighter)
    if job.engine == "segments":
        ceiling = np.minimum(ceiling, segment_ceiling(cells))
    if len(job.stops):
        near = np.abs(stages.s[:, None] - job.stops).min(axis=1)
        ceiling = np.where(near <= AT * job.path.length, 0.0, ceiling)
    return replace(stages, sd2_max=ceiling, c=stages.c - tighter if tighter else stages.c)


def _fastest(job: Job, cells: Cells, tighter: float) -> Array:
    """s'^2 at the gridpoints of the fastest profile on a grid."""
    stages = _stages(job, cells, tighter)
    profile = ENGINES.get(job.engine, compiled_profile)(stages, *job.squares)
    require_motion(stages, profile)
    return profile


def _refined(job: Job, u: Array, tighter: float) -> tuple[Cells, Array, float]:
    """Rows, s'^2 and the factor on it that is left, on a grid refined where limits are broken."""
    most = max(MOST_REFINED, 2 * len(u))
    for done in range(MOST_ROUNDS):
        cells = steps(job.track, u, job.limits)
        sd2 = _fastest(job, cells, tighter)
        over, factor = excess(cells, sd2, *pulls(cells, sd2))
        worst = float(over.max())
        if worst <= REFINE_ABOVE or (done >= REFINE_ROUNDS and worst <= LARGEST_SLOWDOWN - 1):
            return cells, sd2, float(factor.max())
        u = split(u, over > REFINE_ABOVE, 3, most)
    limit, place = _worst(job, cells, sd2)[1:]
    raise InfeasibleError(
        limit,
        place,
        "it is broken between gridpoints, however fine the grid: "
        "it jumps here, or falls to zero too fast to be followed",
    )


def _worst(job: Job, cells: Cells, sd2: Array) -> tuple[float, str, float]:
    """The least margin, of which limit, and where (m)."""
    slack = margins(cells, sd2, *pulls(cells, sd2))
    at, k = np.unravel_index(int(np.argmin(slack)), slack.shape)
    return float(slack.min()), job.limits[int(k)].name, cells.s(int(cells.left[at]))


def _kept(job: Job, cells: Cells, sd2: Array, factor: float, otherwise: str) -> Trajectory:
    """The trajectory with s'^2, slowed by ``factor`` on it. Raises InfeasibleError where it breaks a
    limit."""
    least, limit, place = _worst(job, cells, sd2)
    if least < -_KEPT:
        raise InfeasibleError(
            limit, place, f"it is broken by {-least:.2g} of its size: {otherwise}"
        )
    return Trajectory(
        job.path,
        job.limits,
        job.track.robot,
        job.track.ground,
        cells.u,
        job.path.parameter(cells.u),
        np.sqrt(sd2),
        pulls(cells, sd2)[0],
        job.engine,
        float(np.sqrt(factor)),
        job.start_wheels,
        job.track.start_steering,
    )
