"""A plane path laid onto the ground."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import factorial
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array
from trajopt.errors import InfeasibleError
from trajopt.paths.path import SETTLED, Path, row
from trajopt.paths.series import Series
from trajopt.paths.spline import SplineBasis
from trajopt.world.ground import Ground

ON_GROUND = 1e-3  # m; a path in space this close to the ground lies on it; chosen
_GRAINS = 10  # lengths of the ground's grain between two knots; chosen: 20 gridpoints and more
_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(8)
_LOOK = 64  # places a segment between which a path may cross a line of the ground; chosen
_HALVINGS = 60  # of such a stretch: down to rounding
_MERGE = 1e-9  # knots closer than this share of the path are one
_HAIR = 1e-9  # of a segment


@dataclass(frozen=True)
class LaidPath(Path):
    """The curve of a plane path with the height of ``ground``: its path parameter is arc length in
    space. It has more knots than the plane path, where it crosses lines of the ground and where the
    ground varies. Made by ``lay``."""

    plane: Path | None = None
    ground: Ground | None = None

    plain: ClassVar[bool] = False

    @property
    def orders(self) -> int:  # type: ignore[override]
        return self._plane.orders

    @property
    def _plane(self) -> Path:
        assert self.plane is not None
        return self.plane

    @property
    def joints(self) -> Array:
        return self._plane.joints

    @property
    def jumps(self) -> Array:
        return self._plane.jumps

    def facing(self, u: ArrayLike) -> Array:
        return self._plane.facing(u)

    def swept(self, left: Array, right: Array, reach: float) -> Array:
        return self._plane.swept(left, right, reach)

    def standstill(self, share: float) -> float | None:
        return super().standstill(share) if self._plane.plain else self._plane.standstill(share)

    def _evaluate(self, u: ArrayLike, derivative: int) -> Array:
        plane = self._plane
        if plane.plain:
            return super()._evaluate(u, derivative)
        return plane._evaluate(u, derivative)

    def position(self, u: ArrayLike, derivative: int = 0) -> Array:
        p = super().position(u, derivative)
        x, y = ground_plan(self, u, derivative)
        assert self.ground is not None
        p[:, 2] = compose(self.ground, x, y, 0, 0, derivative).at(derivative)
        return p

    @cached_property
    def _cubics(self) -> tuple[Array, Array]:
        """Those of the plane path, about the knots here."""
        knots, plane = np.asarray(self.basis.knots), self._plane
        parts = []
        for k in range(4):
            part = plane.position(knots[:-1], k)[:, :2]
            if plane.heading is not None:
                part = np.column_stack([part, plane.yaw(knots[:-1], k)])
            parts.append(part / factorial(k))
        return knots, np.stack(parts, axis=1)

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        """As a path's. Cells are halved until that changes nothing: ds/du has branch points near
        sharp bends."""
        left, right = self._knots[:-1], self._knots[1:]
        whole = self._integrate(left, right)
        starts, lengths, scale = list[Array](), list[Array](), 0.0
        for done in range(_HALVINGS):
            middle = (left + right) / 2
            first, second = self._integrate(left, middle), self._integrate(middle, right)
            scale = scale or float(np.sum(first + second))
            off = np.abs(first + second - whole) > SETTLED * scale
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

    def parameter(self, u: ArrayLike) -> Array:
        u, (grid, s) = row("u", u), self._table
        i = np.clip(np.searchsorted(grid, u, side="right") - 1, 0, len(grid) - 2)
        return np.asarray(s[i] + self._integrate(grid[i], u))

    def locate(self, s: ArrayLike) -> Array:
        grid, table = self._table
        s = np.clip(row("s", s), 0.0, self.length)
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


def lay(path: Path, ground: Ground) -> Path:
    """``path`` on ``ground``: a plane path gets the ground's height, one in space must have it.

    Raises InfeasibleError, with place, where a path in space is off the ground by more than 1 mm,
    or as the ground's ``check``.
    """
    if path.coordinates.shape[1] == 3 or isinstance(path, LaidPath):
        u = np.linspace(path.start, path.end, 64 * (len(path.basis.knots) - 1) + 1)
        p = path.position(u)
        off = p[:, 2] - ground.partial(p[:, 0], p[:, 1], 0, 0)
        worst = int(np.argmax(np.abs(off)))
        if abs(off[worst]) > ON_GROUND:
            raise InfeasibleError(
                "ground",
                float(path.parameter(u[[worst]])[0]),
                f"the path is {abs(off[worst]):.3g} m {'above' if off[worst] > 0 else 'below'} the "
                "ground; give a plane path, or one that lies on the ground",
            )
        if not isinstance(path, LaidPath):
            ground.check(path)
            return path
        assert path.plane is not None
        path = path.plane
    knots = _knots(path, ground)
    basis = SplineBasis(tuple(knots.tolist()), clamped_start=True, clamped_end=True)
    ends = np.array([path.start, path.end])
    points = np.vstack([path.position(knots), path.position(ends, 1)])[:, :2]
    heading = path.heading
    if heading is not None:
        heading = np.concatenate([path.yaw(knots), path.yaw(ends, 1)])
    laid = LaidPath(basis, points, heading, path.turning_length, path, ground)
    ground.check(laid)
    return laid


def _knots(path: Path, ground: Ground) -> Array:
    """Knots of the path, places where it crosses lines of the ground, and more where the ground
    varies."""
    knots = np.asarray(path.basis.knots)
    u = np.unique(np.linspace(knots[:-1], knots[1:], _LOOK + 1))
    p = path.position(u)
    close = _MERGE * (path.end - path.start)
    for line in ground.lines:
        cos, sin = np.cos(line.direction), np.sin(line.direction)
        d = p[:, 0] * cos + p[:, 1] * sin - line.distance
        at = np.flatnonzero((d[:-1] > 0) != (d[1:] > 0))
        low, high, side = u[at], u[at + 1], d[at] > 0
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            q = path.position(middle)
            same = (q[:, 0] * cos + q[:, 1] * sin - line.distance > 0) == side
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        for place in (low + high) / 2:
            if np.abs(knots - place).min() > close:
                knots = np.sort(np.append(knots, place))
    if np.isfinite(ground.grain):
        cells = np.ceil(np.diff(path.parameter(knots)) / (_GRAINS * ground.grain)).astype(int)
        parts = [
            np.linspace(a, b, max(n, 1), endpoint=False)
            for a, b, n in zip(knots[:-1], knots[1:], cells, strict=True)
        ]
        knots = np.append(np.concatenate(parts), knots[-1])
    return knots


def plan_series(path: Path, u: ArrayLike, order: int) -> tuple[Series, Series]:
    """x and y of a path as series in u; at a knot, of the segment to the right."""
    d = [Path.position(path, u, k) for k in range(min(order, path.orders) + 1)]
    x, y = (Series.of([part[:, k] for part in d], order) for k in (0, 1))
    return x, y


def ground_plan(path: Path, u: ArrayLike, order: int) -> tuple[Series, Series]:
    """As ``plan_series``, a hair inside the segment: a knot on a line of the ground, where
    derivatives of the height jump, then belongs to its segment's side."""
    knots, places = np.asarray(path.basis.knots), np.atleast_1d(np.asarray(u, dtype=np.float64))
    i = np.clip(np.searchsorted(knots, places, side="right") - 1, 0, len(knots) - 2)
    hair = _HAIR * (knots[i + 1] - knots[i])
    return plan_series(path, np.clip(places, knots[i] + hair, knots[i + 1] - hair), order)


def compose(ground: Ground, x: Series, y: Series, i: int, j: int, order: int) -> Series:
    """d^(i+j) h / dx^i dy^j along a curve (x, y) in the ground plan, as a series of that order."""
    at, dx, dy = (x.c[0], y.c[0]), x.steps(order), y.steps(order)
    total = Series(np.zeros((order + 1, *at[0].shape)))
    for a in range(order + 1):
        for b in range(order + 1 - a):
            h = ground.partial(*at, i + a, j + b) / (factorial(a) * factorial(b))
            total = total + dx[a] * dy[b] * h
    return total
