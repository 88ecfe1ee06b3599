"""Which limit makes a time scaling infeasible, and where."""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import InfeasibleError
from trajopt.timing.stages import SD2_CAP, Stages, controllable

_SAME = 1e-9  # relative difference of s'^2 that counts as equal


def allowed_end(stages: Stages, end: float) -> float:
    """``end`` without rounding above the bound on s'^2 at the end of the path.

    Raises InfeasibleError when a limit forbids it.
    """
    allowed = stages.sd2_max[-1]
    if end > allowed * (1 + _SAME):
        bounds = stages.bounds[:, -1]
        # A ceiling below all limits is the one that scaling by segments sets.
        limit = (
            stages.names[int(np.argmin(bounds))]
            if bounds.min() <= allowed * (1 + _SAME)
            else "segments"
        )
        raise InfeasibleError(
            limit,
            float(stages.s[-1]),
            f"the end speed {np.sqrt(end):.6g} m/s exceeds {np.sqrt(allowed):.6g} m/s",
        )
    return float(min(end, allowed))


def empty_set(stages: Stages, failed: int, sets: Array) -> InfeasibleError:
    """The error for a controllable set that is empty at the place ``failed`` where a cell begins, given
    the sets (N+1, 2) of the gridpoints after it."""
    place = float(stages.s[failed])
    low, high = sets[int(np.sum(np.diff(stages.s[: failed + 1]) > 0)) + 1]
    free = (0.0, np.inf)
    alone = not _feasible(stages, failed, free, None)
    after = free if alone else (low, high)
    cures = [name for k, name in enumerate(stages.names) if _feasible(stages, failed, after, k)]
    broken = stages.c[failed : failed + 2].min(axis=0) < 0
    at_rest = {
        stages.names[k] for k in stages.row_owner[broken]
    }  # limits that standing still breaks
    cures.sort(key=lambda name: name not in at_rest)
    limit = cures[0] if cures else _least_slack_at_rest(stages, failed)
    if limit in at_rest:
        reason = (
            "standing still breaks it (slope, friction or centre of gravity), and no speed that the "
            "other limits allow helps"
        )
    elif alone:
        reason = "no speed keeps all limits here"
    else:
        reason = (
            f"no speed here leads into the range {np.sqrt(max(low, 0.0)):.6g} to "
            f"{np.sqrt(high):.6g} m/s that the rest of the path needs"
        )
    others = [name for name in cures[1:] if name != limit]
    return InfeasibleError(
        limit, place, reason + (f"; together with {', '.join(others)}" if others else "")
    )


def require_start_speed(stages: Stages, start: float, sets: Array) -> None:
    """Raises InfeasibleError when the end cannot be reached from s'^2 = ``start``."""
    low, high = sets[0]
    if low - _SAME * high <= start <= high * (1 + _SAME):
        return
    place = float(stages.s[0])
    speeds = f"{np.sqrt(low):.6g} to {np.sqrt(high):.6g} m/s"
    raise InfeasibleError(
        _responsible_for_start(stages, start, sets[-1]),
        place,
        f"the start speed {np.sqrt(start):.6g} m/s is outside {speeds}, from which the end can be reached",
    )


def require_bounded(stages: Stages, sets: Array) -> None:
    """Raises InfeasibleError where no limit bounds the motion."""
    loose = np.flatnonzero(sets[:, 1] >= SD2_CAP * (1 - _SAME))
    if len(loose):
        raise InfeasibleError(
            "none",
            float(stages.s[stages.kept[loose[0]]]),
            "no limit bounds the motion here; add a speed or wheel limit",
        )


def require_motion(stages: Stages, sd2: Array) -> None:
    """Raises InfeasibleError where the profile (N+1,) stands still over an interval."""
    stuck = np.flatnonzero((sd2[:-1] <= 0) & (sd2[1:] <= 0))
    if not len(stuck):
        return
    i = int(np.flatnonzero(np.diff(stages.s) > 0)[stuck[0]])
    free = (0.0, np.inf)
    cures = [name for k, name in enumerate(stages.names) if _top(stages, i, free, k) > 0]
    zero = stages.bounds[:, i : i + 2].min(axis=1) <= 0
    limit = (
        stages.names[int(np.argmax(zero))]
        if zero.any()
        else (cures[0] if cures else stages.names[0])
    )
    raise InfeasibleError(
        limit,
        float(stages.s[i]),
        "the robot must stand still here; end the path at the stop, or split it there",
    )


def _without(
    stages: Stages, which: slice, dropped: int | None
) -> tuple[Array, Array, Array, Array, Array]:
    """s, a, b, c, sd2_max of some gridpoints, without one limit."""
    keep = (
        np.ones(len(stages.row_owner), dtype=bool)
        if dropped is None
        else stages.row_owner != dropped
    )
    others = [k for k in range(len(stages.names)) if k != dropped]
    bound = np.min(stages.bounds[others][:, which], axis=0, initial=np.inf)
    a, b, c = (np.ascontiguousarray(m[which][:, keep]) for m in (stages.a, stages.b, stages.c))
    return np.ascontiguousarray(stages.s[which]), a, b, c, bound


def _top(stages: Stages, i: int, after: tuple[float, float], dropped: int | None) -> float:
    """Highest feasible s'^2 at place i, given the set at i + 1; -1 when there is none."""
    s, a, b, c, bound = _without(stages, slice(i, i + 2), dropped)
    low, high = after[0], min(after[1], bound[1], SD2_CAP)
    if low > high:
        return -1.0
    sets, failed = controllable(s, a, b, c, bound, (low, high))
    return -1.0 if failed >= 0 else float(sets[0, 1])


def _feasible(stages: Stages, i: int, after: tuple[float, float], dropped: int | None) -> bool:
    return _top(stages, i, after, dropped) >= 0


def _least_slack_at_rest(stages: Stages, i: int) -> str:
    if not stages.c.shape[1]:
        return stages.names[int(np.argmin(stages.bounds[:, i]))]
    return stages.names[int(stages.row_owner[int(np.argmin(stages.c[i : i + 2].min(axis=0)))])]


def _responsible_for_start(stages: Stages, start: float, end: Array) -> str:
    """The limit without which the start speed would be possible, or would come nearest."""
    distance = np.full(len(stages.names), np.inf)
    for k in range(len(stages.names)):
        s, a, b, c, bound = _without(stages, slice(None), k)
        sets, failed = controllable(s, a, b, c, bound, (end[0], end[1]))
        if failed < 0:
            distance[k] = max(start - sets[0, 1], sets[0, 0] - start, 0.0)
    return stages.names[int(np.argmin(distance))]
