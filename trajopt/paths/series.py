"""Truncated Taylor series: a value along the path together with its derivatives, as one number.

``c[k]`` is the k-th derivative divided by k!, so products are convolutions, and formulas for a
posture are written once for the value and carry their derivatives with them. Vectors are tuples of
three series.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial
from typing import Any

import numpy as np

from trajopt.arrays import Array


@dataclass(frozen=True, eq=False)
class Series:
    """Taylor coefficients ``c`` (K+1, N) at N places: order K. Results have the lower order of
    their operands."""

    c: Array

    __array_priority__ = 1000.0  # NumPy numbers on the left leave operators to this class

    @classmethod
    def of(cls, derivatives: Sequence[Any], order: int) -> Series:
        """Of value, first, second, ... derivative (each (N,)); those not given are zero."""
        known = [np.asarray(d) / factorial(k) for k, d in enumerate(derivatives[: order + 1])]
        c = np.zeros((order + 1, *np.shape(known[0])))
        c[: len(known)] = known
        return cls(c)

    @property
    def order(self) -> int:
        return len(self.c) - 1

    def at(self, order: int) -> Array:
        """(N,): the derivative of that order."""
        return np.asarray(self.c[order] * factorial(order))

    def d(self) -> Series:
        """The derivative, one order shorter."""
        return Series(self.c[1:] * np.arange(1, len(self.c)).reshape(-1, *[1] * (self.c.ndim - 1)))

    def cut(self, order: int) -> Series:
        """The same, to a lower order."""
        return Series(self.c[: order + 1])

    def steps(self, order: int) -> list[Series]:
        """Powers 0 to ``order`` of the change from the value, as series of that order."""
        change = self.c[: order + 1].copy()
        change[0] = 0.0
        powers = [Series.of([np.ones_like(change[0])], order)]
        for _ in range(order):
            powers.append(powers[-1] * Series(change))
        return powers

    def __neg__(self) -> Series:
        return Series(-self.c)

    def __add__(self, other: Series | float | Array) -> Series:
        if isinstance(other, Series):
            n = min(len(self.c), len(other.c))
            return Series(self.c[:n] + other.c[:n])
        c = self.c.copy()
        c[0] += other
        return Series(c)

    __radd__ = __add__

    def __sub__(self, other: Series | float | Array) -> Series:
        return self + (-other)

    def __rsub__(self, other: float | Array) -> Series:
        return -self + other

    def __mul__(self, other: Series | float | Array) -> Series:
        if not isinstance(other, Series):
            return Series(self.c * other)
        n = min(len(self.c), len(other.c))
        return Series(
            np.stack([sum(self.c[j] * other.c[k - j] for j in range(k + 1)) for k in range(n)])
        )

    __rmul__ = __mul__

    def __truediv__(self, other: Series | float | Array) -> Series:
        if not isinstance(other, Series):
            return Series(self.c / other)
        n, q = min(len(self.c), len(other.c)), list[Array]()
        for k in range(n):
            rest = sum((q[j] * other.c[k - j] for j in range(k)), np.zeros_like(self.c[0]))
            q.append((self.c[k] - rest) / other.c[0])
        return Series(np.stack(q))

    def sqrt(self) -> Series:
        """Square root, of values > 0."""
        r = [np.sqrt(self.c[0])]
        for k in range(1, len(self.c)):
            rest = sum((r[j] * r[k - j] for j in range(1, k)), np.zeros_like(r[0]))
            r.append((self.c[k] - rest) / (2 * r[0]))
        return Series(np.stack(r))


Vector = tuple[Series, Series, Series]


def cos_sin(angle: Series) -> tuple[Series, Series]:
    """Cosine and sine."""
    cos, sin, rate = [np.cos(angle.c[0])], [np.sin(angle.c[0])], angle.d().c
    for k in range(len(rate)):
        cos.append(-sum(sin[j] * rate[k - j] for j in range(k + 1)) / (k + 1))
        sin.append(sum(cos[j] * rate[k - j] for j in range(k + 1)) / (k + 1))
    return Series(np.stack(cos)), Series(np.stack(sin))


def dot(a: Vector, b: Vector) -> Series:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def scaled(a: Vector, by: Series) -> Vector:
    return a[0] * by, a[1] * by, a[2] * by


def unit(a: Vector) -> Vector:
    """The vector divided by its length (> 0)."""
    length = dot(a, a).sqrt()
    return a[0] / length, a[1] / length, a[2] / length
