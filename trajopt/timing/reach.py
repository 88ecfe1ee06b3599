"""The fastest profile of second order, as plain loops that numba compiles.

Cell i of length d goes from place j0 to place j1 (the limit from the right at one gridpoint, from
the left at the next). With y = sigma'^2, rows a u + b y <= c bound u = sigma'' at both places, and
between them u is linear in sigma, so that

    y1 - y0 = d (u0 + u1).

For given y0 each row at j0 bounds u0, and put into the equation each row at j1 bounds y1 (or y0,
backward) by one division: the trapezoidal rule, second order in d. Where it swings (rows whose
coefficient of u runs through zero) a cell takes u constant instead, y1 = y0 + 2 d u, by Newton's
method on concave bounds as in ``kernel``.
"""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array, BoolArray, IndexArray
from trajopt.kernels import kernel

_FLAT = 1e-13  # a row (divided by its scale) with a smaller coefficient of u does not bound u
_TOUCH = 1e-12  # relative gap between bounds that counts as closed


@kernel(nogil=True)
def u_range(a: Array, b: Array, c: Array, j: int, y: float) -> tuple[float, float]:
    """Lowest and highest u that the rows at place j leave at y."""
    low, high = -np.inf, np.inf
    for r in range(a.shape[1]):
        p = a[j, r]
        if p > _FLAT:
            high = min(high, (c[j, r] - b[j, r] * y) / p)
        elif p < -_FLAT:
            low = max(low, (c[j, r] - b[j, r] * y) / p)
    return low, high


@kernel(nogil=True)
def _pinch(
    a: Array, b: Array, c: Array, j: int, k: int, d: float, low: float, high: float, y: float
) -> tuple[float, float, float, float]:
    """Gap between the bounds on u at y and its slope, and the bounds that flat rows set on y, of
    place j alone (d = 0) or of a cell from j to k with constant u that ends in [low, high]."""
    n_up, p_up, q_up = 0.0, 0.0, 0.0
    n_low, p_low, q_low = 0.0, 0.0, 0.0
    ends = 1
    if d > 0:
        n_up, p_up, q_up = high - y, 2 * d, 1.0
        n_low, p_low, q_low = low - y, 2 * d, 1.0
        ends = 2
    y_max, y_min = np.inf, -np.inf
    for end in range(ends):
        i = k if end else j
        for r in range(a.shape[1]):
            q = b[i, r]
            p = a[i, r] + 2 * d * end * q
            n = c[i, r] - q * y
            if p > _FLAT:
                if p_up == 0 or n * p_up < n_up * p:
                    n_up, p_up, q_up = n, p, q
            elif p < -_FLAT:
                if p_low == 0 or n * p_low < n_low * p:  # n/p > n_low/p_low with p < 0 < p_low
                    n_low, p_low, q_low = -n, -p, -q
            elif q > _FLAT:
                y_max = min(y_max, c[i, r] / q)
            elif q < -_FLAT:
                y_min = max(y_min, c[i, r] / q)
            elif c[i, r] < -_TOUCH:
                y_max = -np.inf
    if p_up == 0 or p_low == 0:
        return np.inf, 0.0, y_max, y_min
    upper, lower = n_up / p_up, n_low / p_low
    gap = upper - lower
    if gap < 0 and gap >= -_TOUCH * (abs(upper) + abs(lower)):
        gap = 0.0
    return gap, q_low / p_low - q_up / p_up, y_max, y_min


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
) -> float:
    """The feasible y nearest to ``first``, going towards ``last``: see ``_pinch``. NaN when there is
    none between them."""
    down = first >= last
    y = first
    for _ in range(4 * a.shape[1] + 50):
        gap, slope, y_max, y_min = _pinch(a, b, c, j, k, d, low, high, y)
        if y_max < y - _TOUCH * abs(y):
            if not down:
                return np.nan
            y = y_max
        elif y_min > y + _TOUCH * abs(y):
            if down:
                return np.nan
            y = y_min
        else:
            if gap >= 0:
                return y
            if (slope >= 0) if down else (slope <= 0):
                return np.nan
            step = y - gap / slope
            if step == y:
                return y
            y = step
        if (y < last) if down else (y > last):
            if abs(y - last) > _TOUCH * max(abs(last), abs(first)):
                return np.nan
            y = last
    return np.nan


