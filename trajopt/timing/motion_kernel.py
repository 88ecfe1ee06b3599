"""Where a robot is at times, on level ground without steered wheels, compiled.

Cells of a profile hold sigma as a polynomial of the spline parameter, so that its inverse takes two
Newton steps. Times are usually ascending: the cell of the one before is tried first everywhere.
"""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array, BoolArray, IndexArray
from trajopt.kernels import kernel
from trajopt.paths.find import cell_at
from trajopt.timing.reach import moment
from trajopt.timing.spread import pace

_POINTS = 5
_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(_POINTS)
_UNIT_X = (1 + _GAUSS_X) / 2
_TO_POWERS = np.linalg.inv(np.vander(_UNIT_X, increasing=True)).T / np.arange(1, 6)
_FITS = 1e-12  # of a cell's sigma: what its polynomial may miss in the middle; chosen


@kernel(nogil=True)
def sigma_powers(
    knots: Array, cubics: Array, length: float, free: bool, u: Array, d: Array
) -> tuple[Array, BoolArray]:
    """(N, 5): coefficients of t, .. t^5 of sigma / d in every cell of the grid u (N+1,), t from 0 to
    1; and where they fit."""
    powers, fits = np.zeros((len(d), _POINTS)), np.zeros(len(d), dtype=np.bool_)
    i = 0
    for k in range(len(d)):
        i = cell_at(knots, len(cubics), u[k], i)
        h = u[k + 1] - u[k]
        if d[k] <= 0 or h <= 0:
            continue
        half = whole = 0.0
        for j in range(_POINTS):
            at = u[k] - knots[i] + h * _UNIT_X[j]
            g = pace(cubics[i], at, length, free)[0] * h / d[k]
            for p in range(_POINTS):
                powers[k, p] += g * _TO_POWERS[j, p]
            at = u[k] - knots[i] + h / 2 * _UNIT_X[j]
            half += _GAUSS_W[j] / 2 * pace(cubics[i], at, length, free)[0] * h / 2 / d[k]
        middle = 0.0
        for p in range(_POINTS):
            middle += powers[k, p] * 0.5 ** (p + 1)
            whole += powers[k, p]
        last = 0.0
        for p in range(_POINTS):
            last += (p + 1) * powers[k, p]
        fits[k] = abs(middle - half) <= _FITS and abs(whole - 1) <= _FITS
        fits[k] = fits[k] and powers[k, 0] > 0.4 and last > 0.4
    return powers, fits


@kernel(nogil=True)
def places(
    u: Array,
    d: Array,
    y: Array,
    first: Array,
    last: Array,
    powers: Array,
    fits: BoolArray,
    starts: Array,
    times: Array,
    found: Array,
    speed: Array,
) -> IndexArray:
    """Fills spline parameters and sigma' (M,) at times (M,); ``starts`` (N+1,) are those of cells.
    Returns the cells of times where the polynomial does not fit, else -1; there ``found`` holds sigma
    gained."""
    left = np.empty(len(times), dtype=np.intp)
    i = 0
    for k in range(len(times)):
        i = cell_at(starts, len(d), times[k], i)
        after = min(max(times[k] - starts[i], 0.0), starts[i + 1] - starts[i])
        left[k] = -1
        gained, speed[k], _ = moment(d[i], y[i], first[i], last[i], after)
        if not fits[i]:
            found[k], left[k] = gained, i
            continue
        c1, c2, c3, c4, c5 = powers[i]
        aim = gained / d[i]
        begin, end = 1 / c1, 1 / (c1 + 2 * c2 + 3 * c3 + 4 * c4 + 5 * c5)
        t = aim + aim * (1 - aim) * ((1 - aim) * (begin - 1) - aim * (end - 1))
        for _ in range(2):
            value = t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))) - aim
            t -= value / (c1 + t * (2 * c2 + t * (3 * c3 + t * (4 * c4 + t * 5 * c5))))
        at = u[i] + (u[i + 1] - u[i]) * min(max(t, 0.0), 1.0)
        found[k] = at if i + 2 >= len(u) else min(at, np.nextafter(u[i + 1], -np.inf))
    return left


