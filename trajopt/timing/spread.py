"""Gridpoints where the motion varies, and the measure that cells have, compiled.

Cells are measured in sigma, dsigma^2 = ds^2 + (L dpsi)^2 with L a length of the robot's size: at a
near-cusp, where a turn takes no arc length, sigma still counts it, and the twist per sigma stays
bounded. Where the heading is free, s is that measure already. With n(u) = (vx, vy, L w) per sigma,
a unit vector, the grid follows arc length, turning, the change of n, and the bend of n.

``cubics`` (K-1, 4, D) are coefficients of 1, t, t^2, t^3; the heading, if free, comes last.
"""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.kernels import kernel
from trajopt.paths.find import cell_at, longer, longer_indices

_TURN, _SWING, _RATIO = (
    0.3,
    0.15,
    1.5,
)  # rad, rad, factor on dsigma/du: a first cell at most; chosen
_MOVES = 1e-6  # of a twist, as in limits/acceleration: what moves less turns on the spot
_DEEPEST = 50  # halvings of a cell
MOST_CELLS = 300_000  # that turn little: some 50,000 turns; chosen, for memory
_OF_TURN, _OF_SWING, _OF_BEND, _OF_RATIO = (
    0.3,
    0.6,
    0.35,
    0.02,
)  # weights beside the share of sigma; chosen
_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(5)


@kernel(nogil=True)
def pace(
    cubic: Array, t: float, length: float, free: bool
) -> tuple[float, float, float, float, float]:
    """dsigma/du, the larger turning per u of robot and direction of travel, and n, at a place of a
    segment."""
    x1 = cubic[1, 0] + t * (2 * cubic[2, 0] + t * 3 * cubic[3, 0])
    y1 = cubic[1, 1] + t * (2 * cubic[2, 1] + t * 3 * cubic[3, 1])
    square = x1 * x1 + y1 * y1
    if free:
        h = cubic.shape[1] - 1
        turn = cubic[1, h] + t * (2 * cubic[2, h] + t * 3 * cubic[3, h])
        yaw = cubic[0, h] + t * (cubic[1, h] + t * (cubic[2, h] + t * cubic[3, h]))
        rate = np.sqrt(square + (length * turn) ** 2)
        cos, sin = np.cos(yaw), np.sin(yaw)
        if rate <= 0:
            return 0.0, turn, 1.0, 0.0, 0.0
        swing = abs(turn)
        if square > (_MOVES * rate) ** 2:  # the direction of travel turns as well
            x2, y2 = 2 * cubic[2, 0] + t * 6 * cubic[3, 0], 2 * cubic[2, 1] + t * 6 * cubic[3, 1]
            swing = max(swing, abs(x1 * y2 - y1 * x2) / square)
        return (
            rate,
            swing,
            (cos * x1 + sin * y1) / rate,
            (cos * y1 - sin * x1) / rate,
            length * turn / rate,
        )
    x2, y2 = 2 * cubic[2, 0] + t * 6 * cubic[3, 0], 2 * cubic[2, 1] + t * 6 * cubic[3, 1]
    if square <= 0:
        return 0.0, 0.0, 1.0, 0.0, 0.0
    turn = (x1 * y2 - y1 * x2) / square
    rate = np.sqrt(square + (length * turn) ** 2)
    return rate, turn, np.sqrt(square) / rate, 0.0, length * turn / rate


@kernel(nogil=True)
def measured(knots: Array, cubics: Array, length: float, free: bool, u: Array) -> Array:
    """(N,): sigma gained in every cell of the grid u (N+1,), which holds all knots."""
    found = np.empty(len(u) - 1)
    i = 0
    for k in range(len(found)):
        while i < len(cubics) - 1 and u[k] >= knots[i + 1]:
            i += 1
        half, middle, total = (u[k + 1] - u[k]) / 2, (u[k + 1] + u[k]) / 2 - knots[i], 0.0
        for j in range(5):
            total += _GAUSS_W[j] * pace(cubics[i], middle + half * _GAUSS_X[j], length, free)[0]
        found[k] = total * half
    return found


