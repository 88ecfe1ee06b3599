"""Ramps on level ground, with edges rounded over a given length."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb, factorial
from types import MappingProxyType
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, require_finite, require_positive
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path
from trajopt.paths.spline import SplineBasis
from trajopt.world.ground import Line

_EDGE_KNOTS = (
    8  # knots across a rounded edge when a path is laid over a ramp; chosen: z within 0.1 mm
)


Edge = Literal["mean", "smooth"]
_MEANS: Mapping[Edge, int] = MappingProxyType({"mean": 1, "smooth": 3})


@dataclass(frozen=True)
class Ramp:
    """A ramp rising by ``height`` (m, < 0 falls) over ``run`` (m, horizontal) from its foot line.

    The foot passes through ``place`` (x, y), m, and the ramp rises along ``direction`` (rad,
    world); beyond it the ground stays at ``height``. Both edges are rounded over ``rounding`` (m),
    as a robot with that distance between its axles feels them: with ``edge`` "mean" the height is
    the mean of the sharp ramp over that length, an arc whose curvature jumps at its ends, and with
    it the wheel speeds of a robot that crosses it at an angle; with "smooth" the mean is taken
    three times, each over a third of the length, and third derivatives are continuous too.
    """

    place: tuple[float, float]
    direction: float
    run: float
    height: float
    rounding: float
    edge: Edge = "mean"

    def __post_init__(self) -> None:
        for name in ("run", "rounding"):
            require_positive(f"ramp.{name}", getattr(self, name), "m")
        require_finite("ramp", [*self.place, self.direction, self.height])
        if self.edge not in _MEANS:
            raise ArgumentError("ramp.edge", self.edge, "'mean' or 'smooth'")

    def along(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Distance from the foot line along the ramp, m."""
        return np.asarray(
            (np.asarray(x) - self.place[0]) * np.cos(self.direction)
            + (np.asarray(y) - self.place[1]) * np.sin(self.direction)
        )

    def height_at(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Ground height, m, at world positions."""
        return self.rise(self.along(x, y), 0)

    def rise(self, d: Array, order: int) -> Array:
        """The height's derivative of that order along the ramp, at distances ``d`` from its
        foot."""
        return np.asarray(
            self.height / self.run * (self._bend(d, order) - self._bend(d - self.run, order))
        )

    @property
    def lines(self) -> tuple[Line, ...]:
        """Where derivatives of the height jump."""
        foot = self.place[0] * np.cos(self.direction) + self.place[1] * np.sin(self.direction)
        n = _MEANS[self.edge]
        breaks = (np.arange(n + 1) / n - 0.5) * self.rounding
        return tuple(
            Line(self.direction, float(foot + edge + b)) for edge in (0.0, self.run) for b in breaks
        )

    def _bend(self, d: Array, order: int) -> Array:
        """max(d, 0), averaged over the rounding; or a derivative of it."""
        n, half = _MEANS[self.edge], self.rounding / 2
        power, width = n + 1 - order, self.rounding / n
        near = np.clip(d, -half, half)  # differences of powers lose digits farther out
        total = np.zeros_like(near)
        for k in range(n + 1):
            t = near + half - k * width
            value = np.where(t >= 0, np.abs(t) ** max(power, 0), 0.0) / factorial(max(power, 0))
            total += (-1) ** k * comb(n, k) * value / width**n
        if power < 0:
            total = np.zeros_like(near)
        beyond = (d, np.ones_like(d), np.zeros_like(d))[min(order, 2)]
        return np.where(d >= half, beyond, np.where(d < -half, 0.0, total))


@dataclass(frozen=True)
class Ramps:
    """Level ground with ramps; a path on it may nowhere be steeper than ``grade`` (rad)."""

    ramps: tuple[Ramp, ...]
    grade: float
    grain: ClassVar[float] = np.inf
    bends: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if not 0 < self.grade < np.pi / 2:
            raise ArgumentError("ground.grade", self.grade, "an angle between 0 and pi/2 rad")

    @property
    def lines(self) -> tuple[Line, ...]:
        return tuple(line for ramp in self.ramps for line in ramp.lines)

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return self.partial(x, y, 0, 0)

    def partial(self, x: ArrayLike, y: ArrayLike, i: int, j: int) -> Array:
        total = np.zeros(np.broadcast(x, y).shape)
        for ramp in self.ramps:
            share = np.cos(ramp.direction) ** i * np.sin(ramp.direction) ** j
            total = total + share * ramp.rise(ramp.along(x, y), i + j)
        return total

    def check(self, path: Path) -> None:
        """Raises InfeasibleError where the path is steeper than the robot's grade."""
        require_grade(path, self.grade)


def require_grade(path: Path, grade: float) -> None:
    """Raises InfeasibleError where a path is steeper than ``grade`` (rad)."""
    u = np.linspace(path.start, path.end, 16 * (len(path.basis.knots) - 1) + 1)
    d = path.position(u, 1)
    slope = np.abs(np.arctan2(d[:, 2], np.hypot(d[:, 0], d[:, 1])))
    if slope.max() > grade * (1 + 1e-9):
        i = int(np.argmax(slope > grade))
        raise InfeasibleError(
            "grade",
            float(path.parameter(u[[i]])[0]),
            f"the ground is {np.degrees(slope.max()):.3g} deg steep, the robot climbs "
            f"{np.degrees(grade):.3g} deg",
        )


def lay_over(path: Path, ramps: Sequence[Ramp]) -> Path:
    """The level ``path`` with z from the ramps' height: same curve in the plane, more knots at the
    edges.

    A cubic spline keeps its curve when knots are added, so x and y do not change. Raises
    ArgumentError for a path with a heading of its own or one that has a height already.
    """
    if path.heading is not None or path.coordinates.shape[1] != 2:
        raise ArgumentError(
            "path", path.coordinates.shape, "a level path that drives along its heading"
        )
    u = np.unique(
        np.concatenate([np.asarray(path.basis.knots), *(_edge_knots(path, r) for r in ramps)])
    )
    keep = np.concatenate([[True], np.diff(u) > 1e-9 * (path.end - path.start)])
    u = u[keep]
    u[-1] = path.end
    p = path.position(u)
    z = sum((r.height_at(p[:, 0], p[:, 1]) for r in ramps), np.zeros(len(u)))
    basis = SplineBasis(tuple(u.tolist()), clamped_start=True, clamped_end=True)
    ends = path.position(np.array([path.start, path.end]), 1)
    step = 1e-6 * (path.end - path.start)
    near = path.position(np.array([path.start, path.start + step, path.end - step, path.end]))
    height = sum((r.height_at(near[:, 0], near[:, 1]) for r in ramps), np.zeros(4))
    ends[:, 2] = (height[1] - height[0]) / step, (height[3] - height[2]) / step
    return Path(basis, np.vstack([np.column_stack([p[:, :2], z]), ends]))


def _edge_knots(path: Path, ramp: Ramp) -> Array:
    """Spline parameters of knots across the ramp's rounded edges, where the path crosses them."""
    u = np.linspace(path.start, path.end, 4000)
    p = path.position(u)
    d = ramp.along(p[:, 0], p[:, 1])
    half = ramp.rounding / 2
    levels = np.concatenate(
        [edge + np.linspace(-half, half, _EDGE_KNOTS + 1) for edge in (0.0, ramp.run)]
        + [np.linspace(half, ramp.run - half, 5)]
    )
    found = []
    for level in levels:
        side = d > level
        for i in np.flatnonzero(side[1:] != side[:-1]):
            share = (level - d[i]) / (d[i + 1] - d[i])
            found.append(u[i] + share * (u[i + 1] - u[i]))
    return np.asarray(found, dtype=np.float64)
