"""The ground a path runs over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array
from trajopt.paths.path import Path
from trajopt.world.ground import Line


class Terrain(Protocol):
    """The ground. ``height`` is in m at world positions in m."""

    def height(self, x: Array, y: Array) -> Array: ...

    def check(self, path: Path) -> None:
        """Raises InfeasibleError where a path cannot be driven on this ground."""
        ...


@dataclass(frozen=True)
class Flat:
    """Ground as the path has it: level under a 2-D path, the path's own z under a 3-D one."""

    lines: ClassVar[tuple[Line, ...]] = ()
    grain: ClassVar[float] = np.inf
    bends: ClassVar[bool] = False

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return np.zeros(np.broadcast(x, y).shape)

    def partial(self, x: ArrayLike, y: ArrayLike, i: int, j: int) -> Array:  # noqa: ARG002
        return self.height(x, y)

    def check(self, path: Path) -> None:
        """Every path fits."""
