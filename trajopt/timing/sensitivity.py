"""What each limit costs: the time a slightly looser limit would save."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from trajopt.arrays import Array, BoolArray, require_between, require_choice
from trajopt.errors import ArgumentError
from trajopt.timing.compiled import compiled_profile
from trajopt.timing.engines import ENGINES
from trajopt.timing.stages import Stages
from trajopt.timing.steps import stages_of, steps
from trajopt.timing.trajectory import Trajectory


def sensitivities(trajectory: Trajectory, change: float = 0.01) -> Mapping[str, float]:
    """Seconds saved when one limit at a time grows by ``change`` of its size (1 % by default), by
    name.

    Speeds grow by that share, rows by that share of their scale (a wheel acceleration limit, mu g,
    ...); rows of limits that are not linear are those at the trajectory. Solved again on the trajectory's own grid, so differences are free of the grid's error.
    Raises ArgumentError for a trajectory that is not time-optimal (linear, segments), or a change
    that is not > 0.
    """
    require_between("change", change, 0, 10, "(a share, as 0.01 for one percent)")
    if not isinstance(trajectory, Trajectory):
        raise ArgumentError("trajectory", trajectory, "a Trajectory, as time_scale gives it")
    require_choice("trajectory.engine", trajectory.engine, ENGINES)
    cells = steps(trajectory.track, trajectory.u, trajectory.limits, trajectory.sd**2)
    stages = stages_of(cells)
    stopped = np.repeat(trajectory.sd <= 0, 2)[1:-1]
    stopped[[0, -1]] = False
    ends = (trajectory.sd[[0, -1]] * trajectory.slowdown) ** 2
    base = _duration(stages, stopped, ends)
    saved = {}
    for k, limit in enumerate(trajectory.limits):
        c, bounds = stages.c.copy(), stages.bounds.copy()
        c[:, stages.row_owner == k] += change
        bounds[k] *= (1 + change) ** 2
        looser = replace(stages, c=c, bounds=bounds, sd2_max=bounds.min(axis=0))
        saved[limit.name] = base - _duration(looser, stopped, ends)
    return MappingProxyType(saved)


def _duration(stages: Stages, stopped: BoolArray, ends: Array) -> float:
    stages = replace(stages, sd2_max=np.where(stopped, 0.0, stages.sd2_max))
    # A start speed on its limit is above it by rounding; the engine allows for that.
    sd = np.sqrt(compiled_profile(stages, float(ends[0]), float(ends[1])))
    return float(np.sum(2 * np.diff(stages.s[stages.kept]) / (sd[:-1] + sd[1:])))
