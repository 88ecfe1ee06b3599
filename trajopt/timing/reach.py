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
from trajopt.timing.ranges import FLAT, end_of_feasible, meeting, u_range

_NEAR = 1e-3  # of a row's scale: values that far below are no peaks that count; chosen


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
    up = lower = -1
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
        cap = max(meeting(a, b, c, j, k, h, low, high, up, lower, cap), floor)
        above, up, lower = end_of_feasible(a, b, c, j, k, h, low, high, cap, floor)
        if np.isnan(above):
            return i
        below = floor
        if eased:
            below, _, _ = end_of_feasible(a, b, c, j, k, h, low, high, floor, above)
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
def peak(v: Array) -> float:
    """Greatest of five evenly spread values, or of the parabola through the greatest and its
    neighbours, where they are smooth enough for one."""
    k = 0
    for i in range(1, 5):
        if v[i] > v[k]:
            k = i
    m = min(max(k, 1), 3)
    rise, bend = (v[m + 1] - v[m - 1]) / 2, v[m - 1] + v[m + 1] - 2 * v[m]
    uneven = 0.0  # third differences
    if m < 3:
        uneven = abs(v[m + 2] - 3 * v[m + 1] + 3 * v[m] - v[m - 1])
    if m > 1:
        uneven = max(uneven, abs(v[m + 1] - 3 * v[m] + 3 * v[m - 1] - v[m - 2]))
    if bend < 0 and abs(rise) <= -1.5 * bend and uneven <= -bend / 2:
        at = min(max(m - rise / bend, 0.0), 4.0) - m
        return float(max(v[k], v[m] + at * (rise + at * bend / 2)))
    return float(v[k])


@kernel(nogil=True)
def inside(h: float, y0: float, y1: float, u0: float, u1: float, u: Array, square: Array) -> None:
    """Fills u and y (5,) at the ends and quarters of a cell."""
    for k in range(5):
        u[k] = u0 + k / 4 * (u1 - u0)
        square[k] = max(y0 + k / 4 * h * (u0 + u[k]), 0.0) if k < 4 else y1


@kernel(nogil=True)
def excess(
    d: Array,
    left: IndexArray,
    right: IndexArray,
    a: Array,
    b: Array,
    c: Array,
    bounds: Array,
    y: Array,
    u0: Array,
    u1: Array,
    over: Array,
    factor: Array,
) -> None:
    """Fills over (N,), the share of a row's scale (or of ``bounds`` (L, P) on y) by which each cell
    breaks it at its ends and quarters, or where a parabola through these is highest, and factor
    (N,), what y would have to be divided by."""
    u, square, values = np.empty(5), np.empty(5), np.empty(5)
    places = np.empty(5, dtype=np.intp)
    for i in range(len(d)):
        worst, most = 0.0, 1.0
        inside(d[i], y[i], y[i + 1], u0[i], u1[i], u, square)
        for k in range(5):
            places[k] = right[i] if k == 4 else left[i] + k
        for n in range(
            len(bounds)
        ):  # each alone: their least has kinks, whose peaks no parabola shows
            near = False
            for k in range(5):
                here, bound = square[k], bounds[n, places[k]]
                values[k] = here / bound if bound > 0 else (np.inf if here > 0 else 0.0)
                near = near or values[k] > 1 - _NEAR
            ratio = peak(values) if near else 0.0
            if ratio > 1:
                worst, most = max(worst, ratio - 1), max(most, ratio)
        p0, p1, p2, p3, p4 = places[0], places[1], places[2], places[3], places[4]
        for r in range(a.shape[1]):
            v0 = a[p0, r] * u[0] + b[p0, r] * square[0] - c[p0, r]
            v1 = a[p1, r] * u[1] + b[p1, r] * square[1] - c[p1, r]
            v2 = a[p2, r] * u[2] + b[p2, r] * square[2] - c[p2, r]
            v3 = a[p3, r] * u[3] + b[p3, r] * square[3] - c[p3, r]
            v4 = a[p4, r] * u[4] + b[p4, r] * square[4] - c[p4, r]
            if max(v0, v1, v2, v3, v4) <= -_NEAR:
                continue
            values[0], values[1], values[2], values[3], values[4] = v0, v1, v2, v3, v4
            high = peak(values)
            if high > 0:
                worst = max(worst, high)
                least = min(c[p0, r], c[p1, r], c[p2, r], c[p3, r], c[p4, r])
                if least > 0:
                    most = max(most, 1 + high / least)
        over[i], factor[i] = worst, most


@kernel(nogil=True)
def margins(
    d: Array,
    left: IndexArray,
    right: IndexArray,
    a: Array,
    b: Array,
    c: Array,
    bounds: Array,
    owner: IndexArray,
    y: Array,
    u0: Array,
    u1: Array,
    slack: Array,
) -> None:
    """Fills slack (N, L): the least relative margin of every limit in each cell, with peaks as in
    ``excess``."""
    u, square, values = np.empty(5), np.empty(5), np.empty(5)
    for i in range(len(d)):
        inside(d[i], y[i], y[i + 1], u0[i], u1[i], u, square)
        for n in range(len(bounds)):
            for k in range(5):
                bound = bounds[n, right[i] if k == 4 else left[i] + k]
                values[k] = square[k] / bound if bound > 0 else (np.inf if square[k] > 0 else 0.0)
            slack[i, n] = 1 - np.sqrt(max(peak(values), 0.0))
        for r in range(a.shape[1]):
            for k in range(5):
                j = right[i] if k == 4 else left[i] + k
                values[k] = a[j, r] * u[k] + b[j, r] * square[k] - c[j, r]
            slack[i, owner[r]] = min(slack[i, owner[r]], -peak(values))


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
def moment(d: float, y: float, u0: float, u1: float, after: float) -> tuple[float, float, float]:
    """Sigma gained, sigma' and sigma'' so long after a cell was entered."""
    slope = (u1 - u0) / d
    z, w = slope * after * after, np.sqrt(max(y, 0.0))
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
    gained = min(max(w * sine + u0 * half, 0.0), d)
    return gained, max(w * cosine + u0 * sine, 0.0), u0 + slope * gained


@kernel(nogil=True)
def moments(
    d: Array, y: Array, u0: Array, u1: Array, cells: IndexArray, times: Array
) -> tuple[Array, Array, Array]:
    """Sigma gained, sigma' and sigma'' at times (M,) after cells (M,) were entered."""
    gained, speed, pull = np.empty(len(times)), np.empty(len(times)), np.empty(len(times))
    for n in range(len(times)):
        i = cells[n]
        gained[n], speed[n], pull[n] = moment(d[i], y[i], u0[i], u1[i], max(times[n], 0.0))
    return gained, speed, pull
