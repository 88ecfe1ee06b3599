"""How castors swivel along the cells of a grid, and where they stand, compiled."""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.kernels import kernel
from trajopt.timing.planar_kernel import FEATURES, feature


@kernel(nogil=True)
def _turned(p: float, q: complex, z: complex) -> complex:
    """z after the Moebius map exp [[i p, q], [conj(q), -i p]]."""
    square = q.real * q.real + q.imag * q.imag - p * p
    if abs(square) < 1e-4:
        ch, sh = 1 + square / 2 * (1 + square / 12), 1 + square / 6 * (1 + square / 20)
    elif square > 0:
        root = np.sqrt(square)
        ch, sh = np.cosh(root), np.sinh(root) / root
    else:
        root = np.sqrt(-square)
        ch, sh = np.cos(root), np.sin(root) / root
    ma, mb = complex(ch, p * sh), q * sh
    new = (ma * z + mb) / (mb.conjugate() * z + ma.conjugate())
    return new / abs(new)


@kernel(nogil=True)
def swivels(
    knots: Array,
    cubics: Array,
    length: float,
    free: bool,
    u: Array,
    at: Array,
    left: IndexArray,
    right: IndexArray,
    d: Array,
    pivots: Array,
    trail: Array,
    start: Array,
) -> Array:
    """(P, C): directions of castors, rad, at the places u (P,) of cells (``Cells``), whose features
    are ``at``, from ``start`` (C,) on.

    As ``robots/steering``: z = exp(i direction) obeys Riccati's equation, which a stretch of path
    solves as a Moebius map of SU(1,1): from a place to the next but one by the fourth-order Magnus
    expansion on the three, to the place between by the integral of the parabola through them. Where
    a pivot goes farther than a quarter of its trail the stretch is cut.
    """
    count, node = len(trail), np.sqrt(3.0) / 6
    found = np.empty((len(u), count))
    z = np.exp(1j * start)
    angle = start.copy()
    f = np.empty((2, FEATURES))
    segments = np.searchsorted(knots, u, side="right") - 1
    for cell in range(len(d)):
        found[left[cell]] = angle
        for half in range(2):
            j = left[cell] + 2 * half
            k = right[cell] if half else j + 2
            h = d[cell] / 2
            i = min(max(segments[j], 0), len(cubics) - 1)
            for c in range(count):
                px, py = pivots[c, 0], pivots[c, 1]
                v0 = complex(at[j, 0] - at[j, 2] * py, at[j, 1] + at[j, 2] * px)
                vm = complex(at[j + 1, 0] - at[j + 1, 2] * py, at[j + 1, 1] + at[j + 1, 2] * px)
                v1 = complex(at[k, 0] - at[k, 2] * py, at[k, 1] + at[k, 2] * px)
                before = z[c]
                gone = h * max(abs(v0), abs(vm), abs(v1)) / trail[c]
                if gone < 0.25:
                    p0, pm, p1 = -at[j, 2] / 2, -at[j + 1, 2] / 2, -at[k, 2] / 2
                    q0, qm, q1 = v0 / (2 * trail[c]), vm / (2 * trail[c]), v1 / (2 * trail[c])
                    cross = h * h / 12
                    p = h / 6 * (p0 + 4 * pm + p1) - cross * 2 * (q0 * q1.conjugate()).imag
                    q = h / 6 * (q0 + 4 * qm + q1) - cross * 2j * (p0 * q1 - p1 * q0)
                    third = h / 24
                    middle = _turned(
                        third * (5 * p0 + 8 * pm - p1), third * (5 * q0 + 8 * qm - q1), before
                    )
                    z[c] = _turned(p, q, before)
                else:
                    parts = 2 * min(int(np.ceil(gone / 0.25)), 1000)
                    step, middle = (u[k] - u[j]) / parts, before
                    for part in range(parts):
                        place = u[j] - knots[i] + part * step
                        g0 = step * feature(
                            cubics[i], place + step * (0.5 - node), length, free, f[0]
                        )
                        g1 = step * feature(
                            cubics[i], place + step * (0.5 + node), length, free, f[1]
                        )
                        w0, w1 = f[0, 2] * g0, f[1, 2] * g1
                        q0 = complex(f[0, 0] * g0 - w0 * py, f[0, 1] * g0 + w0 * px) / (
                            2 * trail[c]
                        )
                        q1 = complex(f[1, 0] * g1 - w1 * py, f[1, 1] * g1 + w1 * px) / (
                            2 * trail[c]
                        )
                        p0, p1, cross = -w0 / 2, -w1 / 2, node / 2
                        p = (p0 + p1) / 2 - cross * 2 * (q0 * q1.conjugate()).imag
                        q = (q0 + q1) / 2 - cross * 2j * (p0 * q1 - p1 * q0)
                        z[c] = _turned(p, q, z[c])
                        if part == parts // 2 - 1:
                            middle = z[c]
                turned = middle * before.conjugate()
                found[j + 1, c] = angle[c] + np.arctan2(turned.imag, turned.real)
                turned = z[c] * before.conjugate()
                angle[c] += np.arctan2(turned.imag, turned.real)
            found[k] = angle
    return found


@kernel(nogil=True)
def standing(
    directions: Array, place: Array, trail: Array, lateral: Array, castors: IndexArray, cog: Array
) -> Array:
    """(P, K, 2): contacts from the foot of the centre of gravity, m, at castors' directions
    (P, C); ``place`` (K, 2) of wheels and pivots."""
    found = np.empty((len(directions), len(place), 2))
    for k in range(len(directions)):
        for i in range(len(place)):
            found[k, i, 0], found[k, i, 1] = place[i, 0] - cog[0], place[i, 1] - cog[1]
        for c in range(len(castors)):
            i = castors[c]
            cos, sin = np.cos(directions[k, c]), np.sin(directions[k, c])
            found[k, i, 0] += -trail[c] * cos - lateral[c] * sin
            found[k, i, 1] += -trail[c] * sin + lateral[c] * cos
    return found
