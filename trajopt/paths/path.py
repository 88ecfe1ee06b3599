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

from trajopt import arrays
from trajopt.arrays import Array, IndexArray, as_numbers, require_finite
from trajopt.errors import ArgumentError
from trajopt.paths.points import default_knots, finite_numbers, lap
from trajopt.paths.spline import SplineBasis

_SETTLED = 1e-14  # of the length: what halving a quadrature cell may change; chosen
_HALVINGS = 60  # of a quadrature cell at most: down to rounding
_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(8)


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
        if not isinstance(self.basis, SplineBasis):
            raise ArgumentError("basis", self.basis, "a SplineBasis")
        size = self.basis.size
        expected = f"numbers of shape ({size}, 2) or ({size}, 3)"
        shape = np.shape(finite_numbers("coordinates", self.coordinates, expected))
        if len(shape) != 2 or shape[0] != size or shape[1] not in (2, 3):
            raise ArgumentError("coordinates", shape, f"shape ({size}, 2) or ({size}, 3)")
        if self.heading is not None:
            finite_numbers("heading", self.heading, f"angles of shape ({size},)", (size,))
        arrays.require_positive("turning_length", self.turning_length, "m")
        climbs = shape[1] == 3 and np.ptp(self.coordinates[: len(self.basis.knots), 2]) > 0
        if self.heading is not None and climbs:
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
        closed: bool = False,
    ) -> Path:
        """Spline through ``points`` (N, 2) or (N, 3), m; ``heading`` (N,), rad, or None for the
        tangent's.

        ``knots`` (N,) default to chord lengths; where neighbours coincide but their headings differ
        (the robot turns on the spot), to the length of chord and turn together.
        ``start_direction`` and ``end_direction`` (2 or 3 numbers) are the first derivatives with
        respect to the knots' parameter; without them the ends are natural. ``closed``: a lap that
        ends as it began, on through its first point, which is added at the end unless it is there
        (``knots`` then count it); headings go on by the nearest number of whole turns.

        Raises ArgumentError for fewer than two points (a lap: three), neighbours that coincide, or
        numbers that are not finite.
        """
        arrays.require_flag("closed", closed)
        array = finite_numbers("points", points, "shape (N, 2) or (N, 3) with N >= 2")
        if array.ndim != 2 or array.shape[0] < 2 or array.shape[1] not in (2, 3):
            raise ArgumentError("points", array.shape, "shape (N, 2) or (N, 3) with N >= 2")
        yaw = None
        if heading is not None:
            expected = f"one angle a point, shape ({len(array)},)"
            yaw = finite_numbers("heading", heading, expected, (len(array),))
        if closed:
            array, yaw = lap(array, yaw)
        given = (
            default_knots(array, yaw, turning_length)
            if knots is None
            else tuple(as_numbers("knots", knots, "increasing numbers").ravel().tolist())
        )
        if len(given) != len(array):
            raise ArgumentError("knots", len(given), f"one knot a point ({len(array)})")
        both = (start_direction is not None, end_direction is not None)
        basis = SplineBasis(given, *both, closed=bool(closed))
        ends = []
        for name, end in (("start_direction", start_direction), ("end_direction", end_direction)):
            if end is not None:
                dimensions = array.shape[1:]
                ends.append(finite_numbers(name, end, f"{dimensions[0]} numbers", dimensions))
        coordinates = np.vstack([array, *ends]) if ends else array
        if yaw is not None and ends:  # ends turn at the mean rate, if clamped
            span = (yaw[-1] - yaw[0]) / (given[-1] - given[0])
            yaw = np.concatenate([yaw, np.full(len(ends), span)])
        return cls(basis, coordinates, yaw, turning_length)

    @property
    def closed(self) -> bool:
        """Whether the path is a lap that goes on where it began."""
        return self.basis.closed

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
            self.basis.bends(values),
            np.diff(knots)[:, None],
        )
        first = np.diff(y, axis=0) / h - h * (2 * m[:-1] + m[1:]) / 6
        return knots, np.stack([y[:-1], first, m[:-1] / 2, np.diff(m, axis=0) / (6 * h)], axis=1)

    def _evaluate(self, u: ArrayLike, derivative: int) -> Array:
        """(N, D): derivative 0..3 at u, segment by segment; at a knot, of the segment to the right.

        The same function as ``basis.matrix(u, derivative) @ values``, in a tenth of the time for
        many points.
        """
        arrays.require_whole("derivative", derivative, 0, "an order from 0 to 3", 3)
        knots, cubics = self._cubics
        u = _row("u", u)
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

    @cached_property
    def scaled_cubics(self) -> tuple[Array, Array]:
        """Knots (K,) and coefficients (K-1, 4, D), with the heading, if any, times the turning
        length: ds/du is the length of their derivative."""
        knots, cubics = self._cubics
        scale = np.ones(cubics.shape[2])
        if self.heading is not None:
            scale[-1] = self.turning_length
        return knots, np.ascontiguousarray(cubics * scale)

    @property
    def plain(self) -> bool:
        """Whether the path is its spline; otherwise it follows a surface."""
        return type(self).position is Path.position

    def standstill(self, share: float) -> float | None:
        """Spline parameter u where ds/du is below ``share`` of its mean, where the path stands
        still or doubles back; None where there is no such place.

        Exact: on a segment (ds/du)^2 is a quartic, least at an end or at a root of its derivative.
        """
        from trajopt.paths import arc

        u, least = arc.slowest(*self.scaled_cubics)
        return float(u) if least < share * self.length / (self.end - self.start) else None

    @cached_property
    def _cells(self) -> tuple[Array, Array, IndexArray]:
        from trajopt.paths import arc

        return arc.measure(*self.scaled_cubics, _SETTLED)

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        """Spline parameters of the quadrature cells and the path parameter there. Cells are halved
        until that changes nothing: ds/du has branch points near sharp bends."""
        if self.plain:
            cells, s, _ = self._cells
            return np.append(cells, self.end), s
        left, right = np.asarray(self.basis.knots[:-1]), np.asarray(self.basis.knots[1:])
        whole = self._integrate(left, right)
        starts, lengths, scale = list[Array](), list[Array](), 0.0
        for done in range(_HALVINGS):
            middle = (left + right) / 2
            first, second = self._integrate(left, middle), self._integrate(middle, right)
            scale = scale or float(np.sum(first + second))
            off = np.abs(first + second - whole) > _SETTLED * scale
            off &= (middle > left) & (middle < right)
            if done == _HALVINGS - 1:
                off[:] = False
            starts += [left[~off], middle[~off]]
            lengths += [first[~off], second[~off]]
            if not off.any():
                break
            left, right = (
                np.concatenate([left[off], middle[off]]),
                np.concatenate([middle[off], right[off]]),
            )
            whole = np.concatenate([first[off], second[off]])
        u, gained = np.concatenate(starts), np.concatenate(lengths)
        order = np.argsort(u)
        s = np.concatenate([[0.0], np.cumsum(gained[order])])
        return np.append(u[order], self.end), s

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
        u = _row("u", u)
        if self.plain:
            from trajopt.paths import arc

            (knots, cubics), (cells, s, segment) = self.scaled_cubics, self._cells
            return arc.parameters(knots, cubics, cells, s, segment, u)
        grid, s = self._table
        i = np.clip(np.searchsorted(grid, u, side="right") - 1, 0, len(grid) - 2)
        return np.asarray(s[i] + self._integrate(grid[i], u))

    def locate(self, s: ArrayLike) -> Array:
        """(N,): spline parameter u at path parameters s in [0, length]: inverse cubic, then Newton
        on the arc length."""
        grid, table = self._table
        s = np.clip(_row("s", s), 0.0, self.length)
        if self.plain:
            from trajopt.paths import arc

            (knots, cubics), (cells, table, segment) = self.scaled_cubics, self._cells
            return arc.places(knots, cubics, cells, table, segment, s)
        i = np.clip(np.searchsorted(table, s, side="right") - 1, 0, len(grid) - 2)
        left, right, width = grid[i], grid[i + 1], table[i + 1] - table[i]
        share = (s - table[i]) / np.where(width > 0, width, 1.0)
        u = left + (right - left) * share
        for _ in range(8):
            residual = table[i] + self._integrate(left, u) - s
            rate = self.rate(u)
            u = np.clip(u - residual / np.where(rate > 0, rate, np.inf), left, right)
            if np.all(np.abs(residual) <= 1e-11 * width):  # the step just taken squares it
                break
        return np.asarray(u)


def _row(name: str, values: ArrayLike) -> Array:
    """Finite numbers (N,), of one number too. Raises ArgumentError."""
    array = np.atleast_1d(require_finite(name, values, "(N,)", None))
    if array.ndim > 1:
        raise ArgumentError(name, array.shape, "finite numbers (N,)")
    return array
