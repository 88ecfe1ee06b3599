"""Paths of straight lines, arcs and clothoids, exact: curvature is linear in arc length.

A cell is at most half a radian of turning. Inside it the direction is quadratic in arc length, and
Gauss quadrature of its cosine and sine is exact to rounding; all derivatives are closed forms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import (
    Array,
    IndexArray,
    require_finite,
    require_not_negative,
    require_positive,
)
from trajopt.errors import ArgumentError
from trajopt.paths.path import Path, row
from trajopt.paths.points import finite_numbers
from trajopt.paths.spline import SplineBasis

_TURN = 0.5  # rad of a cell: Gauss quadrature with eight nodes then errs by less than 1e-16; chosen
_MOST_CELLS = 100_000  # chosen, for memory: 50,000 rad of turning
_SAME = 1e-9  # of the greatest curvature: a smaller jump is rounding
_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True)
class Straight:
    """A straight line of ``length`` > 0, m."""

    length: float

    def __post_init__(self) -> None:
        require_positive("length", self.length, "m")

    @property
    def curvatures(self) -> tuple[float, float]:
        """At its start and end, 1/m, positive to the left."""
        return 0.0, 0.0


@dataclass(frozen=True)
class Arc:
    """An arc of a circle: ``radius`` > 0, m, and the ``angle`` by which it turns, rad, positive to
    the left."""

    radius: float
    angle: float

    def __post_init__(self) -> None:
        require_positive("radius", self.radius, "m")
        if require_finite("angle", self.angle, "rad") == 0:
            raise ArgumentError("angle", self.angle, "an angle that is not 0, rad")

    @property
    def length(self) -> float:
        """m"""
        return self.radius * abs(self.angle)

    @property
    def curvatures(self) -> tuple[float, float]:
        """As ``Straight.curvatures``."""
        curvature = float(np.copysign(1 / self.radius, self.angle))
        return curvature, curvature


@dataclass(frozen=True)
class Clothoid:
    """``length`` > 0, m, on which the curvature goes evenly from ``start`` to ``end``, 1/m, positive
    to the left: a car turns its wheels while it drives."""

    length: float
    start: float
    end: float

    def __post_init__(self) -> None:
        require_positive("length", self.length, "m")
        require_finite("start", self.start, "1/m")
        require_finite("end", self.end, "1/m")

    @property
    def curvatures(self) -> tuple[float, float]:
        """As ``Straight.curvatures``."""
        return self.start, self.end


Segment = Straight | Arc | Clothoid


@dataclass(frozen=True)
class SegmentPath(Path):
    """Straight lines, arcs and clothoids one after the other, made by ``Path.segments``; its spline
    parameter is arc length.

    ``angles`` (K,): direction of travel at the knots, rad; ``bends`` (K-1, 2): curvature where a cell
    begins, 1/m, and its derivative, 1/m^2.
    """

    angles: Array = field(default_factory=lambda: np.zeros(0))
    bends: Array = field(default_factory=lambda: np.zeros((0, 2)))

    plain: ClassVar[bool] = False
    orders: ClassVar[int] = 5

    def _inside(self, i: IndexArray, t: Array, derivative: int) -> Array:
        angle, (start, rise) = self.angles[i], self.bends[i].T
        if derivative == 0:
            nodes = t[:, None] * (1 + _GAUSS_X) / 2
            phase = angle[:, None] + nodes * (start[:, None] + nodes * rise[:, None] / 2)
            gained = np.exp(1j * phase) @ _GAUSS_W * t / 2
            place = np.column_stack([gained.real, gained.imag])
            return np.asarray(self.coordinates[i] + place)
        k = start + t * rise
        factor = (
            1.0,
            1j * k,
            1j * rise - k**2,
            -3 * k * rise - 1j * k**3,
            k**4 - 3 * rise**2 - 6j * k**2 * rise,
        )[derivative - 1]
        found = np.exp(1j * (angle + t * (start + t * rise / 2))) * factor
        return np.column_stack([found.real, found.imag])

    @cached_property
    def _cubics(self) -> tuple[Array, Array]:
        """Cubics close to the cells: what spreads gridpoints, and nothing else, asks for them."""
        h, p = np.diff(self._knots)[:, None], self.coordinates
        d = np.column_stack([np.cos(self.angles), np.sin(self.angles)])
        chord = np.diff(p, axis=0) / h
        second, third = 3 * chord - 2 * d[:-1] - d[1:], d[:-1] + d[1:] - 2 * chord
        return self._knots, np.stack([p[:-1], d[:-1], second / h, third / h**2], axis=1)

    @property
    def jumps(self) -> Array:
        last = self.bends[:, 0] + self.bends[:, 1] * np.diff(self._knots)
        jump = np.abs(self.bends[1:, 0] - last[:-1]) > _SAME * np.abs(self.bends[:, 0]).max()
        return np.asarray(self._knots[1:-1][jump])

    def rate(self, u: ArrayLike) -> Array:
        return np.ones(len(row("u", u)))

    def standstill(self, share: float) -> float | None:  # noqa: ARG002 - it never stands still
        return None

    def _swept(self, i: IndexArray, t: Array, h: Array, reach: float) -> Array:
        start, rise = self.bends[i].T
        k = np.maximum(np.abs(start + rise * t), np.abs(start + rise * (t + h)))
        return np.asarray(h * (1 + reach * k))

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        return self._knots, self._knots

    def parameter(self, u: ArrayLike) -> Array:
        return row("u", u)

    def locate(self, s: ArrayLike) -> Array:
        return np.clip(row("s", s), 0.0, self.length)


def segment_path(segments: Sequence[Segment], start: ArrayLike) -> SegmentPath:
    """See ``Path.segments``."""
    if not isinstance(segments, (list, tuple)) or not segments:
        raise ArgumentError("segments", segments, "a list of Straight, Arc, Clothoid")
    x, y, first = finite_numbers("start", start, "x, y (m), direction of travel (rad)", (3,))
    knots, angles = [np.zeros(1)], [np.array([first])]
    bends = list[Array]()
    for n, segment in enumerate(segments):
        if not isinstance(segment, (Straight, Arc, Clothoid)):
            raise ArgumentError(f"segments[{n}]", segment, "a Straight, Arc or Clothoid")
        k0, k1 = segment.curvatures
        count = np.ceil(max(abs(k0), abs(k1)) * segment.length / _TURN)
        require_not_negative(f"segments[{n}]", count, "a segment")
        if count + sum(map(len, bends)) > _MOST_CELLS:
            expected = f"segments that turn by at most {_MOST_CELLS * _TURN:g} rad"
            raise ArgumentError(f"segments[{n}]", segment, expected)
        t = np.linspace(0.0, segment.length, int(max(count, 1)) + 1)
        rise = (k1 - k0) / segment.length
        bends.append(np.column_stack([k0 + rise * t[:-1], np.full(len(t) - 1, rise)]))
        knots.append(knots[-1][-1] + t[1:])
        angles.append(angles[-1][-1] + t[1:] * (k0 + t[1:] * rise / 2))
    u, turned, bent = np.concatenate(knots), np.concatenate(angles), np.concatenate(bends)
    basis = SplineBasis(tuple(u.tolist()))
    # Where cells begin: what the cells before have gained, one by one.
    whole = SegmentPath(basis, np.zeros((len(u), 2)), angles=turned, bends=bent)
    gained = whole.position(np.nextafter(u[1:], -np.inf))[:, :2]
    points = np.array([x, y]) + np.vstack([np.zeros(2), np.cumsum(gained, axis=0)])
    return SegmentPath(basis, points, angles=turned, bends=bent)
