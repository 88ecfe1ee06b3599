"""A lower bound on the time of any motion that keeps the rows, compiled.

With y = sigma'^2 a row a u + b y <= c with a > 0 says y' <= 2 (c - b y) / a, and by comparison y
stays below the solution of the equation, a line integral of functions of sigma alone: Simpson's
rule from the places at the ends and in the middle of a cell. Rows with a < 0 say the same from the
end of a cell backward. Leaving rows out leaves a bound, so in each cell the two rows that bind most
by the trapezoidal rule are integrated, and of those only rows that are not stiff. Below these and
below the speed that the rows allow at all, the profile is nowhere faster; what such a profile would
take is the bound.

A bound on power, a u + b y <= P / sqrt(y), leaves any force at rest. Times 3 sqrt(y) it says of
x = y^(3/2) what other rows say of y, x' <= 3 (P - b x) / a: a run at constant power is integrated
exactly, from rest on, and takes the time of x.
"""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.kernels import kernel

_FLAT = 1e-12
_STIFF = 0.6  # integral of 2 b / a in half a cell, at most
_VARIES = 2.5  # factor by which a may vary in a cell


@kernel(nogil=True)
def _through(
    a: Array, b: Array, c: Array, sign: float, j: int, m: int, k: int, h: float, y: float, r: int
) -> tuple[float, float]:
    """y in the middle and at the far end of a cell of length h entered at place j with y, as row r
    allows; ``sign`` 1 forward, -1 backward."""
    b0, bm, b1 = (2 * b[j, r] / a[j, r], 2 * b[m, r] / a[m, r], 2 * b[k, r] / a[k, r])
    g0, gm, g1 = (2 * c[j, r] / a[j, r], 2 * c[m, r] / a[m, r], 2 * c[k, r] / a[k, r])
    b0, bm, b1, g0, gm, g1 = sign * b0, sign * bm, sign * b1, sign * g0, sign * gm, sign * g1
    half = h / 24 * (5 * b0 + 8 * bm - b1)
    whole = h / 6 * (b0 + 4 * bm + b1)
    first, second = np.exp(-half), np.exp(half - whole)
    middle = first * y + h / 24 * (5 * first * g0 + 8 * gm - g1 / second)
    end = first * second * y + h / 6 * (first * second * g0 + 4 * second * gm + g1)
    return middle, end


@kernel(nogil=True)
def _least(
    a: Array,
    b: Array,
    c: Array,
    sign: float,
    j: int,
    m: int,
    k: int,
    h: float,
    y: float,
) -> tuple[float, float]:
    """Bounds on y in the middle and at the far end of a cell entered at place j with at most y."""
    best, second, one, two = np.inf, np.inf, -1, -1
    for r in range(a.shape[1]):
        p0, pm, p1 = sign * a[j, r], sign * a[m, r], sign * a[k, r]
        if p0 <= _FLAT or p1 <= _FLAT or pm <= _FLAT:
            continue
        # y1 (p1 + h b1) = y0 (p1 - h b0 p1 / p0) + h (c0 p1 / p0 + c1)
        q = p1 + h * b[k, r]
        if q <= 0.2 * p1:
            continue
        n = y * p1 + h * ((c[j, r] - b[j, r] * y) * p1 / p0 + c[k, r])
        value = n / q
        if value < second:
            high, low = max(p0, pm, p1), min(p0, pm, p1)
            stiff = h * max(abs(b[j, r]) / p0, abs(b[m, r]) / pm, abs(b[k, r]) / p1) > _STIFF
            if stiff or high > _VARIES * low:
                continue
            if value < best:
                best, second, one, two = value, best, r, one
            else:
                second, two = value, r
    middle = end = np.inf
    if one >= 0:
        middle, end = _through(a, b, c, sign, j, m, k, h, y, one)
    if two >= 0:
        other, last = _through(a, b, c, sign, j, m, k, h, y, two)
        middle, end = min(middle, other), min(end, last)
    return max(middle, 0.0), max(end, 0.0)


@kernel(nogil=True)
def _least_root(
    a: Array, b: Array, c: Array, sign: float, j: int, m: int, k: int, h: float, y: float
) -> tuple[float, float]:
    """Bounds on x = y^(3/2) in the middle and at the far end of a cell entered at place j with at
    most y, by the row that leaves least."""
    middle = end = np.inf
    for r in range(a.shape[1]):
        low, high = np.inf, 0.0
        for i in (j, m, k):
            low, high = min(low, sign * a[i, r]), max(high, sign * a[i, r])
        if low <= _FLAT or high > _VARIES * low:
            continue
        if h * max(abs(b[j, r]), abs(b[m, r]), abs(b[k, r])) > _STIFF * low:
            continue
        half, whole = _through(a, b, c, sign, j, m, k, h, y**1.5, r)
        if whole < end:
            middle, end = half, whole
    return max(middle, 0.0), max(end, 0.0)


