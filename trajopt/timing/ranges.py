"""What rows a u + b y <= c leave of u and y at a place, or in a cell with constant u, compiled.

For given y the rows with a > 0 bound u from above, those with a < 0 from below. The gap between the
bounds is concave in y, so the ends of {y : gap >= 0} are found by Newton's method from outside,
exactly and in a few steps.
"""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array, BoolArray, IndexArray
from trajopt.kernels import kernel

FLAT = 1e-13  # a row (divided by its scale) with a smaller coefficient of u does not bound u
_TOUCH = 1e-12  # relative gap between bounds that counts as closed


@kernel(nogil=True)
def u_range(a: Array, b: Array, c: Array, j: int, y: float) -> tuple[float, float]:
    """Lowest and highest u that the rows at place j leave at y."""
    low, high = -np.inf, np.inf
    for r in range(a.shape[1]):
        p = a[j, r]
        if p > FLAT:
            high = min(high, (c[j, r] - b[j, r] * y) / p)
        elif p < -FLAT:
            low = max(low, (c[j, r] - b[j, r] * y) / p)
    return low, high


@kernel(nogil=True)
def _pinch(
    a: Array, b: Array, c: Array, j: int, k: int, d: float, low: float, high: float, y: float
) -> tuple[float, float, float, float, float, int, int]:
    """Gap between the bounds on u at y, its slope, the y where the two meet, the bounds that flat rows
    set on y, and the rows that bound u (see ``_row``), of place j alone (d = 0) or of a cell from j to
    k with constant u that ends in [low, high]."""
    rows, up, low_one = a.shape[1], -1, -1
    n_up, p_up, q_up, c_up = np.inf, 1.0, 0.0, 0.0
    n_low, p_low, q_low, c_low = -np.inf, 1.0, 0.0, 0.0
    ends = 1
    if d > 0:
        n_up, p_up, q_up, c_up = high - y, 2 * d, 1.0, high
        n_low, p_low, q_low, c_low = low - y, 2 * d, 1.0, low
        ends = 2
    y_max, y_min = np.inf, -np.inf
    for end in range(ends):
        i = k if end else j
        for r in range(rows):
            q = b[i, r]
            p = a[i, r] + 2 * d * end * q
            n = c[i, r] - q * y
            if p > FLAT:
                if n * p_up < n_up * p:
                    n_up, p_up, q_up, c_up, up = n, p, q, c[i, r], end * rows + r
            elif p < -FLAT:
                if n * p_low < n_low * p:  # n/p > n_low/p_low with p < 0 < p_low
                    n_low, p_low, q_low, c_low, low_one = -n, -p, -q, -c[i, r], end * rows + r
            elif q > FLAT:
                y_max = min(y_max, c[i, r] / q)
            elif q < -FLAT:
                y_min = max(y_min, c[i, r] / q)
            elif c[i, r] < -_TOUCH:
                y_max = -np.inf
    if n_up == np.inf or n_low == -np.inf:
        return np.inf, 0.0, np.nan, y_max, y_min, up, low_one
    upper, lower = n_up / p_up, n_low / p_low
    gap = upper - lower
    if gap < 0 and gap >= -_TOUCH * (abs(upper) + abs(lower)):
        gap = 0.0
    slope = q_low / p_low - q_up / p_up
    # Not y - gap / slope: from far away that leaves no digits where y is small.
    meet = (c_low / p_low - c_up / p_up) / slope if slope != 0 else np.nan
    return gap, slope, meet, y_max, y_min, up, low_one


@kernel(nogil=True)
def end_of_feasible(
    a: Array,
    b: Array,
    c: Array,
    j: int,
    k: int,
    d: float,
    low: float,
    high: float,
    first: float,
    last: float,
) -> tuple[float, int, int]:
    """The feasible y nearest to ``first``, going towards ``last``, and the rows that bound u there: see
    ``_pinch``. NaN when there is none between them."""
    down = first >= last
    y = first
    for _ in range(4 * a.shape[1] + 50):
        gap, slope, step, y_max, y_min, up, lower = _pinch(a, b, c, j, k, d, low, high, y)
        if y_max < y - _TOUCH * abs(y):
            if not down:
                return np.nan, -1, -1
            y = y_max
        elif y_min > y + _TOUCH * abs(y):
            if down:
                return np.nan, -1, -1
            y = y_min
        else:
            if gap >= 0:
                return y, up, lower
            if (slope >= 0) if down else (slope <= 0):
                return np.nan, -1, -1
            if (step >= y) if down else (step <= y):  # rounding alone keeps the gap open
                return y, up, lower
            y = step
        if (y < last) if down else (y > last):
            if abs(y - last) > _TOUCH * max(abs(last), abs(first)):
                return np.nan, -1, -1
            y = last
    return np.nan, -1, -1


@kernel(nogil=True)
def _row(
    a: Array, b: Array, c: Array, j: int, k: int, d: float, end: float, which: int
) -> tuple[float, float, float]:
    """p, q, c of p u + q y <= c: row ``which``, counted over j and k; -1 is the end ``end`` of the
    next set."""
    if which < 0:
        return 2 * d, 1.0, end
    rows = a.shape[1]
    if which < rows:
        return a[j, which], b[j, which], c[j, which]
    r = which - rows
    return a[k, r] + 2 * d * b[k, r], b[k, r], c[k, r]


@kernel(nogil=True)
def meeting(
    a: Array,
    b: Array,
    c: Array,
    j: int,
    k: int,
    d: float,
    low: float,
    high: float,
    up: int,
    lower: int,
    cap: float,
) -> float:
    """The y above which the rows ``up`` and ``lower`` exclude each other, at most ``cap``: those that
    met at the place before mostly meet here too."""
    if up == lower:
        return cap
    p_up, q_up, c_up = _row(a, b, c, j, k, d, high, up)
    p_low, q_low, c_low = _row(a, b, c, j, k, d, low, lower)
    if lower < 0:
        p_low, q_low, c_low = -p_low, -q_low, -c_low
    if p_up > FLAT and p_low < -FLAT:
        fall = q_up / p_up - q_low / p_low
        if fall > 0:
            meet = (c_up / p_up - c_low / p_low) / fall
            if 0 < meet < cap:
                return meet
    return cap


@kernel(nogil=True)
def ceilings(
    places: IndexArray,
    a: Array,
    b: Array,
    c: Array,
    cap: Array,
    top: Array,
    bottom: Array,
    rests: BoolArray,
) -> int:
    """Fills at some places of P top and bottom (P,), the y that the rows there leave, top from at
    most ``cap``, and rests (P,), whether standing still keeps the rows. Returns a place without any
    y, or -1."""
    up = lower = -1
    for j in places:
        rest = True
        for r in range(a.shape[1]):
            rest = rest and c[j, r] >= 0
        rests[j] = rest
        high = meeting(a, b, c, j, j, 0.0, 0.0, 0.0, up, lower, cap[j])
        top[j], one, two = end_of_feasible(a, b, c, j, j, 0.0, 0.0, 0.0, high, 0.0)
        if np.isnan(top[j]):
            return int(j)
        if top[j] < cap[j]:
            up, lower = one, two
        bottom[j] = 0.0
        if not rest:
            bottom[j], _, _ = end_of_feasible(a, b, c, j, j, 0.0, 0.0, 0.0, 0.0, top[j])
        if np.isnan(bottom[j]):
            bottom[j] = top[j]
    return -1
