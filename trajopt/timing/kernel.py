"""Reachability analysis of TOPP-RA as plain loops, compiled by numba where it is installed.

With x = s'^2 and u = s'', interval i of length d obeys the rows of its left end, a0 u + b0 x <= c0,
and of its right end, where x has grown to x + 2 d u: (a1 + 2 d b1) u + b1 x <= c1. For given x the
rows with a positive coefficient of u bound u from above, those with a negative one from below.
gap(x) = lowest upper bound - highest lower bound is concave in x, so the ends of the interval {x :
gap(x) >= 0} are found by Newton's method from outside, exactly and in a few steps (each tangent is
a pair of rows).

Import this module where it is first used, as all kernels.
"""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.kernels import kernel
from trajopt.timing.stages import SD2_CAP

_FLAT = 1e-13  # a row (divided by its scale) with a smaller coefficient of u does not bound u
_TOUCH = 1e-12  # relative gap between bounds that counts as closed


@kernel(nogil=True)
def _bounds_on_u(
    a: Array, b: Array, c: Array, i: int, d: float, low: float, high: float, x: float
) -> tuple[float, float, float, float, float, float, int, int]:
    """Upper and lower bound on u at x in interval i, their slopes, the bounds that flat rows set on
    x, and which rows set the bounds on u (see _row).

    Bounds are kept as fractions and compared crosswise: a division a row would take most of the
    time.
    """
    rows = a.shape[1]
    n_up, p_up, q_up, up = high - x, 2 * d, 1.0, -1
    n_low, p_low, q_low, lower = low - x, 2 * d, 1.0, -1
    x_max, x_min = np.inf, -np.inf
    for end in range(2):
        j = i + end
        grow = 2 * d * end
        for r in range(rows):
            q = b[j, r]
            p = a[j, r] + grow * q
            n = c[j, r] - q * x
            if p > _FLAT:
                if n * p_up < n_up * p:
                    n_up, p_up, q_up, up = n, p, q, end * rows + r
            elif p < -_FLAT:
                if n * p_low < n_low * p:  # n/p > n_low/p_low with p < 0 < p_low
                    n_low, p_low, q_low, lower = -n, -p, -q, end * rows + r
            elif q > _FLAT:
                x_max = min(x_max, c[j, r] / q)
            elif q < -_FLAT:
                x_min = max(x_min, c[j, r] / q)
            elif c[j, r] < -_TOUCH:
                x_max = -np.inf
    return n_up / p_up, -q_up / p_up, n_low / p_low, -q_low / p_low, x_max, x_min, up, lower


@kernel(nogil=True)
def _row(
    a: Array,
    b: Array,
    c: Array,
    i: int,
    d: float,
    low: float,
    high: float,
    which: int,
    is_upper: bool,
) -> tuple[float, float, float]:
    """p, q, c of p u + q x <= c: row ``which`` of interval i, counted over both ends; -1 is the
    next set."""
    if which < 0:
        return (2 * d, 1.0, high) if is_upper else (-2 * d, -1.0, -low)
    rows = a.shape[1]
    j, r = (i, which) if which < rows else (i + 1, which - rows)
    grow = 0.0 if which < rows else 2 * d
    return a[j, r] + grow * b[j, r], b[j, r], c[j, r]


@kernel(nogil=True)
def _crossing(
    a: Array,
    b: Array,
    c: Array,
    i: int,
    d: float,
    low: float,
    high: float,
    up: int,
    lower: int,
    x_cap: float,
) -> float:
    """The x above which the rows ``up`` and ``lower`` exclude each other, at most x_cap."""
    p_up, q_up, c_up = _row(a, b, c, i, d, low, high, up, True)
    p_low, q_low, c_low = _row(a, b, c, i, d, low, high, lower, False)
    if p_up > _FLAT and p_low < -_FLAT:
        fall = q_up / p_up - q_low / p_low
        if fall > 0:
            x = (c_up / p_up - c_low / p_low) / fall
            if 0 < x < x_cap:
                return x
    return x_cap