@kernel(nogil=True)
def bodies(
    knots: Array,
    cubics: Array,
    free: bool,
    length: float,
    turns: Array,
    yaws: Array,
    u: Array,
    speed: Array,
    bent: bool,
    pose: Array,
    twist: Array,
    position: Array,
    rotation: Array,
    unit: Array,
) -> None:
    """Fills pose, twist, position (M, 3), rotation (M, 3, 3), and the twist per path parameter with
    s' last, unit (M, 4), at u (M,). ``speed`` is sigma' where ``bent``, else s'. ``yaws`` (T,): the
    continuous directions at places ``turns``, near enough to tell the turn, where the heading is the
    path's."""
    i = n = 0
    for k in range(len(u)):
        i = cell_at(knots, len(cubics), u[k], i)
        f, t = cubics[i], u[k] - knots[i]
        x1 = f[1, 0] + t * (2 * f[2, 0] + t * 3 * f[3, 0])
        y1 = f[1, 1] + t * (2 * f[2, 1] + t * 3 * f[3, 1])
        square = x1 * x1 + y1 * y1
        if free:
            yaw = f[0, 2] + t * (f[1, 2] + t * (f[2, 2] + t * f[3, 2]))
            r1 = f[1, 2] + t * (2 * f[2, 2] + t * 3 * f[3, 2])
            g = np.sqrt(square + length * length * r1 * r1)
            cos, sin = np.cos(yaw), np.sin(yaw)
            vx, vy, w = (cos * x1 + sin * y1) / g, (cos * y1 - sin * x1) / g, r1 / g
            rate = speed[k]
        else:
            x2, y2 = 2 * f[2, 0] + t * 6 * f[3, 0], 2 * f[2, 1] + t * 6 * f[3, 1]
            g = np.sqrt(square)
            cos, sin = x1 / g, y1 / g
            vx, vy, w = 1.0, 0.0, (x1 * y2 - y1 * x2) / (g * square)
            rate = speed[k]
            if bent:
                turn = length * w
                rate = rate / np.sqrt(1 + turn * turn)
            n = cell_at(turns, len(turns) - 1, u[k], n)
            yaw = np.arctan2(y1, x1)
            yaw += 2 * np.pi * np.round((yaws[n] - yaw) / (2 * np.pi))
        pose[k, 0] = position[k, 0] = f[0, 0] + t * (f[1, 0] + t * (f[2, 0] + t * f[3, 0]))
        pose[k, 1] = position[k, 1] = f[0, 1] + t * (f[1, 1] + t * (f[2, 1] + t * f[3, 1]))
        pose[k, 2], position[k, 2] = yaw, 0.0
        twist[k, 0], twist[k, 1], twist[k, 2] = vx * rate, vy * rate, w * rate
        unit[k, 0], unit[k, 1], unit[k, 2], unit[k, 3] = vx, vy, w, rate
        rotation[k, 0, 0], rotation[k, 0, 1], rotation[k, 0, 2] = cos, -sin, 0.0
        rotation[k, 1, 0], rotation[k, 1, 1], rotation[k, 1, 2] = sin, cos, 0.0
        rotation[k, 2, 0], rotation[k, 2, 1], rotation[k, 2, 2] = 0.0, 0.0, 1.0


@kernel(nogil=True)
def wheels(
    table: Array,
    sums: Array,
    powers: Array,
    u: Array,
    unit: Array,
    inverse: Array,
    start: Array,
    spin: Array,
    spin_rate: Array,
) -> Array:
    """Fills spin angles and rates (M, K) of wheels that do not turn, and spin angles of all, at u
    (M,), from the cells of ``WheelTable``; ``inverse`` (K, 3), ``start`` (K,) angles. Returns path
    parameters (M,)."""
    count, i = inverse.shape[0], 0
    s = np.empty(len(u))
    for k in range(len(u)):
        i = cell_at(table, len(table) - 1, u[k], i)
        t = (u[k] - table[i]) / (table[i + 1] - table[i])
        for q in range(count + 1):
            c1, c2, c3, c4, c5 = powers[i, q]
            value = sums[i, q] + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
            if q == count:
                s[k] = value
                continue
            spin[k, q] = start[q] + value
            spin_rate[k, q] = unit[k, 3] * (
                inverse[q, 0] * unit[k, 0] + inverse[q, 1] * unit[k, 1] + inverse[q, 2] * unit[k, 2]
            )
    return s


@kernel(nogil=True)
def castors(
    cells: Array,
    powers: Array,
    s: Array,
    unit: Array,
    members: IndexArray,
    place: Array,
    trail: Array,
    lateral: Array,
    radius: Array,
    angle: Array,
    spin_rate: Array,
    turned: Array,
    turning: Array,
) -> None:
    """Fills steering angles and rates, and spin rates (M, K), of castors ``members`` (C,) at path
    parameters (M,), from polynomials (6, N, C) in cells (N+1,) of ``Turning``."""
    i = 0
    for k in range(len(s)):
        i = cell_at(cells, len(cells) - 1, s[k], i)
        t = (s[k] - cells[i]) / (cells[i + 1] - cells[i])
        vx, vy, w, rate = unit[k]
        for c in range(len(members)):
            beta = powers[5, i, c]
            for p in range(4, -1, -1):
                beta = powers[p, i, c] + t * beta
            cos, sin = np.cos(angle[c] + beta), np.sin(angle[c] + beta)
            px, py = vx - w * place[c, 1], vy + w * place[c, 0]
            bend = (py * cos - px * sin) / trail[c] - w
            m = members[c]
            turned[k, m], turning[k, m] = beta, bend * rate
            spin_rate[k, m] = (px * cos + py * sin - lateral[c] * (w + bend)) / radius[c] * rate
