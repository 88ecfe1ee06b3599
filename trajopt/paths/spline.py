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

from trajopt.arrays import Array, as_numbers
from trajopt.errors import ArgumentError

_DENSE = 48  # unknowns up to which a dense solve is faster than loading scipy.linalg; chosen


@dataclass(frozen=True)
class SplineBasis:
    """C2 cubic spline on ``knots`` (K >= 2, increasing), natural or clamped at either end, or
    ``closed``: it leaves the last knot as it left the first, with the same first and second
    derivative.

    Control values are the K values at the knots, followed by the first derivative at the start (if
    ``clamped_start``) and at the end (if ``clamped_end``): ``size`` values in all. Raises
    ArgumentError for other knots, a closed spline with clamped ends or fewer than three knots.
    """

    knots: tuple[float, ...]
    clamped_start: bool = False
    clamped_end: bool = False
    closed: bool = False

    def __post_init__(self) -> None:
        expected = "at least two finite, strictly increasing knots"
        knots = as_numbers("knots", self.knots, expected)
        if (
            knots.ndim != 1
            or knots.size < 2
            or not np.all(np.isfinite(knots))
            or np.any(np.diff(knots) <= 0)
        ):
            raise ArgumentError("knots", self.knots, expected)
        if self.closed and (self.clamped_start or self.clamped_end or knots.size < 3):
            raise ArgumentError("closed", True, "three or more knots and no end directions")

    @property
    def size(self) -> int:
        return len(self.knots) + int(self.clamped_start) + int(self.clamped_end)

    @cached_property
    def _knots(self) -> Array:
        return np.asarray(self.knots, dtype=np.float64)

    @cached_property
    def second_derivatives(self) -> Array:
        """(K, size): second derivatives at the knots = matrix @ control values."""
        return self.bends(np.eye(self.size))

    def bends(self, values: Array) -> Array:
        """(K, D): second derivatives at the knots of the spline with control values (size, D).

        The tridiagonal system of every cubic-spline text: continuity of the first derivative
        inside, one end condition at each side; in time that grows as K.
        """
        k, h = len(self.knots), np.diff(self._knots)
        slope = np.diff(values[:k], axis=0) / h[:, None]
        right = np.zeros((k, values.shape[1]))
        right[1:-1] = np.diff(slope, axis=0)
        lower, diagonal, upper = np.zeros(k), np.ones(k), np.zeros(k)
        lower[:-2], upper[2:] = h[:-1] / 6, h[1:] / 6  # as solve_banded stores them
        diagonal[1:-1] = (h[:-1] + h[1:]) / 3
        if self.closed:
            diagonal[0], right[0] = (h[-1] + h[0]) / 3, slope[0] - slope[-1]
            upper[1] = h[0] / 6
            inside = _cyclic(lower[:-1], diagonal[:-1], upper[:-1], h[-1] / 6, right[:-1])
            return np.vstack([inside, inside[:1]])
        if self.clamped_start:
            diagonal[0], upper[1] = h[0] / 3, h[0] / 6
            right[0] = slope[0] - values[k]
        if self.clamped_end:
            diagonal[-1], lower[-2] = h[-1] / 3, h[-1] / 6
            right[-1] = values[-1] - slope[-1]
        return _banded(lower, diagonal, upper, right)

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


def _banded(lower: Array, diagonal: Array, upper: Array, right: Array) -> Array:
    """Solution (K, D) of a tridiagonal system whose bands (K,) are stored as in
    scipy.linalg.solve_banded."""
    if len(diagonal) <= _DENSE:
        matrix = np.diag(diagonal) + np.diag(upper[1:], 1) + np.diag(lower[:-1], -1)
        return np.asarray(np.linalg.solve(matrix, right))
    from scipy.linalg import solve_banded

    bands = np.stack([upper, diagonal, lower])
    return np.asarray(solve_banded((1, 1), bands, right, check_finite=False))


def _cyclic(lower: Array, diagonal: Array, upper: Array, corner: float, right: Array) -> Array:
    """As ``_banded``, with ``corner`` in both other corners of the matrix (Sherman and Morrison)."""
    turn = -diagonal[0]
    diagonal, u = diagonal.copy(), np.zeros((len(diagonal), 1))
    diagonal[0] -= turn
    diagonal[-1] -= corner**2 / turn
    u[0], u[-1] = turn, corner
    both = _banded(lower, diagonal, upper, np.hstack([right, u]))
    y, q = both[:, :-1], both[:, -1:]
    share = (y[0] + y[-1] * corner / turn) / (1 + q[0] + q[-1] * corner / turn)
    return np.asarray(y - q * share)


def chord_length_knots(points: Array) -> tuple[float, ...]:
    """Knots spaced by the distance between consecutive points (N, D), starting at 0.

    Raises ArgumentError when two consecutive points coincide.
    """
    chords = np.sqrt(np.sum(np.diff(points, axis=0) ** 2, axis=1))
    if np.any(chords <= 0):
        where = int(np.argmin(chords))
        raise ArgumentError(
            f"points[{where + 1}]",
            points[where + 1].tolist(),
            f"a point different from points[{where}]: a path cannot stand still",
        )
    return tuple(np.concatenate([[0.0], np.cumsum(chords)]).tolist())
