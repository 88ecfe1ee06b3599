"""Cubic splines through control points, as constant matrices.

On fixed knots the value and every derivative of a cubic spline are linear in the control values, so
one matrix a derivative, computed once, serves every candidate of a search: value = matrix @
control_values. Ends are natural (zero second derivative; [guzman2015], Eqn. 4.18) or clamped (given
first derivative; [waheed2006], Appendix 1). Plain NumPy on the matrices; the same matrices multiply
CasADi expressions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError


@dataclass(frozen=True)
class SplineBasis:
    """C2 cubic spline on ``knots`` (K >= 2, increasing), natural or clamped at either end.

    Control values are the K values at the knots, followed by the first derivative at the start (if
    ``clamped_start``) and at the end (if ``clamped_end``): ``size`` values in all.
    """

    knots: tuple[float, ...]
    clamped_start: bool = False
    clamped_end: bool = False

    def __post_init__(self) -> None:
        knots = np.asarray(self.knots, dtype=np.float64)
        if (
            knots.ndim != 1
            or knots.size < 2
            or not np.all(np.isfinite(knots))
            or np.any(np.diff(knots) <= 0)
        ):
            raise ArgumentError(
                "knots", self.knots, "at least two finite, strictly increasing knots"
            )

    @property
    def size(self) -> int:
        return len(self.knots) + int(self.clamped_start) + int(self.clamped_end)

    @cached_property
    def _knots(self) -> Array:
        return np.asarray(self.knots, dtype=np.float64)

    @cached_property
    def second_derivatives(self) -> Array:
        """(K, size): second derivatives at the knots = matrix @ control values.

        The tridiagonal system of every cubic-spline text: continuity of the first derivative
        inside, one end condition at each side.
        """
        k, h, n = len(self.knots), np.diff(self._knots), self.size
        left, right = np.zeros((k, k)), np.zeros((k, n))
        for i in range(1, k - 1):
            left[i, i - 1 : i + 2] = h[i - 1] / 6, (h[i - 1] + h[i]) / 3, h[i] / 6
            right[i, i - 1 : i + 2] = 1 / h[i - 1], -1 / h[i - 1] - 1 / h[i], 1 / h[i]
        left[0, 0] = left[-1, -1] = 1.0
        if self.clamped_start:
            left[0, :2] = h[0] / 3, h[0] / 6
            right[0, :2] = -1 / h[0], 1 / h[0]
            right[0, k] = -1.0
        if self.clamped_end:
            left[-1, -2:] = h[-1] / 6, h[-1] / 3
            right[-1, k - 2 : k] = 1 / h[-1], -1 / h[-1]
            right[-1, n - 1] += 1.0
        return np.asarray(np.linalg.solve(left, right))

    def matrix(self, u: Array, derivative: int = 0) -> Array:
        """(N, size): the spline's derivative of order 0..3 at parameters ``u`` (N,) = matrix @
        values.

        At a knot the third derivative is that of the segment to the right (of the last, at the
        end). Parameters beyond the ends continue the first and last cubic.
        """
        if derivative not in (0, 1, 2, 3):
            raise ArgumentError("derivative", derivative, "an order from 0 to 3")
        u = np.atleast_1d(np.asarray(u, dtype=np.float64))
        i = np.clip(np.searchsorted(self._knots, u, side="right") - 1, 0, len(self.knots) - 2)
        h = (self._knots[i + 1] - self._knots[i])[:, None]
        b = ((u - self._knots[i])[:, None]) / h
        a = 1.0 - b
        rows = np.arange(u.size)
        result = np.zeros((u.size, self.size))
        if derivative == 0:
            result[rows, i], result[rows, i + 1] = a[:, 0], b[:, 0]
            weights = (a**3 - a) * h**2 / 6, (b**3 - b) * h**2 / 6
        elif derivative == 1:
            result[rows, i], result[rows, i + 1] = -1 / h[:, 0], 1 / h[:, 0]
            weights = -(3 * a**2 - 1) * h / 6, (3 * b**2 - 1) * h / 6
        elif derivative == 2:
            weights = a, b
        else:
            weights = -1 / h, 1 / h
        m = self.second_derivatives
        result += weights[0] * m[i] + weights[1] * m[i + 1]
        return result

    def polynomials(self, values: Array) -> Array:
        """(K - 1, 4, ...): coefficients of 1, t, t^2, t^3 on each segment, t counted from its left
        knot.

        ``values`` (size, ...) are control values. For repeated evaluation; the same spline as
        ``matrix``.
        """
        left = self._knots[:-1]
        parts = [
            self.matrix(left, k) @ values / f for k, f in ((0, 1.0), (1, 1.0), (2, 2.0), (3, 6.0))
        ]
        return np.stack(parts, axis=1)


@lru_cache(maxsize=32)
def uniform_basis(points: int) -> SplineBasis:
    """Natural spline on knots 1, 2, ..., ``points``: [guzman2015]'s parametrisation for four
    points."""
    return SplineBasis(tuple(float(i) for i in range(1, points + 1)))


def chord_length_knots(points: Array) -> tuple[float, ...]:
    """Knots spaced by the distance between consecutive points (N, D), starting at 0.

    Raises ArgumentError when two consecutive points coincide.
    """
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if np.any(chords <= 0):
        where = int(np.argmin(chords))
        raise ArgumentError(
            f"points[{where + 1}]",
            points[where + 1].tolist(),
            f"a point different from points[{where}]: a path cannot stand still",
        )
    return tuple(np.concatenate([[0.0], np.cumsum(chords)]).tolist())
