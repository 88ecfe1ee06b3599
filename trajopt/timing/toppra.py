"""Time-optimal profile by the package ``toppra`` (reachability analysis [pham2018], seidel
solver)."""

from __future__ import annotations

import logging
from types import SimpleNamespace
from typing import Any

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.errors import InfeasibleError
from trajopt.timing.feasibility import allowed_end, empty_set, require_bounded, require_start_speed
from trajopt.timing.stages import SD2_CAP, Stages


def toppra_profile(stages: Stages, start: float, end: float) -> Array:
    """(N+1,) s'^2 of the fastest profile with s'^2 = ``start`` and ``end`` at the ends.

    The rows are handed over already in interpolation form, with the left and right limits of a knot
    kept apart, so toppra's own discretisation switch (which custom constraints ignore silently) is
    not needed. Raises InfeasibleError naming limit and place.
    """
    end = allowed_end(stages, end)
    kept = stages.kept
    grid = stages.s[kept]
    instance = _instance(stages, kept, grid)
    _, speed, _, raw = instance.compute_parameterization(
        np.sqrt(start), np.sqrt(end), return_data=True
    )
    sets = np.asarray(raw, dtype=np.float64)
    bad = np.flatnonzero(np.isnan(sets).any(axis=1))
    if len(bad):
        raise empty_set(stages, int(np.flatnonzero(np.diff(stages.s) > 0)[bad[-1]]), sets)
    require_start_speed(stages, start, sets)
    require_bounded(stages, sets)
    if speed is None or not np.all(np.isfinite(speed)):
        place = float(grid[int(np.argmax(~np.isfinite(speed)))]) if speed is not None else 0.0
        raise InfeasibleError(
            "toppra", place, "its solver failed numerically; use engine='compiled'"
        )
    return np.asarray(speed, dtype=np.float64) ** 2


def _instance(stages: Stages, kept: IndexArray, grid: Array) -> Any:
    """The TOPPRA instance: per interval the rows of its left end and of its right end."""
    from toppra.algorithm import TOPPRA
    from toppra.constraint import LinearConstraint

    logging.getLogger("toppra").setLevel(
        logging.CRITICAL
    )  # what it warns of is raised here, with its reason
    right = kept[1:]  # the left limit at the right end of each interval
    left = right - 1  # the right limit at its left end
    step = np.diff(grid)[:, None]
    a = np.hstack([stages.a[left], stages.a[right] + 2 * step * stages.b[right]])
    b = np.hstack([stages.b[left], stages.b[right]])
    c = np.hstack([stages.c[left], stages.c[right]])
    a, b, c = (np.vstack([m, m[-1:]]) for m in (a, b, c))
    bound = np.minimum(np.minimum.reduceat(stages.sd2_max, kept), SD2_CAP)
    limits = np.column_stack([np.zeros_like(bound), bound])
    rows = (a, b, -c, np.eye(a.shape[1]), np.zeros(a.shape[1])) if a.shape[1] else (None,) * 5

    constraint = LinearConstraint()
    constraint.identical = True
    constraint.compute_constraint_params = lambda *_: (*rows, None, limits)
    path = SimpleNamespace(path_interval=np.array([grid[0], grid[-1]]), dof=1)
    return TOPPRA(
        [constraint],
        path,
        gridpoints=grid,
        solver_wrapper="seidel",
        parametrizer="ParametrizeConstAccel",
    )