@kernel(nogil=True)
def _end_of_feasible(
    a: Array,
    b: Array,
    c: Array,
    i: int,
    d: float,
    low: float,
    high: float,
    x_first: float,
    x_last: float,
) -> tuple[float, int, int]:
    """The feasible x nearest to x_first, going towards x_last, and the rows that bound u there.

    NaN when there is none between them.
    """
    down = x_first >= x_last
    x = x_first
    for _ in range(4 * a.shape[1] + 50):
        upper, upper_slope, lower, lower_slope, x_max, x_min, r_up, r_low = _bounds_on_u(
            a, b, c, i, d, low, high, x
        )
        if x_max < x - _TOUCH * abs(x):
            if not down:
                return np.nan, -1, -1
            x = x_max
        elif x_min > x + _TOUCH * abs(x):
            if down:
                return np.nan, -1, -1
            x = x_min
        else:
            gap, slope = upper - lower, upper_slope - lower_slope
            if gap >= -_TOUCH * (abs(upper) + abs(lower)):
                return x, r_up, r_low
            if (slope >= 0) if down else (slope <= 0):
                return np.nan, -1, -1
            step = x - gap / slope
            if step == x:
                return x, r_up, r_low
            x = step
        if (x < x_last) if down else (x > x_last):
            if abs(x - x_last) > _TOUCH * max(abs(x_last), abs(x_first)):
                return np.nan, -1, -1
            x = x_last
    return np.nan, -1, -1


@kernel(nogil=True)
def controllable(s: Array, a: Array, b: Array, c: Array, sd2_max: Array, sets: Array) -> int:
    """Backward pass: fills sets (G, 2), the s'^2 from which sets[-1] can be reached.

    Returns the gridpoint whose set is empty, or -1 when none is. The rows that met at one gridpoint
    mostly meet at the one before as well, and where they cross is a bound to start Newton's method
    from.
    """
    up, lower = -1, -1
    rest_after = False
    for i in range(len(s) - 1, -1, -1):
        rest = True  # whether standing still keeps all rows here
        for r in range(a.shape[1]):
            rest = rest and c[i, r] >= 0
        both, rest_after = rest and rest_after, rest
        if i == len(s) - 1:
            continue
        d = s[i + 1] - s[i]
        low, high = sets[i + 1, 0], sets[i + 1, 1]
        x_cap = min(sd2_max[i], SD2_CAP)
        if d <= 0:  # two intervals meet
            sets[i, 0], sets[i, 1] = low, min(high, x_cap)
            if sets[i, 0] > sets[i, 1]:
                return i
            continue
        first = _crossing(a, b, c, i, d, low, high, up, lower, x_cap)
        top, up, lower = _end_of_feasible(a, b, c, i, d, low, high, first, 0.0)
        if np.isnan(top):
            return i
        bottom = 0.0
        if low > 0 or not both:
            bottom, _, _ = _end_of_feasible(a, b, c, i, d, low, high, 0.0, top)
        sets[i, 0], sets[i, 1] = (top if np.isnan(bottom) else bottom), top
    return -1


@kernel(nogil=True)
def fastest(s: Array, a: Array, b: Array, c: Array, sets: Array, start: float, sd2: Array) -> None:
    """Forward pass: fills sd2 (G,), the greedy (and optimal) profile inside the controllable
    sets."""
    sd2[0] = start
    for i in range(len(s) - 1):
        x = sd2[i]
        grow = 2 * (s[i + 1] - s[i])
        if grow > 0:
            n_up, p_up = sets[i + 1, 1] - x, grow
            for r in range(a.shape[1]):
                n, p = c[i, r] - b[i, r] * x, a[i, r]
                if p > _FLAT and n * p_up < n_up * p:
                    n_up, p_up = n, p
                n, p = c[i + 1, r] - b[i + 1, r] * x, a[i + 1, r] + grow * b[i + 1, r]
                if p > _FLAT and n * p_up < n_up * p:
                    n_up, p_up = n, p
            x = x + grow * (n_up / p_up)
        sd2[i + 1] = min(max(x, sets[i + 1, 0]), sets[i + 1, 1])


