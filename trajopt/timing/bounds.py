"""Time-optimal profile when no row holds s'^2: speed bounds and bounds on s'' alone, in closed form.

The backward recursion hi_i = min(cap_i, hi_(i+1) + d_i) unrolls to a running minimum of cap + (sum of d), and the
other two passes likewise, so NumPy does each in one sweep.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from trajopt.errors import ArgumentError
from trajopt.timing.feasibility import allowed_end, empty_set, require_bounded, require_start_speed
from trajopt.timing.stages import SD2_CAP, Stages

Array = NDArray[np.float64]

_FLAT = 1e-13  # a row (divided by its scale) with a smaller coefficient of s'' does not bound it
_TOUCH = 1e-12  # relative; a set thinner than this is a point


def only_bounds(stages: Stages) -> bool:
    """Whether the fast pass is exact: no row holds s'^2, and s'' is bounded on both sides everywhere."""
    if stages.b.any() or not stages.a.shape[1]:
        return False
    return bool(np.all(stages.a.max(axis=1) > _FLAT) and np.all(stages.a.min(axis=1) < -_FLAT)
                and np.all((np.abs(stages.a) > _FLAT) | (stages.c >= 0)))


def bounds_profile(stages: Stages, start: float, end: float) -> Array:
    """(G,) s'^2 of the fastest profile with s'^2 = ``start`` and ``end`` at the ends.

    Raises ArgumentError when ``only_bounds`` does not hold, InfeasibleError naming limit and place.
    """
    if not only_bounds(stages):
        raise ArgumentError("engine", "bounds", "limits that bound s' and s'' alone; use engine='auto'")
    end = allowed_end(stages, end)
    kept = stages.kept
    group = np.cumsum(np.concatenate([[False], np.diff(stages.s) > 0]))
    step = 2 * np.diff(stages.s[kept])
    cap = np.minimum(np.minimum.reduceat(stages.sd2_max, kept), SD2_CAP)
    cap[-1] = end
    lowest, highest = _bounds_on_sdd(stages, kept)
    falls = np.concatenate([[0.0], np.cumsum(-step * lowest)])  # most s'^2 that braking takes away
    rises = np.concatenate([[0.0], np.cumsum(step * highest)])
    high = np.minimum.accumulate((cap + falls)[::-1])[::-1] - falls
    floor = np.zeros_like(cap)
    floor[-1] = end
    low = np.maximum.accumulate((floor - rises)[::-1])[::-1] + rises
    low = np.where(low > end * _TOUCH, low, 0.0)
    touch = _TOUCH * (np.abs(falls).max() + np.abs(rises).max() + 1e-30)
    empty = np.flatnonzero((low > high + touch) | np.append(lowest > highest + _TOUCH, False))
    sets = np.column_stack([np.minimum(low, high), high])[group]
    if len(empty):
        raise empty_set(stages, int(np.flatnonzero(group == empty[-1])[-1]), sets)
    require_start_speed(stages, start, sets)
    require_bounded(stages, sets)
    high[0] = min(max(start, sets[0, 0]), high[0])
    fastest = np.minimum.accumulate(high - rises) + rises
    return np.asarray(np.maximum(np.minimum(fastest, high), sets[kept, 0])[group])


def _bounds_on_sdd(stages: Stages, kept: NDArray[np.intp]) -> tuple[Array, Array]:
    """Lowest and highest s'' of every interval, from the rows of both its ends."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = stages.c / stages.a
    highest = np.min(np.where(stages.a > _FLAT, ratio, np.inf), axis=1)
    lowest = np.max(np.where(stages.a < -_FLAT, ratio, -np.inf), axis=1)
    right = kept[1:]
    left = right - 1
    return np.maximum(lowest[left], lowest[right]), np.minimum(highest[left], highest[right])