@kernel(nogil=True)
def _pair(a: Array, b: Array, c: Array, j: int, y: float) -> tuple[int, int]:
    """The rows that bound u from above and below at y."""
    low, high, lower, upper = -np.inf, np.inf, -1, -1
    for r in range(a.shape[1]):
        p = a[j, r]
        if p > _FLAT:
            value = (c[j, r] - b[j, r] * y) / p
            if value < high:
                high, upper = value, r
        elif p < -_FLAT:
            value = (c[j, r] - b[j, r] * y) / p
            if value > low:
                low, lower = value, r
    return lower, upper


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
    lower = upper = -1
    for j in places:
        rest = True
        for r in range(a.shape[1]):
            rest = rest and c[j, r] >= 0
        rests[j] = rest
        high = cap[j]
        if upper >= 0 and lower >= 0:  # the rows that met at the place before mostly meet here too
            p, q = a[j, upper], a[j, lower]
            if p > _FLAT and q < -_FLAT:
                fall = b[j, upper] / p - b[j, lower] / q
                if fall > 0:
                    meet = (c[j, upper] / p - c[j, lower] / q) / fall
                    if 0 < meet < high:
                        high = meet
        top[j] = end_of_feasible(a, b, c, j, j, 0.0, 0.0, 0.0, high, 0.0)
        if np.isnan(top[j]):
            return int(j)
        if top[j] < cap[j]:
            lower, upper = _pair(a, b, c, j, top[j])
        bottom[j] = 0.0 if rest else end_of_feasible(a, b, c, j, j, 0.0, 0.0, 0.0, 0.0, top[j])
        if np.isnan(bottom[j]):
            bottom[j] = top[j]
    return -1


@kernel(nogil=True)
def backward(
    d: Array,
    left: IndexArray,
    right: IndexArray,
    a: Array,
    b: Array,
    c: Array,
    top: Array,
    bottom: Array,
    rests: BoolArray,
    node: Array,
    constant: BoolArray,
    sets: Array,
) -> int:
    """Fills sets (N+1, 2), the y from which sets[-1] can be reached; ``node`` (N+1,) is a bound on
    y at gridpoints. Cells that need it become constant. Returns the gridpoint whose set is empty,
    or -1."""
    for i in range(len(d) - 1, -1, -1):
        j, k, h = left[i], right[i], d[i]
        low, high = sets[i + 1, 0], min(sets[i + 1, 1], top[k])
        low = max(low, bottom[k])
        cap, floor = min(top[j], node[i]), bottom[j]
        eased = low > 0 or floor > 0 or not (rests[j] and rests[k])  # too slow is possible as well
        if low > high:
            if low > high * (1 + 1e-9) + 1e-300:
                return i
            low = high
        if not constant[i]:
            above, below = cap, floor
            least, most = u_range(a, b, c, k, high)
            reach = high - h * least
            free, slowest = np.isinf(least), 0.0
            if eased:
                _, most = u_range(a, b, c, k, low)
                slowest = low - h * most
            for r in range(a.shape[1]):
                p = a[j, r]
                if p < -_FLAT and not free:
                    q = h * b[j, r] - p
                    n = h * c[j, r] - reach * p
                    if q > 0:
                        above = min(above, n / q)
                    elif n < 0:
                        above = -1.0
                elif p > _FLAT and eased and most < np.inf:
                    q = p - h * b[j, r]
                    n = slowest * p - h * c[j, r]
                    if q > 0:
                        below = max(below, n / q)
                    elif n > 0:
                        above = -1.0
            if above < below and above >= below * (1 - 1e-12):
                above = below
            if above >= below and above >= 0:
                sets[i, 0], sets[i, 1] = below, above
                continue
            constant[i] = True
        above = end_of_feasible(a, b, c, j, k, h, low, high, cap, floor)
        if np.isnan(above):
            return i
        below = floor
        if eased:
            below = end_of_feasible(a, b, c, j, k, h, low, high, floor, above)
            if np.isnan(below):
                below = above
        sets[i, 0], sets[i, 1] = below, above
    return -1


@kernel(nogil=True)
def forward(
    d: Array,
    left: IndexArray,
    right: IndexArray,
    middle: IndexArray,
    a: Array,
    b: Array,
    c: Array,
    top: Array,
    constant: BoolArray,
    sets: Array,
    start: float,
    y: Array,
    u0: Array,
    u1: Array,
) -> None:
    """Fills y (N+1,), u0 and u1 (N,): the greedy profile inside the sets."""
    y[0] = start
    for i in range(len(d)):
        j, k, h = left[i], right[i], d[i]
        now, high = y[i], min(sets[i + 1, 1], top[k])
        if constant[i]:
            n_up, p_up = high - now, 2 * h
            for r in range(a.shape[1]):
                n, p = c[j, r] - b[j, r] * now, a[j, r]
                if p > _FLAT and n * p_up < n_up * p:
                    n_up, p_up = n, p
                n, p = c[k, r] - b[k, r] * now, a[k, r] + 2 * h * b[k, r]
                if p > _FLAT and n * p_up < n_up * p:
                    n_up, p_up = n, p
            y[i + 1] = min(max(now + 2 * h * (n_up / p_up), sets[i + 1, 0]), high)
            u0[i] = u1[i] = (y[i + 1] - now) / (2 * h)
            continue
        least, most = u_range(a, b, c, j, now)
        then = high
        if most < np.inf:
            reach = now + h * most
            for r in range(a.shape[1]):
                p = a[k, r]
                if p > _FLAT:
                    q = p + h * b[k, r]
                    if q > 0:
                        then = min(then, (reach * p + h * c[k, r]) / q)
        then = max(then, sets[i + 1, 0])
        y[i + 1] = then
        mean = (then - now) / (2 * h)
        lower, upper = u_range(a, b, c, k, then)
        lowest, highest = max(least, 2 * mean - upper), min(most, 2 * mean - lower)
        cap = 2 * (top[middle[i]] - now) / h - mean
        first = min(max(mean, lowest), max(min(highest, cap), lowest))
        if lowest > highest:
            first = (lowest + highest) / 2
        u0[i], u1[i] = first, 2 * mean - first


