"""The ground a path runs over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from trajopt.arrays import Array, require_finite
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path


class Terrain(Protocol):
    """The ground. ``height`` is in m at world positions in m."""

    def height(self, x: Array, y: Array) -> Array: ...

    def check(self, path: Path) -> None:
        """Raises InfeasibleError where a path cannot be driven on this ground."""
        ...


@dataclass(frozen=True)
class Flat:
    """Ground as the path has it: level under a 2-D path, the path's own z under a 3-D one."""

    def height(self, x: Array, y: Array) -> Array:
        return np.zeros(np.broadcast(x, y).shape)

    def check(self, path: Path) -> None:
        """Every path fits."""


@dataclass(frozen=True)
class Step:
    """A step of ``rise`` (m, > 0 up) across the line at distance ``x`` (m) along ``direction``
    (rad, world).

    A wheeled robot drives up to it, not over it: a path whose body origin crosses the line is
    infeasible.
    """

    rise: float
    x: float
    direction: float = 0.0

    def __post_init__(self) -> None:
        if not np.isfinite(self.rise) or self.rise == 0:
            raise ArgumentError("terrain.rise", self.rise, "a finite height different from 0 m")
        require_finite("terrain.x, direction", (self.x, self.direction), "m, rad")

    def height(self, x: Array, y: Array) -> Array:
        along = x * np.cos(self.direction) + y * np.sin(self.direction)
        return np.where(along >= self.x, self.rise, 0.0)

    def check(self, path: Path) -> None:
        """Raises InfeasibleError where the path crosses the step."""
        u = np.linspace(path.start, path.end, 64 * (len(path.basis.knots) - 1) + 1)
        p = path.position(u)
        beyond = self.height(p[:, 0], p[:, 1]) != self.height(p[:1, 0], p[:1, 1])
        if beyond.any():
            place = float(path.parameter(u[[int(np.argmax(beyond))]])[0])
            raise InfeasibleError(
                "terrain", place, f"the path crosses a step of {self.rise:g} m; end it before"
            )
