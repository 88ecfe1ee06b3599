"""Ramps on level ground, with edges rounded over a given length."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb, factorial
from types import MappingProxyType
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray, require_finite, require_positive
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path
from trajopt.world.ground import Line
from trajopt.world.laid import lay

_STEEPEST = np.nextafter(np.pi / 2, 0.0)  # rad, where no grade is asked for

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
        require_finite("ramp.place", self.place, "m", (2,))
        for name in ("direction", "height"):
            require_finite(f"ramp.{name}", getattr(self, name))
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

    @property
    def level(self) -> bool:
        return not self.ramps

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return self.partial(x, y, 0, 0)

    def partial(self, x: ArrayLike, y: ArrayLike, i: int, j: int) -> Array:
        total = np.zeros(np.broadcast(x, y).shape)
        for ramp in self.ramps:
            share = np.cos(ramp.direction) ** i * np.sin(ramp.direction) ** j
            total = total + share * ramp.rise(ramp.along(x, y), i + j)
        return total

    def covers(self, x: ArrayLike, y: ArrayLike) -> BoolArray:
        return np.ones(np.broadcast(x, y).shape, dtype=bool)

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
    """The plane ``path`` laid on level ground with ramps, whatever their slope."""
    return lay(path, Ramps(tuple(ramps), _STEEPEST))