@kernel(nogil=True)
def excess(
    d: Array,
    left: IndexArray,
    right: IndexArray,
    a: Array,
    b: Array,
    c: Array,
    cap: Array,
    y: Array,
    u0: Array,
    u1: Array,
    over: Array,
    factor: Array,
) -> None:
    """Fills over (N,), the share of a row's scale (or of the bound ``cap`` on y) by which each cell
    breaks it at its ends and quarters, and factor (N,), what y would have to be divided by."""
    for i in range(len(d)):
        worst, most = 0.0, 1.0
        for k in range(5):
            j = right[i] if k == 4 else left[i] + k
            u = u0[i] + k / 4 * (u1[i] - u0[i])
            here = max(y[i] + k / 4 * d[i] * (u0[i] + u), 0.0)
            if here > cap[j]:
                ratio = here / cap[j] if cap[j] > 0 else np.inf
                worst, most = max(worst, ratio - 1), max(most, ratio)
            for r in range(a.shape[1]):
                used = a[j, r] * u + b[j, r] * here
                if used > c[j, r]:
                    worst = max(worst, used - c[j, r])
                    if c[j, r] > 0:
                        most = max(most, used / c[j, r])
        over[i], factor[i] = worst, most


@kernel(nogil=True)
def cell_time(h: float, y0: float, y1: float, u0: float, u1: float) -> float:
    """Seconds that a cell takes whose u is linear: tanh(r T / 2) / r = h / (w0 + w1) with r^2 the
    slope of u."""
    w = np.sqrt(max(y0, 0.0)) + np.sqrt(max(y1, 0.0))
    slope = (u1 - u0) / h
    if w <= 0:
        return np.pi / np.sqrt(-slope) if slope < 0 else np.inf
    q = h / w
    z = slope * q * q
    if abs(z) < 1e-3:
        return float(2 * q * (1 + z * (1 / 3 + z * (1 / 5 + z * (1 / 7 + z / 9)))))
    if z > 0:
        return float(2 * q * np.arctanh(min(np.sqrt(z), 1.0)) / np.sqrt(z))
    return float(2 * q * np.arctan(np.sqrt(-z)) / np.sqrt(-z))


@kernel(nogil=True)
def cell_times(d: Array, y: Array, u0: Array, u1: Array) -> Array:
    """(N,): seconds of each cell."""
    found = np.empty(len(d))
    for i in range(len(d)):
        found[i] = cell_time(d[i], y[i], y[i + 1], u0[i], u1[i])
    return found


@kernel(nogil=True)
def moments(
    d: Array, y: Array, u0: Array, u1: Array, cells: IndexArray, times: Array
) -> tuple[Array, Array, Array]:
    """Sigma gained, sigma' and sigma'' at times (M,) after cells (M,) were entered."""
    gained, speed, pull = np.empty(len(times)), np.empty(len(times)), np.empty(len(times))
    for n in range(len(times)):
        i, after = cells[n], max(times[n], 0.0)
        slope = (u1[i] - u0[i]) / d[i]
        z, w = slope * after * after, np.sqrt(max(y[i], 0.0))
        if abs(z) < 1e-2:
            sine = after * (1 + z / 6 * (1 + z / 20 * (1 + z / 42 * (1 + z / 72))))
            half = after * after / 2 * (1 + z / 12 * (1 + z / 30 * (1 + z / 56 * (1 + z / 90))))
            cosine = 1 + slope * half
        else:
            r = np.sqrt(abs(slope))
            if z > 0:
                sine, cosine = np.sinh(r * after) / r, np.cosh(r * after)
            else:
                sine, cosine = np.sin(r * after) / r, np.cos(r * after)
            half = (cosine - 1) / slope
        gained[n] = min(max(w * sine + u0[i] * half, 0.0), d[i])
        speed[n] = max(w * cosine + u0[i] * sine, 0.0)
        pull[n] = u0[i] + slope * gained[n]
    return gained, speed, pull
