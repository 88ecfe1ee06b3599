"""Reachability analysis of TOPP-RA as plain loops, compiled by numba where it is installed.

With x = s'^2 and u = s'', interval i of length d obeys the rows of its left end, a0 u + b0 x <= c0, and of
its right end, where x has grown to x + 2 d u: (a1 + 2 d b1) u + b1 x <= c1. For given x the rows with a
positive coefficient of u bound u from above, those with a negative one from below. gap(x) = lowest upper
bound - highest lower bound is concave in x, so the ends of the interval {x : gap(x) >= 0} are found by
Newton's method from outside, exactly and in a few steps (each tangent is a pair of rows).

Import this module where it is first used: numba takes a second to load. Without numba the same functions run
interpreted: right, but slow.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from trajopt.timing.stages import SD2_CAP

Array = NDArray[np.float64]
P = ParamSpec("P")
R = TypeVar("R")

_FLAT = 1e-13  # a row (divided by its scale) with a smaller coefficient of u does not bound u
_TOUCH = 1e-12  # relative gap between bounds that counts as closed


def _compiled(function: Callable[P, R]) -> Callable[P, R]:
    try:
        from numba import njit
    except ImportError:
        return function
    compiled: Callable[P, R] = njit(cache=True, error_model="numpy")(function)
    return compiled


@_compiled
def _bounds_on_u(a: Array, b: Array, c: Array, i: int, d: float, low: float, high: float,
                 x: float) -> tuple[float, float, float, float, float, float]:
    """Upper and lower bound on u at x in interval i, their slopes, and the bounds that flat rows set on x."""
    upper, upper_slope = (high - x) / (2 * d), -1 / (2 * d)
    lower, lower_slope = (low - x) / (2 * d), -1 / (2 * d)
    x_max, x_min = np.inf, -np.inf
    for end in range(2):
        j = i + end
        for r in range(a.shape[1]):
            q = b[j, r]
            p = a[j, r] + (2 * d * q if end == 1 else 0.0)
            if p > _FLAT:
                value = (c[j, r] - q * x) / p
                if value < upper:
                    upper, upper_slope = value, -q / p
            elif p < -_FLAT:
                value = (c[j, r] - q * x) / p
                if value > lower:
                    lower, lower_slope = value, -q / p
            elif q > _FLAT:
                x_max = min(x_max, c[j, r] / q)
            elif q < -_FLAT:
                x_min = max(x_min, c[j, r] / q)
            elif c[j, r] < -_TOUCH:
                x_max = -np.inf
    return upper, upper_slope, lower, lower_slope, x_max, x_min


@_compiled
def _end_of_feasible(a: Array, b: Array, c: Array, i: int, d: float, low: float, high: float,
                     x_first: float, x_last: float) -> float:
    """The feasible x nearest to x_first, going towards x_last; NaN when there is none between them."""
    down = x_first >= x_last
    x = x_first
    for _ in range(4 * a.shape[1] + 50):
        upper, upper_slope, lower, lower_slope, x_max, x_min = _bounds_on_u(a, b, c, i, d, low, high, x)
        if x_max < x - _TOUCH * abs(x):
            if not down:
                return np.nan
            x = x_max
        elif x_min > x + _TOUCH * abs(x):
            if down:
                return np.nan
            x = x_min
        else:
            gap, slope = upper - lower, upper_slope - lower_slope
            if gap >= -_TOUCH * (abs(upper) + abs(lower)):
                return x
            if (slope >= 0) if down else (slope <= 0):
                return np.nan
            step = x - gap / slope
            if step == x:
                return x
            x = step
        if (x < x_last) if down else (x > x_last):
            if abs(x - x_last) > _TOUCH * max(abs(x_last), abs(x_first)):
                return np.nan
            x = x_last
    return np.nan


@_compiled
def controllable(s: Array, a: Array, b: Array, c: Array, sd2_max: Array, sets: Array) -> int:
    """Backward pass: fills sets (G, 2), the s'^2 from which sets[-1] can be reached.

    Returns the gridpoint whose set is empty, or -1 when none is.
    """
    for i in range(len(s) - 2, -1, -1):
        d = s[i + 1] - s[i]
        low, high = sets[i + 1, 0], sets[i + 1, 1]
        x_cap = min(sd2_max[i], SD2_CAP)
        if d <= 0:  # the two limits at a knot
            sets[i, 0], sets[i, 1] = low, min(high, x_cap)
            if sets[i, 0] > sets[i, 1]:
                return i
            continue
        top = _end_of_feasible(a, b, c, i, d, low, high, x_cap, 0.0)
        if np.isnan(top):
            return i
        bottom = _end_of_feasible(a, b, c, i, d, low, high, 0.0, top)
        sets[i, 0], sets[i, 1] = (top if np.isnan(bottom) else bottom), top
    return -1


@_compiled
def fastest(s: Array, a: Array, b: Array, c: Array, sets: Array, start: float, sd2: Array) -> None:
    """Forward pass: fills sd2 (G,), the greedy (and optimal) profile inside the controllable sets."""
    sd2[0] = start
    for i in range(len(s) - 1):
        d = s[i + 1] - s[i]
        x = sd2[i]
        if d > 0:
            upper, _, _, _, _, _ = _bounds_on_u(a, b, c, i, d, sets[i + 1, 0], sets[i + 1, 1], x)
            x = x + 2 * d * upper
        sd2[i + 1] = min(max(x, sets[i + 1, 0]), sets[i + 1, 1])