@kernel(nogil=True)
def _root_time(h: float, x: Array, half: int) -> float:
    """Seconds over one half (0, 1) of a cell, of length h, with y^(3/2) at most ``x`` (3,) at its
    ends and in its middle; 0 where nothing bounds it."""
    if np.isinf(x[0]) or np.isinf(x[1]) or np.isinf(x[2]):
        return 0.0
    bend = max(2 * x[1] - x[0] - x[2], 0.0) / 12
    p, q = (x[half] + bend) ** (1 / 3), (x[half + 1] + bend) ** (1 / 3)
    return 1.5 * h * (p + q) / (p * p + p * q + q * q) if p + q > 0 else np.inf


@kernel(nogil=True)
def _least_time(h: float, lines: Array) -> float:
    """Seconds over length h with y at the least of three lines, given at their ends (3, 2)."""
    # Breaks are where two lines cross.
    breaks = np.empty(5)
    breaks[0], breaks[1] = 0.0, 1.0
    count = 2
    for i in range(3):
        for j in range(i):
            e0, e1 = lines[i, 0] - lines[j, 0], lines[i, 1] - lines[j, 1]
            if e0 * e1 < 0 and np.isfinite(e0) and np.isfinite(e1):
                breaks[count] = e0 / (e0 - e1)
                count += 1
    for n in range(2, count):  # into ascending order; five at most
        value, i = breaks[n], n
        while i > 0 and breaks[i - 1] > value:
            breaks[i] = breaks[i - 1]
            i -= 1
        breaks[i] = value
    total, before, at = 0.0, 0.0, 0.0
    for n in range(count):
        t = breaks[n]
        y = np.inf
        for i in range(3):
            if np.isfinite(lines[i, 0]) and np.isfinite(lines[i, 1]):
                y = min(y, lines[i, 0] + t * (lines[i, 1] - lines[i, 0]))
        speed = np.sqrt(max(y, 0.0))
        if n > 0 and t > at:
            total += 2 * h * (t - at) / (before + speed)
        before, at = speed, t
    return total


@kernel(nogil=True)
def lower_bound(
    d: Array,
    left: IndexArray,
    middle: IndexArray,
    right: IndexArray,
    a: Array,
    b: Array,
    c: Array,
    root_a: Array,
    root_b: Array,
    root_c: Array,
    top: Array,
    node: Array,
    start: float,
    end: float,
    seconds: Array,
    upper: Array,
) -> float:
    """Least time, s, of any motion from y = ``start`` to ``end``; fills seconds (N,), each cell's
    share of it, and upper (P,), above which y of no motion lies at the ends and in the middles of
    cells. ``top`` (P,) bounds y at places, ``node`` (N+1,) at gridpoints; rows ``root_a``, .. (P, Q)
    bound y^(3/2) as the others do y."""
    count = len(d)
    ahead, back = np.empty((count, 3)), np.empty((count, 3))
    rise, fall = np.empty((count, 3)), np.empty((count, 3))
    y = start
    for i in range(count):
        j, m, k = left[i], middle[i], right[i]
        ahead[i, 0] = y = min(y, top[j])
        rise[i, 0] = y**1.5
        ahead[i, 1], ahead[i, 2] = _least(a, b, c, 1.0, j, m, k, d[i], y)
        rise[i, 1], rise[i, 2] = _least_root(root_a, root_b, root_c, 1.0, j, m, k, d[i], y)
        y = min(min(ahead[i, 2], rise[i, 2] ** (2 / 3)), min(top[k], node[i + 1]))
    y = end
    for i in range(count - 1, -1, -1):
        j, m, k = left[i], middle[i], right[i]
        back[i, 2] = y = min(y, top[k])
        fall[i, 2] = y**1.5
        back[i, 1], back[i, 0] = _least(a, b, c, -1.0, k, m, j, d[i], y)
        fall[i, 1], fall[i, 0] = _least_root(root_a, root_b, root_c, -1.0, k, m, j, d[i], y)
        y = min(min(back[i, 0], fall[i, 0] ** (2 / 3)), min(top[j], node[i]))
    total = 0.0
    lines = np.empty((3, 2))
    for i in range(count):
        tops = (top[left[i]], top[middle[i]], top[right[i]])
        for n in range(3):
            j = left[i] + 2 * n if n < 2 else right[i]
            root = min(rise[i, n], fall[i, n]) ** (2 / 3)
            upper[j] = min(min(ahead[i, n], back[i, n]), min(tops[n], root))
        bends = np.zeros(3)  # how far a curve that bends down rises above its chords
        for n in range(3):
            e0, e1, e2 = (
                (ahead[i, 0], ahead[i, 1], ahead[i, 2])
                if n == 0
                else ((back[i, 0], back[i, 1], back[i, 2]) if n == 1 else tops)
            )
            if np.isfinite(e0) and np.isfinite(e1) and np.isfinite(e2):
                bends[n] = max(2 * e1 - e0 - e2, 0.0) / 12
        seconds[i] = 0.0
        for half in range(2):
            for n in range(2):
                lines[0, n] = ahead[i, half + n] + bends[0]
                lines[1, n] = back[i, half + n] + bends[1]
                lines[2, n] = tops[half + n] + bends[2]
            by_root = max(_root_time(d[i] / 2, rise[i], half), _root_time(d[i] / 2, fall[i], half))
            seconds[i] += max(_least_time(d[i] / 2, lines), by_root)
        total += seconds[i]
    return total
