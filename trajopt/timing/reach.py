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
from trajopt.timing.ranges import FLAT, end_of_feasible, u_range


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
                if p < -FLAT and not free:
                    q = h * b[j, r] - p
                    n = h * c[j, r] - reach * p
                    if q > 0:
                        above = min(above, n / q)
                    elif n < 0:
                        above = -1.0
                elif p > FLAT and eased and most < np.inf:
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
                if p > FLAT and n * p_up < n_up * p:
                    n_up, p_up = n, p
                n, p = c[k, r] - b[k, r] * now, a[k, r] + 2 * h * b[k, r]
                if p > FLAT and n * p_up < n_up * p:
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
                if p > FLAT:
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
