"""How castors swivel along the cells of a grid, and where they stand, compiled."""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.kernels import kernel
from trajopt.paths.find import cell_at
from trajopt.robots.swivel import Complex
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
    # (a z + b) / (conj(b) z + conj(a)) with |z| = 1: the denominator is z conj(numerator).
    n = complex(ch, p * sh) * z + q * sh
    new = n * n * z.conjugate() * (1 / (n.real * n.real + n.imag * n.imag))
    return new * (1.5 - 0.5 * (new.real * new.real + new.imag * new.imag))  # stays on the circle


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
) -> Complex:
    """(P, C): directions of castors, exp(i angle), at the places u (P,) of cells (``Cells``), whose
    features are ``at``, from ``start`` (C,), rad, on.

    As ``robots/steering``: z = exp(i direction) obeys Riccati's equation, which a stretch of path
    solves as a Moebius map of SU(1,1): from a place to the next but one by the fourth-order Magnus
    expansion on the three, to the place between by the integral of the parabola through them. Where
    a pivot goes farther than half of its trail the stretch is cut.
    """
    count, node = len(trail), np.sqrt(3.0) / 6
    found = np.empty((len(u), count), dtype=np.complex128)
    z = np.empty(count, dtype=np.complex128)
    for c in range(count):
        z[c] = complex(np.cos(start[c]), np.sin(start[c]))
    f = np.empty((2, FEATURES))
    i = 0
    for cell in range(len(d)):
        for c in range(count):
            found[left[cell], c] = z[c]
        for half in range(2):
            j = left[cell] + 2 * half
            k = right[cell] if half else j + 2
            h = d[cell] / 2
            i = cell_at(knots, len(cubics), u[j], i)
            gone = 0.0
            for c in range(count):
                px, py = pivots[c, 0], pivots[c, 1]
                v0 = complex(at[j, 0] - at[j, 2] * py, at[j, 1] + at[j, 2] * px)
                vm = complex(at[j + 1, 0] - at[j + 1, 2] * py, at[j + 1, 1] + at[j + 1, 2] * px)
                v1 = complex(at[k, 0] - at[k, 2] * py, at[k, 1] + at[k, 2] * px)
                fastest = max(
                    v0.real * v0.real + v0.imag * v0.imag,
                    vm.real * vm.real + vm.imag * vm.imag,
                    v1.real * v1.real + v1.imag * v1.imag,
                )
                gone = max(gone, h * np.sqrt(fastest) / trail[c])
                p0, pm, p1 = -at[j, 2] / 2, -at[j + 1, 2] / 2, -at[k, 2] / 2
                by = 0.5 / trail[c]
                q0, qm, q1 = v0 * by, vm * by, v1 * by
                cross, third, before = h * h / 12, h / 24, z[c]
                p = h / 6 * (p0 + 4 * pm + p1) - cross * 2 * (q0 * q1.conjugate()).imag
                q = h / 6 * (q0 + 4 * qm + q1) - cross * 2j * (p0 * q1 - p1 * q0)
                found[j + 1, c] = _turned(
                    third * (5 * p0 + 8 * pm - p1), third * (5 * q0 + 8 * qm - q1), before
                )
                found[k, c] = _turned(p, q, before)
            if gone >= 0.5:
                parts = 2 * min(int(np.ceil(gone / 0.5)), 1000)
                step = (u[k] - u[j]) / parts
                for part in range(parts):
                    place = u[j] - knots[i] + part * step
                    g0 = step * feature(cubics[i], place + step * (0.5 - node), length, free, f[0])
                    g1 = step * feature(cubics[i], place + step * (0.5 + node), length, free, f[1])
                    w0, w1 = f[0, 2] * g0, f[1, 2] * g1
                    p0, p1, cross = -w0 / 2, -w1 / 2, node / 2
                    for c in range(count):
                        px, py = pivots[c, 0], pivots[c, 1]
                        q0 = complex(f[0, 0] * g0 - w0 * py, f[0, 1] * g0 + w0 * px)
                        q1 = complex(f[1, 0] * g1 - w1 * py, f[1, 1] * g1 + w1 * px)
                        q0, q1 = q0 * (0.5 / trail[c]), q1 * (0.5 / trail[c])
                        p = 0.5 * (p0 + p1) - cross * 2 * (q0 * q1.conjugate()).imag
                        q = 0.5 * (q0 + q1) - cross * 2j * (p0 * q1 - p1 * q0)
                        z[c] = _turned(p, q, z[c])
                        if part == parts // 2 - 1:
                            found[j + 1, c] = z[c]
                        found[k, c] = z[c]
            else:
                for c in range(count):
                    z[c] = found[k, c]
    return found


@kernel(nogil=True)
def standing(
    directions: Complex, place: Array, trail: Array, lateral: Array, castors: IndexArray, cog: Array
) -> Array:
    """(P, K, 2): contacts from the foot of the centre of gravity, m, at castors' directions
    (P, C), exp(i angle); ``place`` (K, 2) of wheels and pivots."""
    found = np.empty((len(directions), len(place), 2))
    for k in range(len(directions)):
        for i in range(len(place)):
            found[k, i, 0], found[k, i, 1] = place[i, 0] - cog[0], place[i, 1] - cog[1]
        for c in range(len(castors)):
            i = castors[c]
            cos, sin = directions[k, c].real, directions[k, c].imag
            found[k, i, 0] += -trail[c] * cos - lateral[c] * sin
            found[k, i, 1] += -trail[c] * sin + lateral[c] * cos
    return found