@kernel(nogil=True)
def paces(knots: Array, cubics: Array, length: float, free: bool, u: Array) -> Array:
    """(N,): dsigma/du at ascending u."""
    found = np.empty(len(u))
    i = 0
    for k in range(len(u)):
        while i < len(cubics) - 1 and u[k] >= knots[i + 1]:
            i += 1
        found[k] = pace(cubics[i], u[k] - knots[i], length, free)[0]
    return found


@kernel(nogil=True)
def stretch(knots: Array, cubics: Array, length: float, u: Array) -> tuple[Array, Array]:
    """(N,) each: dsigma/ds and its derivative along s at u, where the heading is the path's."""
    g, slope = np.empty(len(u)), np.empty(len(u))
    i = 0
    for k in range(len(u)):
        i = cell_at(knots, len(cubics), u[k], i)
        t, f = u[k] - knots[i], cubics[i]
        x1 = f[1, 0] + t * (2 * f[2, 0] + t * 3 * f[3, 0])
        y1 = f[1, 1] + t * (2 * f[2, 1] + t * 3 * f[3, 1])
        x2, y2 = 2 * f[2, 0] + t * 6 * f[3, 0], 2 * f[2, 1] + t * 6 * f[3, 1]
        square = x1 * x1 + y1 * y1
        n, cross = np.sqrt(square), x1 * y2 - y1 * x2
        turn = length * cross / (n * square)
        cross1 = x1 * 6 * f[3, 1] - y1 * 6 * f[3, 0]
        turn1 = length * (cross1 - 3 * cross * (x1 * x2 + y1 * y2) / square) / (square * square)
        g[k] = np.sqrt(1 + turn * turn)
        slope[k] = turn * turn1 / g[k]
    return g, slope


@kernel(nogil=True)
def inside(
    knots: Array,
    cubics: Array,
    length: float,
    free: bool,
    left: Array,
    right: Array,
    d: Array,
    gained: Array,
) -> Array:
    """(M,): u in the cells from left to right (M,) whose sigma is d, where sigma has grown by
    ``gained``: inverse cubic, then Newton in brackets."""
    found = np.empty(len(gained))
    i = 0
    for n in range(len(gained)):
        i = cell_at(knots, len(cubics), left[n], i)
        low, high, aim = left[n] - knots[i], right[n] - knots[i], gained[n]
        start, h = low, high - low
        if aim <= 0 or d[n] <= 0:
            found[n] = left[n]
            continue
        t = min(aim / d[n], 1.0)
        g0, g1 = pace(cubics[i], low, length, free)[0], pace(cubics[i], high, length, free)[0]
        first, last = d[n] / max(g0 * h, 1e-300), d[n] / max(g1 * h, 1e-300)
        if max(first, last) < 2.5:
            t += t * (1 - t) * ((1 - t) * (first - 1) - t * (last - 1))
        at = start + h * t
        for _ in range(50):
            half, middle, total = (at - start) / 2, (at + start) / 2, 0.0
            for j in range(5):
                total += _GAUSS_W[j] * pace(cubics[i], middle + half * _GAUSS_X[j], length, free)[0]
            off = total * half - aim
            if off > 0:
                high = min(high, at)
            else:
                low = max(low, at)
            new = at - off / max(pace(cubics[i], at, length, free)[0], 1e-300)
            if not low <= new <= high:
                new = (low + high) / 2
            at = new
            if abs(off) <= 1e-9 * d[n]:  # the step just taken squares that
                break
        found[n] = min(max(knots[i] + at, left[n]), right[n])
    return found


