"""A path: control points, a heading rule, and the path parameter that time scaling works on.

Two parameters appear. ``u`` is the spline parameter (knots). ``s`` is the path parameter: arc
length where the robot drives along its heading, and the integral of sqrt(dx^2 + dy^2 + (L dpsi)^2)
where it can turn on the spot (L = ``turning_length``), so that a pure turn has a length too.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.paths.spline import SplineBasis, chord_length_knots

_STANDSTILL_SAMPLES = 9  # a segment, before roots are looked for; chosen
_CELLS_PER_SEGMENT = (
    64  # quadrature cells a spline segment: length error below 1e-12 on smooth paths
)
_LARGEST = 1e7  # m (and rad): farther than any robot drives; squares of it keep nine digits of a metre. Chosen
_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(5)


@dataclass(frozen=True)
class Path:
    """Cubic spline path. Build it with ``Path.through`` or from a basis and control values.

    ``coordinates`` (size, 2 or 3): control values of x, y(, z), m. ``heading`` (size,): control
    values of the yaw angle (rad) for robots that choose it, None where yaw is the direction of
    travel. ``turning_length`` (m) is used only with a heading.
    """

    basis: SplineBasis
    coordinates: Array
    heading: Array | None = None
    turning_length: float = 1.0

    def __post_init__(self) -> None:
        shape = np.shape(self.coordinates)
        if len(shape) != 2 or shape[0] != self.basis.size or shape[1] not in (2, 3):
            raise ArgumentError(
                "coordinates", shape, f"shape ({self.basis.size}, 2) or ({self.basis.size}, 3)"
            )
        for name, values in (("coordinates", self.coordinates), ("heading", self.heading)):
            if values is not None:
                _check_size(name, values)
        if self.heading is not None and np.shape(self.heading) != (self.basis.size,):
            raise ArgumentError("heading", np.shape(self.heading), f"shape ({self.basis.size},)")
        if not 0 < self.turning_length < np.inf:
            raise ArgumentError("turning_length", self.turning_length, "a finite length > 0 m")
        if (
            self.heading is not None
            and shape[1] == 3
            and np.ptp(self.coordinates[: len(self.basis.knots), 2]) > 0
        ):
            raise ArgumentError(
                "heading",
                np.asarray(self.heading).tolist(),
                "None on a path that climbs: a heading of its own is for level ground",
            )

    @classmethod
    def through(
        cls,
        points: ArrayLike,
        *,
        heading: ArrayLike | None = None,
        knots: ArrayLike | None = None,
        start_direction: ArrayLike | None = None,
        end_direction: ArrayLike | None = None,
        turning_length: float = 1.0,
    ) -> Path:
        """Spline through ``points`` (N, 2) or (N, 3), m; ``heading`` (N,), rad, or None for the
        tangent's.

        ``knots`` (N,) default to chord lengths. ``start_direction`` and ``end_direction`` (2 or 3
        numbers) are the first derivatives with respect to the knots' parameter; without them the
        ends are natural. Raises ArgumentError for fewer than two points, coinciding neighbours, or
        numbers that are not finite.
        """
        array = np.asarray(points, dtype=np.float64)
        if array.ndim != 2 or array.shape[0] < 2 or array.shape[1] not in (2, 3):
            raise ArgumentError("points", array.shape, "shape (N, 2) or (N, 3) with N >= 2")
        _check_size("points", array)
        given = (
            chord_length_knots(array)
            if knots is None
            else tuple(np.asarray(knots, dtype=float).tolist())
        )
        if len(given) != len(array):
            raise ArgumentError("knots", len(given), f"one knot a point ({len(array)})")
        basis = SplineBasis(given, start_direction is not None, end_direction is not None)
        ends = [
            np.asarray(d, dtype=np.float64)
            for d in (start_direction, end_direction)
            if d is not None
        ]
        for end in ends:
            if end.shape != (array.shape[1],):
                raise ArgumentError("direction", end.tolist(), f"{array.shape[1]} numbers")
        coordinates = np.vstack([array, *ends]) if ends else array
        yaw = None
        if heading is not None:
            yaw = np.asarray(heading, dtype=np.float64)
            if yaw.shape != (len(array),):
                raise ArgumentError(
                    "heading", yaw.shape, f"one angle a point, shape ({len(array)},)"
                )
            span = (yaw[-1] - yaw[0]) / (
                given[-1] - given[0]
            )  # ends turn at the mean rate, if clamped
            yaw = np.concatenate([yaw, np.full(len(ends), span)])
        return cls(basis, coordinates, yaw, turning_length)

    @property
    def points(self) -> Array:
        """(K, 2 or 3): the control points, without end derivatives."""
        return self.coordinates[: len(self.basis.knots)]

    @property
    def start(self) -> float:
        """First spline parameter."""
        return self.basis.knots[0]

    @property
    def end(self) -> float:
        """Last spline parameter."""
        return self.basis.knots[-1]

    def position(self, u: ArrayLike, derivative: int = 0) -> Array:
        """(N, 3): x, y, z (m) or their derivative with respect to u, at spline parameters (N,)."""
        value = self._evaluate(u, derivative)
        if self.heading is not None:
            value = value[:, :-1]
        return value if value.shape[1] == 3 else np.column_stack([value, np.zeros(len(value))])

    def yaw(self, u: ArrayLike, derivative: int = 0) -> Array:
        """(N,): heading angle, rad, or its derivative with respect to u (order 0..3; 0 or 1 for
        tangents).

        With tangent heading, the angle is continuous along increasing ``u``.
        """
        if self.heading is not None:
            return self._evaluate(u, derivative)[:, -1]
        d = self.position(u, 1)
        if derivative == 0:
            return np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
        if derivative != 1:
            raise ArgumentError(
                "derivative", derivative, "0 or 1 where yaw is the direction of travel"
            )
        dd = self.position(u, 2)
        return np.asarray((d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]) / (d[:, 0] ** 2 + d[:, 1] ** 2))

    @cached_property
    def _cubics(self) -> tuple[Array, Array]:
        """Knots (K,) and coefficients (K-1, 4, D) of each segment in powers of u - knot; heading
        comes last."""
        values = self.coordinates
        if self.heading is not None:
            values = np.column_stack([values, self.heading])
        knots = np.asarray(self.basis.knots, dtype=np.float64)
        y, m, h = (
            values[: len(knots)],
            self.basis.second_derivatives @ values,
            np.diff(knots)[:, None],
        )
        first = np.diff(y, axis=0) / h - h * (2 * m[:-1] + m[1:]) / 6
        return knots, np.stack([y[:-1], first, m[:-1] / 2, np.diff(m, axis=0) / (6 * h)], axis=1)

    def _evaluate(self, u: ArrayLike, derivative: int) -> Array:
        """(N, D): derivative 0..3 at u, segment by segment; at a knot, of the segment to the right.

        The same function as ``basis.matrix(u, derivative) @ values``, in a tenth of the time for
        many points.
        """
        if derivative not in (0, 1, 2, 3):
            raise ArgumentError("derivative", derivative, "an order from 0 to 3")
        knots, cubics = self._cubics
        u = np.atleast_1d(np.asarray(u, dtype=np.float64))
        i = np.clip(np.searchsorted(knots, u, side="right") - 1, 0, len(cubics) - 1)
        t, c = (u - knots[i])[:, None], cubics[i]
        if derivative == 0:
            return np.asarray(c[:, 0] + t * (c[:, 1] + t * (c[:, 2] + t * c[:, 3])))
        if derivative == 1:
            return np.asarray(c[:, 1] + t * (2 * c[:, 2] + t * (3 * c[:, 3])))
        return np.asarray(2 * c[:, 2] + 6 * t * c[:, 3] if derivative == 2 else 6 * c[:, 3])

    def rate(self, u: ArrayLike) -> Array:
        """(N,): ds/du, the speed of the path parameter along the spline parameter."""
        squares = np.sum(self.position(u, 1) ** 2, axis=1)
        if self.heading is not None:
            squares = squares + (self.turning_length * self.yaw(u, 1)) ** 2
        return np.asarray(np.sqrt(squares))

    def standstill(self, share: float) -> float | None:
        """Spline parameter u where ds/du is below ``share`` of its mean, where the path stands
        still or doubles back; None where there is no such place.

        Exact: on a segment (ds/du)^2 is a quartic, least at an end or at a root of its derivative.
        Segments whose ds/du cannot fall to zero between samples, since its slope is bounded, are
        passed over.
        """
        knots, cubics = self._cubics
        scale = np.ones(cubics.shape[2])
        if self.heading is not None:
            scale[-1] = self.turning_length
        _, b, c, d = np.moveaxis(cubics * scale, 1, 0)
        widths = np.diff(knots)
        inside = widths[:, None] * np.linspace(0.0, 1.0, _STANDSTILL_SAMPLES)
        rates = np.linalg.norm(
            b[:, None] + inside[..., None] * (2 * c[:, None] + 3 * inside[..., None] * d[:, None]),
            axis=2,
        )
        steepest = np.maximum(
            np.linalg.norm(2 * c, axis=1), np.linalg.norm(2 * c + 6 * widths[:, None] * d, axis=1)
        )
        possible = rates.min(axis=1) <= steepest * widths / (_STANDSTILL_SAMPLES - 1)
        places = [knots]
        for k in np.flatnonzero(possible):
            slope = [
                18 * d[k] @ d[k],
                18 * c[k] @ d[k],
                4 * c[k] @ c[k] + 6 * b[k] @ d[k],
                2 * b[k] @ c[k],
            ]
            roots = np.roots(slope)
            here = roots.real[np.abs(roots.imag) <= 1e-6 * widths[k]]
            places.append(knots[k] + here[(here > 0) & (here < widths[k])])
        u = np.concatenate(places)
        slow = self.rate(u)
        at = int(np.argmin(slow))
        return float(u[at]) if slow[at] < share * self.length / (self.end - self.start) else None

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        """Spline parameters of the quadrature cells and the path parameter there."""
        cells = [
            np.linspace(a, b, _CELLS_PER_SEGMENT, endpoint=False)
            for a, b in zip(self.basis.knots[:-1], self.basis.knots[1:], strict=True)
        ]
        u = np.concatenate([*cells, [self.end]])
        lengths = self._integrate(u[:-1], u[1:])
        return u, np.concatenate([[0.0], np.cumsum(lengths)])

    def _integrate(self, a: Array, b: Array) -> Array:
        """Path parameter gained from a to b (each inside one quadrature cell)."""
        half = (b - a) / 2
        nodes = (a + b)[:, None] / 2 + half[:, None] * _GAUSS_X
        return np.asarray((self.rate(nodes.ravel()).reshape(nodes.shape) @ _GAUSS_W) * half)

    @property
    def length(self) -> float:
        """Total path parameter: arc length (m), or the mixed length where heading is free."""
        return float(self._table[1][-1])

    @cached_property
    def knot_parameters(self) -> Array:
        """(K,): path parameter s at the knots."""
        return self.parameter(np.asarray(self.basis.knots))

    def parameter(self, u: ArrayLike) -> Array:
        """(N,): path parameter s at spline parameters u."""
        grid, s = self._table
        u = np.atleast_1d(np.asarray(u, dtype=np.float64))
        i = np.clip(np.searchsorted(grid, u, side="right") - 1, 0, len(grid) - 2)
        return np.asarray(s[i] + self._integrate(grid[i], u))

    def locate(self, s: ArrayLike) -> Array:
        """(N,): spline parameter u at path parameters s in [0, length]; Newton on the arc
        length."""
        grid, table = self._table
        s = np.clip(np.atleast_1d(np.asarray(s, dtype=np.float64)), 0.0, self.length)
        u = np.interp(s, table, grid)
        i = np.clip(np.searchsorted(table, s, side="right") - 1, 0, len(grid) - 2)
        for _ in range(4):
            residual = table[i] + self._integrate(grid[i], u) - s
            rate = self.rate(u)
            u = np.clip(u - residual / np.where(rate > 0, rate, np.inf), grid[i], grid[i + 1])
        return np.asarray(u)


def _check_size(name: str, values: Array) -> None:
    if not np.all(np.abs(values) <= _LARGEST):  # NaN is refused too
        raise ArgumentError(
            name, np.asarray(values).tolist(), f"finite numbers, at most {_LARGEST:g} in size"
        )