@kernel(nogil=True)
def bounds_of_intervals(s: Array, a: Array, c: Array, lowest: Array, highest: Array) -> bool:
    """Fills lowest and highest (G-1,), the bounds on u in each interval, from rows a u <= c without
    x.

    False when u is not bounded on both sides everywhere, or a flat row is broken: then this pass is
    no use.
    """
    low_before, high_before = -np.inf, np.inf
    for i in range(len(s)):
        low, high = -np.inf, np.inf
        for r in range(a.shape[1]):
            if a[i, r] > _FLAT:
                high = min(high, c[i, r] / a[i, r])
            elif a[i, r] < -_FLAT:
                low = max(low, c[i, r] / a[i, r])
            elif c[i, r] < 0:
                return False
        if np.isinf(low) or np.isinf(high):
            return False
        if i > 0:
            lowest[i - 1], highest[i - 1] = max(low_before, low), min(high_before, high)
        low_before, high_before = low, high
    return True


@kernel(nogil=True)
def controllable_in_bounds(
    s: Array, lowest: Array, highest: Array, sd2_max: Array, sets: Array
) -> int:
    """Backward pass of ``controllable`` where u has bounds of its own: two lines a gridpoint."""
    for i in range(len(s) - 2, -1, -1):
        grow = 2 * (s[i + 1] - s[i])
        low, high = sets[i + 1, 0], min(sets[i + 1, 1], min(sd2_max[i], SD2_CAP))
        if grow > 0:
            if lowest[i] > highest[i]:
                return i
            high = min(sets[i + 1, 1] - grow * lowest[i], min(sd2_max[i], SD2_CAP))
            low = max(low - grow * highest[i], 0.0)
        if low > high:
            if low > high + _TOUCH * abs(low):
                return i
            low = high
        sets[i, 0], sets[i, 1] = low, high
    return -1


@kernel(nogil=True)
def fastest_in_bounds(s: Array, highest: Array, sets: Array, start: float, sd2: Array) -> None:
    """Forward pass of ``fastest`` where u has bounds of its own."""
    sd2[0] = start
    for i in range(len(s) - 1):
        grow = 2 * (s[i + 1] - s[i])
        x = sd2[i] + (grow * highest[i] if grow > 0 else 0.0)
        sd2[i + 1] = min(max(x, sets[i + 1, 0]), sets[i + 1, 1])


@kernel(nogil=True)
def fastest_of_many(
    s: Array,
    a: Array,
    b: Array,
    c: Array,
    sd2_max: Array,
    start: Array,
    end: Array,
    sd2: Array,
    failed: IndexArray,
) -> None:
    """Both passes for P paths: s, sd2_max, sd2 (P, G), a, b, c (P, G, R), start, end, failed (P,).

    ``failed`` gets the gridpoint whose set is empty (0 also when the start speed is not in it), or
    -1; the profile of such a path is NaN.
    """
    sets = np.empty((s.shape[1], 2))
    for p in range(s.shape[0]):
        sets[-1, 0] = end[p]
        sets[-1, 1] = end[p]
        failed[p] = len(sets) - 1 if end[p] > sd2_max[p, -1] * (1 + _TOUCH) else -1
        if failed[p] < 0:
            failed[p] = controllable(s[p], a[p], b[p], c[p], sd2_max[p], sets)
        slack = 1e-9 * sets[0, 1]
        if failed[p] < 0 and not sets[0, 0] - slack <= start[p] <= sets[0, 1] + slack:
            failed[p] = 0
        if failed[p] < 0:
            fastest(
                s[p], a[p], b[p], c[p], sets, min(max(start[p], sets[0, 0]), sets[0, 1]), sd2[p]
            )
        else:
            sd2[p] = np.nan
