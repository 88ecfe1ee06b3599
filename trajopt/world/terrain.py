"""The ground a path runs over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray
from trajopt.paths.path import Path
from trajopt.world.ground import Line


@dataclass(frozen=True)
class Flat:
    """Ground as the path has it: level under a 2-D path, the path's own z under a 3-D one."""

    lines: ClassVar[tuple[Line, ...]] = ()
    grain: ClassVar[float] = np.inf
    bends: ClassVar[bool] = False
    level: ClassVar[bool] = True

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return np.zeros(np.broadcast(x, y).shape)

    def partial(self, x: ArrayLike, y: ArrayLike, i: int, j: int) -> Array:  # noqa: ARG002
        return self.height(x, y)

    def covers(self, x: ArrayLike, y: ArrayLike) -> BoolArray:
        return np.ones(np.broadcast(x, y).shape, dtype=bool)

    def check(self, path: Path) -> None:
        """Every path fits."""
