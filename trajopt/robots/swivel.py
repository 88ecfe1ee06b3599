"""How castors swivel over a stretch of path.

The direction of a castor obeys beta' = v.n / trail - w (see ``robots/steering.py``). In
z = exp(i (angle + beta)), with v a complex number, that is Riccati's equation,
z' = (v - conj(v) z^2) / (2 trail) - i w z, so a stretch of path acts on z as a Moebius map of
SU(1,1): z -> (a z + b) / (conj(b) z + conj(a)), which the sixth-order Magnus expansion
gives for all stretches at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from trajopt.arrays import Array

Complex = np.ndarray[tuple[int, ...], np.dtype[np.complex128]]


class _Turn(NamedTuple):
    """Matrices [[i p, q], [conj(q), -i p]] of su(1,1), arrays (M, C)."""

    p: Array
    q: Complex

    def __add__(self, other: tuple[Any, ...]) -> _Turn:
        return _Turn(self.p + other[0], self.q + other[1])

    def __sub__(self, other: _Turn) -> _Turn:
        return _Turn(self.p - other.p, self.q - other.q)

    def __mul__(self, factor: Any) -> _Turn:
        return _Turn(self.p * factor, self.q * factor)

    def with_(self, other: _Turn) -> _Turn:
        """The commutator."""
        p, q = self
        return _Turn(2 * np.imag(q * np.conj(other.q)), 2j * (p * other.q - other.p * q))


@dataclass(frozen=True, eq=False)
class Swivel:
    """Moebius maps z -> (a z + b) / (conj(b) z + conj(a)) of M stretches of path for C castors."""

    a: Complex  # (M, C)
    b: Complex  # (M, C)

    @classmethod
    def of(cls, v: Complex, w: Array, length: Array, trail: Array) -> Swivel:
        """From pivot velocities v (M, 3, C) and yaw rates w (M, 3) at the three Gauss points of
        each stretch, per unit of its length (M,); trail (C,), m."""
        h = length[:, None]
        first, middle, last = (
            _Turn(-w[:, i, None] / 2 + np.zeros(trail.shape), v[:, i] / (2 * trail))
            for i in range(3)
        )
        a1 = middle * h
        a2 = (last - first) * (np.sqrt(15.0) / 3 * h)
        a3 = (last - middle * 2 + first) * (10 / 3 * h)
        c1 = a1.with_(a2)
        c2 = a1.with_(a3 * 2 + c1) * (-1 / 60)
        p, q = a1 + a3 * (1 / 12) + (a1 * -20 - a3 + c1).with_(a2 + c2) * (1 / 240)
        square = np.abs(q) ** 2 - p**2
        root = np.sqrt(np.abs(square))
        small = root < 1e-8
        safe = np.where(small, 1.0, root)
        c = np.where(square >= 0, np.cosh(root), np.cos(root))
        s = np.where(small, 1.0, np.where(square >= 0, np.sinh(safe), np.sin(safe)) / safe)
        return cls(c + 1j * p * s, q * s)

    def follow(self, angle: Array) -> Array:
        """(M+1, C): castors' directions, rad, continuous, from ``angle`` (C,) on."""
        z, first = np.empty((len(self.a) + 1, self.a.shape[1]), dtype=complex), np.exp(1j * angle)
        for k in range(self.a.shape[1]):
            at, column = complex(first[k]), [complex(first[k])]
            for a, b in zip(self.a[:, k].tolist(), self.b[:, k].tolist(), strict=True):
                at = (a * at + b) / (b.conjugate() * at + a.conjugate())
                at /= abs(at)
                column.append(at)
            z[:, k] = column
        turned = np.angle(z[1:] * np.conj(z[:-1]))
        return np.vstack([angle, angle + np.cumsum(turned, axis=0)])
