"""Arc length of cubic splines and its inverse, compiled.

On a segment ds/du = |b + 2 c t + 3 d t^2| is smooth but for branch points near sharp bends, so
Gauss quadrature converges fast on cells that are small against their distance: cells are halved
until that changes nothing. ``cubics`` (K-1, 4, D) hold the coefficients of 1, t, t^2, t^3.
"""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.kernels import kernel
from trajopt.paths.find import cell_at, longer, longer_indices

_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(8)
_DEEPEST = 60  # halvings of a cell: down to rounding
_BISECTIONS = 64  # of a place where ds/du is least


@kernel(nogil=True)
def square_at(cubic: Array, t: float) -> float:
    """(ds/du)^2."""
    total = 0.0
    for k in range(cubic.shape[1]):
        value = cubic[1, k] + t * (2 * cubic[2, k] + t * 3 * cubic[3, k])
        total += value * value
    return total


@kernel(nogil=True)
def gained(cubic: Array, a: float, b: float) -> float:
    """Path parameter from t = a to b."""
    half, middle, total = (b - a) / 2, (a + b) / 2, 0.0
    for k in range(8):
        total += _GAUSS_W[k] * np.sqrt(square_at(cubic, middle + half * _GAUSS_X[k]))
    return total * half


@kernel(nogil=True)
def measure(knots: Array, cubics: Array, settled: float) -> tuple[Array, Array, IndexArray]:
    """Left ends u (M,) of quadrature cells, path parameter s (M+1,) at their ends, and the segment
    of each; halving a cell changes less than ``settled`` of the length."""
    rough = 0.0
    for i in range(len(cubics)):
        rough += gained(cubics[i], 0.0, knots[i + 1] - knots[i])
    tolerance = settled * rough
    size, count = 4 * len(cubics) + 64, 0
    u, s = np.empty(size), np.empty(size + 1)
    segment = np.empty(size, dtype=np.intp)
    ends, wholes = np.empty(_DEEPEST + 2), np.empty(_DEEPEST + 2)
    total = rest = 0.0
    s[0] = 0.0
    for i in range(len(cubics)):
        h = knots[i + 1] - knots[i]
        left, waiting = 0.0, 1
        ends[0], wholes[0] = h, gained(cubics[i], 0.0, h)
        while waiting > 0:
            right, whole = ends[waiting - 1], wholes[waiting - 1]
            middle = (left + right) / 2
            first, second = gained(cubics[i], left, middle), gained(cubics[i], middle, right)
            fine = abs(first + second - whole) <= tolerance
            if fine or waiting > _DEEPEST or not left < middle < right:
                if count + 2 > size:
                    u, s, segment = longer(u), longer(s), longer_indices(segment)
                    size = len(u)
                for k in range(2):
                    u[count] = knots[i] + (middle if k else left)
                    segment[count] = i
                    more = (second if k else first) + rest  # summed with its rounding errors
                    after = total + more
                    rest = more - (after - total)
                    total = after
                    count += 1
                    s[count] = total
                left = right
                waiting -= 1
            else:
                wholes[waiting - 1] = second
                ends[waiting], wholes[waiting] = middle, first
                waiting += 1
    return u[:count], s[: count + 1], segment[:count]


@kernel(nogil=True)
def parameters(
    knots: Array, cubics: Array, cells: Array, s: Array, segment: IndexArray, u: Array
) -> Array:
    """(N,): path parameters at spline parameters (N,), from the cells of ``measure``."""
    found = np.empty(len(u))
    i = 0
    for k in range(len(u)):
        i = cell_at(cells, len(cells), u[k], i)
        j = segment[i]
        found[k] = s[i] + gained(cubics[j], cells[i] - knots[j], u[k] - knots[j])
    return found


@kernel(nogil=True)
def places(
    knots: Array, cubics: Array, cells: Array, s: Array, segment: IndexArray, wanted: Array
) -> Array:
    """(N,): spline parameters at path parameters (N,): inverse cubic, then Newton in brackets."""
    found = np.empty(len(wanted))
    i = 0
    for k in range(len(wanted)):
        i = cell_at(s, len(cells), wanted[k], i)
        j = segment[i]
        left = cells[i] - knots[j]
        last = i + 1 >= len(cells) or segment[i + 1] != j
        right = knots[j + 1] - knots[j] if last else cells[i + 1] - knots[j]
        width, aim = s[i + 1] - s[i], wanted[k] - s[i]
        if aim <= 0 or width <= 0:
            found[k] = cells[i]
            continue
        share = min(aim / width, 1.0)
        h = right - left
        first = width / max(np.sqrt(square_at(cubics[j], left)) * h, 1e-300)
        second = width / max(np.sqrt(square_at(cubics[j], right)) * h, 1e-300)
        t = share  # cubic Hermite interpolation of the inverse, where it stays inside
        if max(first, second) < 3:
            t = share + share * (1 - share) * ((1 - share) * (first - 1) - share * (second - 1))
        low, high = left, right
        t = left + h * min(max(t, 0.0), 1.0)
        for _ in range(60):
            off = gained(cubics[j], left, t) - aim
            if off > 0:
                high = min(high, t)
            else:
                low = max(low, t)
            pace = np.sqrt(square_at(cubics[j], t))
            step = off / pace if pace > 0 else 0.0
            new = t - step
            if not low <= new <= high:
                new = (low + high) / 2
            t = new
            if abs(off) <= 1e-9 * width:  # the step just taken squares that
                break
        found[k] = min(max(knots[j] + t, cells[i]), knots[j] + right)
    return found


@kernel(nogil=True)
def slowest(knots: Array, cubics: Array) -> tuple[float, float]:
    """Spline parameter where ds/du is least, and its value there: at a knot or where the slope of
    its square, a cubic, goes from minus to plus."""
    best, place = np.inf, knots[0]
    turns = np.empty(4)
    for i in range(len(cubics)):
        f, h = cubics[i], knots[i + 1] - knots[i]
        p = q = r = w = 0.0
        for k in range(f.shape[1]):
            p += 18 * f[3, k] ** 2
            q += 18 * f[2, k] * f[3, k]
            r += 4 * f[2, k] ** 2 + 6 * f[1, k] * f[3, k]
            w += 2 * f[1, k] * f[2, k]
        # The slope is monotone between the roots of its own: 3 p t^2 + 2 q t + r.
        turns[0] = turns[1] = turns[2] = 0.0
        turns[3] = h
        under = q * q - 3 * p * r
        if p > 0 and under > 0:
            root = np.sqrt(under)
            turns[1] = min(max((-q - root) / (3 * p), 0.0), h)
            turns[2] = min(max((-q + root) / (3 * p), 0.0), h)
        for end in (0.0, h):
            value = square_at(f, end)
            if value < best:
                best, place = value, knots[i] + end
        for k in range(3):
            low, high = turns[k], turns[k + 1]
            if not high > low:
                continue
            if (
                w + low * (r + low * (q + low * p)) >= 0
                or w + high * (r + high * (q + high * p)) <= 0
            ):
                continue
            for _ in range(_BISECTIONS):
                middle = (low + high) / 2
                if w + middle * (r + middle * (q + middle * p)) < 0:
                    low = middle
                else:
                    high = middle
            value = square_at(f, low)
            if value < best:
                best, place = value, knots[i] + low
    return place, np.sqrt(best)
