"""A plane, level or tilted in any direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray, require_between, require_finite
from trajopt.paths.path import Path
from trajopt.world.ground import Line


@dataclass(frozen=True)
class Plane:
    """A plane that rises by ``slope`` (rad) along ``direction`` (rad, world), through the origin.

    >>> float(Plane(0.1, 0.0).height(2.0, 5.0).round(6))
    0.200669
    """

    slope: float
    direction: float

    def __post_init__(self) -> None:
        require_finite("plane.direction", self.direction, "rad")
        require_between("plane.slope", self.slope, -np.pi / 2, np.pi / 2, "rad")

    lines: ClassVar[tuple[Line, ...]] = ()
    grain: ClassVar[float] = np.inf
    bends: ClassVar[bool] = False

    @property
    def level(self) -> bool:
        return self.slope == 0

    @property
    def gradient(self) -> tuple[float, float]:
        """(dz/dx, dz/dy)."""
        rise = float(np.tan(self.slope))
        return rise * float(np.cos(self.direction)), rise * float(np.sin(self.direction))

    @property
    def normal(self) -> tuple[float, float, float]:
        """Unit vector out of the ground."""
        x, y = self.gradient
        size = float(np.sqrt(1.0 + x * x + y * y))
        return -x / size, -y / size, 1.0 / size

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return np.asarray(self.gradient[0] * np.asarray(x) + self.gradient[1] * np.asarray(y))

    def partial(self, x: ArrayLike, y: ArrayLike, i: int, j: int) -> Array:
        if i + j == 0:
            return self.height(x, y)
        value = self.gradient[0] * (i == 1) + self.gradient[1] * (j == 1) if i + j == 1 else 0.0
        return np.full(np.broadcast(x, y).shape, value)

    def covers(self, x: ArrayLike, y: ArrayLike) -> BoolArray:
        return np.ones(np.broadcast(x, y).shape, dtype=bool)

    def check(self, path: Path) -> None:
        """Every path fits."""
