"""What rows on level ground are made of, compiled: see ``planar``."""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.kernels import kernel
from trajopt.paths.find import cell_at

FEATURES = 11  # vx, vy, w, p per sigma, their derivatives along sigma, w^2, w vx, w vy


@kernel(nogil=True)
def feature(f: Array, t: float, length: float, free: bool, out: Array) -> float:
    """Fills out (FEATURES,) at a place of a segment; returns dsigma/du."""
    x1 = f[1, 0] + t * (2 * f[2, 0] + t * 3 * f[3, 0])
    y1 = f[1, 1] + t * (2 * f[2, 1] + t * 3 * f[3, 1])
    x2, y2 = 2 * f[2, 0] + t * 6 * f[3, 0], 2 * f[2, 1] + t * 6 * f[3, 1]
    square, along = x1 * x1 + y1 * y1, x1 * x2 + y1 * y2
    if free:
        h = f.shape[1] - 1
        yaw = f[0, h] + t * (f[1, h] + t * (f[2, h] + t * f[3, h]))
        r1, r2 = f[1, h] + t * (2 * f[2, h] + t * 3 * f[3, h]), 2 * f[2, h] + t * 6 * f[3, h]
        cos, sin = np.cos(yaw), np.sin(yaw)
        g = np.sqrt(square + (length * r1) ** 2)
        g1 = (along + length * length * r1 * r2) / g
        ux, uy = cos * x1 + sin * y1, cos * y1 - sin * x1
        vx, vy, w = ux / g, uy / g, r1 / g
        vx1 = ((cos * x2 + sin * y2 + r1 * uy) - vx * g1) / (g * g)
        vy1 = ((cos * y2 - sin * x2 - r1 * ux) - vy * g1) / (g * g)
        w1 = (r2 - w * g1) / (g * g)
        p = np.sqrt(square) / g
        p1 = (vx * vx1 + vy * vy1) / p if p > 1e-6 else 0.0
        p = p if p > 1e-6 else 0.0  # a turn on the spot, as in limits/acceleration
    else:
        n = np.sqrt(square)
        cross, cross1 = x1 * y2 - y1 * x2, 6 * (x1 * f[3, 1] - y1 * f[3, 0])
        turn = cross / square
        g = np.sqrt(square + (length * turn) ** 2)
        cos, w = n / g, turn / g
        bend = (cross1 - 3 * cross * along / square) / n / (g * g) / g
        vx, vy, sin = cos, 0.0, length * w
        vx1, vy1, w1 = -sin * length * bend, 0.0, cos * bend
        p, p1 = vx, vx1
    out[0], out[1], out[2], out[3] = vx, vy, w, p
    out[4], out[5], out[6], out[7] = vx1, vy1, w1, p1
    out[8], out[9], out[10] = w * w, w * vx, w * vy
    return float(g)


@kernel(nogil=True)
def features(knots: Array, cubics: Array, length: float, free: bool, u: Array) -> Array:
    """(P, FEATURES) at spline parameters u (P,); ``length`` as in ``spread``."""
    found = np.empty((len(u), FEATURES))
    i = 0
    for k in range(len(u)):
        i = cell_at(knots, len(cubics), u[k], i)
        feature(cubics[i], u[k] - knots[i], length, free, found[k])
    return found


@kernel(nogil=True)
def linear(
    at: Array, ma: Array, mb: Array, mc: Array, first: int, a: Array, b: Array, c: Array
) -> None:
    """Rows of constant matrices (4, M), (7, M), (M,) in columns of a, b, c (P, R) from ``first`` on."""
    for k in range(len(at)):
        f0, f1, f2, f3, f4, f5 = at[k, 0], at[k, 1], at[k, 2], at[k, 3], at[k, 4], at[k, 5]
        f6, f7, f8, f9, f10 = at[k, 6], at[k, 7], at[k, 8], at[k, 9], at[k, 10]
        for m in range(len(mc)):
            r = first + m
            a[k, r] = ma[0, m] * f0 + ma[1, m] * f1 + ma[2, m] * f2 + ma[3, m] * f3
            b[k, r] = (
                mb[0, m] * f4
                + mb[1, m] * f5
                + mb[2, m] * f6
                + mb[3, m] * f7
                + mb[4, m] * f8
                + mb[5, m] * f9
                + mb[6, m] * f10
            )
            c[k, r] = mc[m]


@kernel(nogil=True)
def speed_bounds(at: Array, speeds: Array, owner: IndexArray, bounds: Array) -> None:
    """Raises the bounds (L, P) on sigma'^2 from |speeds (Q, 4) . T| sigma' <= 1."""
    for k in range(len(at)):
        for q in range(len(bounds)):
            bounds[q, k] = np.inf
        for q in range(len(owner)):
            rate = (
                speeds[q, 0] * at[k, 0]
                + speeds[q, 1] * at[k, 1]
                + speeds[q, 2] * at[k, 2]
                + speeds[q, 3] * at[k, 3]
            )
            if rate != 0:
                bounds[owner[q], k] = min(bounds[owner[q], k], 1 / (rate * rate))


