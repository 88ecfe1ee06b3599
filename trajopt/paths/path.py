"""A path: control points, a heading rule, and the path parameter that time scaling works on.

Two parameters appear. ``u`` is the spline parameter (knots). ``s`` is the path parameter: arc
length where the robot drives along its heading, and the integral of sqrt(dx^2 + dy^2 + (L dpsi)^2)
where it can turn on the spot (L = ``turning_length``), so that a pure turn has a length too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from trajopt import arrays
from trajopt.arrays import Array, IndexArray, require_finite
from trajopt.errors import ArgumentError
from trajopt.paths.points import finite_numbers, interpolated
from trajopt.paths.spline import SplineBasis

if TYPE_CHECKING:
    from trajopt.paths.segments import Segment

SETTLED = 1e-14  # of the length: what halving a quadrature cell may change; chosen


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

    plain: ClassVar[bool] = True  # whether the path is its spline
    orders: ClassVar[int] = 3  # of the highest derivative that is not 0 everywhere

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
        ends = {"start_direction": start_direction, "end_direction": end_direction}
        return cls(
            *interpolated(points, heading, knots, ends, turning_length, closed), turning_length
        )

    @staticmethod
    def segments(segments: Sequence[Segment], *, start: ArrayLike) -> Path:
        """Straight lines, arcs and clothoids one after the other from ``start``: x, y (m) and
        direction of travel (rad). Exact: no spline is laid through anything.

        Where curvature jumps ``time_scale`` asks for a stop, or for a clothoid, if a limit would be
        broken, or wheels are steered. Raises ArgumentError.

        >>> from trajopt import Arc, Straight
        >>> Path.segments([Straight(2.0), Arc(1.0, np.pi / 2)], start=(0, 0, 0)).length - np.pi / 2
        2.0
        """
        from trajopt.paths.segments import segment_path

        return segment_path(segments, start)

    @staticmethod
    def join(pieces: Sequence[Path]) -> Path:
        """One path of several pieces; the robot rests where they meet, and may turn back there.

        Raises ArgumentError, with place and distance, where a piece does not begin where the one
        before ends, with the robot facing the same way.

        >>> ahead = Path.through([[0, 0], [1, 0]])
        >>> back = Path.through([[1, 0], [0, 0]]).backward()
        >>> Path.join([ahead, back]).yaw([0.0, 2.0]).tolist()
        [0.0, 0.0]
        """
        from trajopt.paths.joined import joined

        return joined(pieces)

    def backward(self) -> Path:
        """The same path driven backward: the robot faces against the direction of travel."""
        from trajopt.paths.joined import backward

        return backward(self)

    @property
    def joints(self) -> Array:
        """(J,): spline parameters where pieces meet and the robot rests."""
        return np.zeros(0)

    @property
    def jumps(self) -> Array:
        """(J,): spline parameters where the curvature jumps, other than at ``joints``."""
        return np.zeros(0)

    def facing(self, u: ArrayLike) -> Array:
        """(N,): 1 where the robot drives forward, -1 where backward; at a joint as after it."""
        return np.ones(len(row("u", u)))

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
            if not self.plain:
                d = d * self.facing(u)[:, None]
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
        knots = self._knots
        y, m, h = values[: len(knots)], self.basis.bends(values), np.diff(knots)[:, None]
        first = np.diff(y, axis=0) / h - h * (2 * m[:-1] + m[1:]) / 6
        return knots, np.stack([y[:-1], first, m[:-1] / 2, np.diff(m, axis=0) / (6 * h)], axis=1)

    def _evaluate(self, u: ArrayLike, derivative: int) -> Array:
        """(N, D): derivative at u; at a knot, of the segment to the right. As ``basis.matrix(u,
        derivative) @ values``, in a tenth of the time for many points."""
        most = self.orders
        arrays.require_whole("derivative", derivative, 0, f"an order from 0 to {most}", most)
        return self._inside(*self._placed(row("u", u)), derivative)

    def _placed(self, u: Array) -> tuple[IndexArray, Array]:
        """(N,) each: in which cell between knots, and how far after its knot."""
        knots = self._knots
        i = np.clip(np.searchsorted(knots, u, side="right") - 1, 0, len(knots) - 2)
        return i, u - knots[i]

    @cached_property
    def _knots(self) -> Array:
        return np.asarray(self.basis.knots, dtype=np.float64)

    def _inside(self, i: IndexArray, t: Array, derivative: int) -> Array:
        """(N, D): derivative so far after the knots that cells i begin with."""
        c, t = self._cubics[1][i], t[:, None]
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

    def standstill(self, share: float) -> float | None:
        """Spline parameter u where ds/du is below ``share`` of its mean: the path stands still or
        doubles back; None without such a place.

        Exact: on a segment (ds/du)^2 is a quartic, least at an end or at a root of its derivative.
        """
        from trajopt.paths import arc

        u, least = arc.slowest(*self.scaled_cubics)
        return float(u) if least < share * self.length / (self.end - self.start) else None

    def swept(self, left: Array, right: Array, reach: float) -> Array:
        """(N,): at least the way (m) in the plane of any point within ``reach`` (m) of the origin
        between spline parameters left and right, no knot between them."""
        i, t = self._placed(left)
        return self._swept(i, t, right - left, reach)

    def _swept(self, i: IndexArray, t: Array, h: Array, reach: float) -> Array:
        from trajopt.paths.swept import swept

        scale = self.turning_length if self.heading is not None else 0.0
        return swept(self.scaled_cubics[1][i], t, h, scale, reach)

    @cached_property
    def _cells(self) -> tuple[Array, Array, IndexArray]:
        from trajopt.paths import arc

        return arc.measure(*self.scaled_cubics, SETTLED)

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        """Spline parameters of the quadrature cells, and the path parameter there."""
        cells, s, _ = self._cells
        return np.append(cells, self.end), s

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
        from trajopt.paths import arc

        (knots, cubics), (cells, s, segment) = self.scaled_cubics, self._cells
        return arc.parameters(knots, cubics, cells, s, segment, row("u", u))

    def locate(self, s: ArrayLike) -> Array:
        """(N,): spline parameter u at path parameters s in [0, length]: inverse cubic, then Newton
        on the arc length."""
        from trajopt.paths import arc

        (knots, cubics), (cells, table, segment) = self.scaled_cubics, self._cells
        s = np.clip(row("s", s), 0.0, self.length)
        return arc.places(knots, cubics, cells, table, segment, s)


def row(name: str, values: ArrayLike) -> Array:
    """Finite numbers (N,), of one number too. Raises ArgumentError."""
    array = np.atleast_1d(require_finite(name, values, "(N,)", None))
    if array.ndim > 1:
        raise ArgumentError(name, array.shape, "finite numbers (N,)")
    return array