@kernel(nogil=True)
def base_cells(
    knots: Array, cubics: Array, length: float, free: bool
) -> tuple[Array, Array, Array, IndexArray]:
    """Left ends u (M,) of cells that turn little, their sigma (M,), their weight beside it (M,) and
    segment (M,); up to the place where there are ``MOST_CELLS``."""
    size, count = 16 * len(cubics) + 64, 0
    left_ends, sigma, weight = np.empty(size), np.empty(size), np.empty(size)
    segment = np.empty(size, dtype=np.intp)
    ends = np.empty(_DEEPEST + 2)
    for i in range(len(cubics)):
        left, waiting = 0.0, 1
        ends[0] = knots[i + 1] - knots[i]
        while waiting > 0 and count < MOST_CELLS:
            right = ends[waiting - 1]
            middle = (left + right) / 2
            g0, t0, a0, b0, c0 = pace(cubics[i], left, length, free)
            g1, t1, a1, b1, c1 = pace(cubics[i], middle, length, free)
            g2, t2, a2, b2, c2 = pace(cubics[i], right, length, free)
            h = right - left
            turn = h * max(abs(t0), abs(t1), abs(t2))
            first = np.sqrt((a1 - a0) ** 2 + (b1 - b0) ** 2 + (c1 - c0) ** 2)
            second = np.sqrt((a2 - a1) ** 2 + (b2 - b1) ** 2 + (c2 - c1) ** 2)
            high, low = max(g0, g1, g2), min(g0, g1, g2)
            fine = turn <= _TURN and first + second <= _SWING and high <= _RATIO * low
            if fine or waiting > _DEEPEST or not left < middle < right:
                if count >= size:
                    left_ends, sigma, weight = longer(left_ends), longer(sigma), longer(weight)
                    segment = longer_indices(segment)
                    size = len(sigma)
                bend = np.sqrt(
                    (a0 - 2 * a1 + a2) ** 2 + (b0 - 2 * b1 + b2) ** 2 + (c0 - 2 * c1 + c2) ** 2
                )
                left_ends[count], segment[count] = knots[i] + left, i
                sigma[count] = h * (g0 + 4 * g1 + g2) / 6
                weight[count] = (
                    _OF_TURN * h * (abs(t0) + 4 * abs(t1) + abs(t2)) / 6
                    + _OF_SWING * (first + second)
                    + _OF_BEND * np.sqrt(bend)
                    + _OF_RATIO * np.log(max(high, 1e-300) / max(low, 1e-300))
                )
                count += 1
                left = right
                waiting -= 1
            else:
                ends[waiting] = middle
                waiting += 1
    return left_ends[:count], sigma[:count], weight[:count], segment[:count]


@kernel(nogil=True)
def spread(
    knots: Array, left: Array, weight: Array, segment: IndexArray, cells: float, least: int
) -> Array:
    """Grid u with about ``cells`` cells in proportion to the weight of base cells, all knots, and
    at least ``least`` cells a segment."""
    segments = len(knots) - 1
    sums, total, needed = np.zeros(segments), 0.0, 0
    for k in range(len(left)):
        sums[segment[k]] += weight[k]
    for i in range(segments):
        total += sums[i]
    counts = np.empty(segments, dtype=np.intp)
    for i in range(segments):
        counts[i] = max(least, int(np.ceil(cells * sums[i] / total - 1e-9)))
        needed += counts[i]
    u = np.empty(needed + 1)
    at, k = 0, 0
    for i in range(segments):
        u[at] = knots[i]
        at += 1
        before = 0.0
        share = sums[i] / counts[i]
        for j in range(1, counts[i]):
            aim = j * share
            while k < len(left) - 1 and segment[k] == i and before + weight[k] < aim:
                before += weight[k]
                k += 1
            right = knots[i + 1] if k + 1 >= len(left) or segment[k + 1] != i else left[k + 1]
            part = (aim - before) / weight[k] if weight[k] > 0 else 0.5
            u[at] = left[k] + (right - left[k]) * min(max(part, 0.0), 1.0)
            at += 1
        while k < len(left) and segment[k] == i:
            k += 1
    u[at] = knots[-1]
    return u