@kernel(nogil=True)
def _force(f: Array, cog: Array) -> tuple[float, float, float, float]:
    """Acceleration of the centre of gravity, x and y, per sigma'' and per sigma'^2."""
    return (
        f[0] - f[2] * cog[1],
        f[1] + f[2] * cog[0],
        f[4] - f[10] - f[6] * cog[1] - f[8] * cog[0],
        f[5] + f[9] + f[6] * cog[0] - f[8] * cog[1],
    )


@kernel(nogil=True)
def slip_rows(
    at: Array,
    arms: Array,
    cog: Array,
    grips: Array,
    gravity: float,
    pushes: Array,
    inside: float,
    scale: float,
    first: int,
    a: Array,
    b: Array,
    c: Array,
) -> None:
    """As ``Slip`` where all that hold along and across are rigid: ``pushes`` (R, 3) times force and
    yaw moment over angular acceleration <= ``grips`` (K,) times load, friction of the wheels that
    hold it, else 0."""
    for k in range(len(at)):
        # Loads of least norm are B' (B B')^-1 (fz, -h fx, -h fy) with columns (1, x, y) of B.
        xx = xy = yy = sx = sy = 0.0
        g0 = g1 = g2 = 0.0
        count = float(arms.shape[1])
        for i in range(arms.shape[1]):
            x, y = arms[k, i, 0], arms[k, i, 1]
            sx, sy, xx, xy, yy = sx + x, sy + y, xx + x * x, xy + x * y, yy + y * y
            g0, g1, g2 = g0 + grips[i], g1 + grips[i] * x, g2 + grips[i] * y
        # (B B') w = g by elimination of the mean.
        mx, my = sx / count, sy / count
        cxx, cxy, cyy = xx - sx * mx, xy - sx * my, yy - sy * my
        h1, h2 = g1 - mx * g0, g2 - my * g0
        det = cxx * cyy - cxy * cxy
        w1, w2 = (cyy * h1 - cxy * h2) / det, (cxx * h2 - cxy * h1) / det
        w0 = g0 / count - mx * w1 - my * w2
        ax, ay, bx, by = _force(at[k], cog)
        load = inside / scale * cog[2]
        for r in range(len(pushes)):
            nx, ny = pushes[r, 0] / scale + load * w1, pushes[r, 1] / scale + load * w2
            turn = pushes[r, 2] / scale
            a[k, first + r] = nx * ax + ny * ay + turn * at[k, 2]
            b[k, first + r] = nx * bx + ny * by + turn * at[k, 6]
            c[k, first + r] = inside * w0 * gravity / scale


@kernel(nogil=True)
def tip_rows(
    at: Array,
    arms: Array,
    cog: Array,
    reserve: float,
    smallest: float,
    first: int,
    a: Array,
    b: Array,
    c: Array,
    gravity: float,
) -> None:
    """As ``Tip``: the edge of the support that starts at each contact, if one does."""
    count = arms.shape[1]
    follows = np.empty(count, dtype=np.intp)
    for k in range(len(at)):
        ax, ay, bx, by = _force(at[k], cog)
        if k == 0 or not _surround(arms[k], follows):
            _support(arms[k], follows)
        for i in range(count):
            nx = ny = 0.0
            distance, after = 1.0 - reserve, follows[i]
            if after >= 0:
                ex, ey = arms[k, after, 0] - arms[k, i, 0], arms[k, after, 1] - arms[k, i, 1]
                size = np.sqrt(ex * ex + ey * ey)
                nx, ny = ey / size, -ex / size
                distance = nx * arms[k, i, 0] + ny * arms[k, i, 1] - reserve
            safe = max(distance, smallest)
            a[k, first + i] = -cog[2] * (nx * ax + ny * ay) / (safe * gravity)
            b[k, first + i] = -cog[2] * (nx * bx + ny * by) / (safe * gravity)
            c[k, first + i] = distance / safe


@kernel(nogil=True)
def _surround(arms: Array, follows: IndexArray) -> bool:
    """Whether the edges from contacts to those that follow still leave all others on their left."""
    for i in range(len(arms)):
        j = follows[i]
        if j < 0:
            continue
        ex, ey = arms[j, 0] - arms[i, 0], arms[j, 1] - arms[i, 1]
        if ex * ex + ey * ey < 1e-18:
            return False
        for m in range(len(arms)):
            if m != i and m != j:
                turn = ex * (arms[m, 1] - arms[i, 1]) - ey * (arms[m, 0] - arms[i, 0])
                if turn < 0:
                    return False
    return True


@kernel(nogil=True)
def _support(arms: Array, follows: IndexArray) -> None:
    """The contact to which an edge of the support leads from each contact, -1 where none starts."""
    count = len(arms)
    for i in range(count):
        best, follows[i] = 1e-9, -1
        for j in range(count):
            ex, ey = arms[j, 0] - arms[i, 0], arms[j, 1] - arms[i, 1]
            size = np.hypot(ex, ey)
            if j == i or size <= best:
                continue
            outer = True
            for m in range(count):
                turn = ex * (arms[m, 1] - arms[i, 1]) - ey * (arms[m, 0] - arms[i, 0])
                outer = outer and turn >= -1e-12
            if outer:
                best, follows[i] = size, j
