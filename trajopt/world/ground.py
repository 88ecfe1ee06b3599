"""What a shape of the ground tells: its height z = h(x, y) and the derivatives of h."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray
from trajopt.paths.path import Path


class Line(NamedTuple):
    """The straight line x cos(direction) + y sin(direction) = distance (m) in the ground plan."""

    direction: float
    distance: float


class Ground(Protocol):
    """The shape of the ground; x, y and heights in m, world frame.

    ``level``: whether it is, everywhere. ``lines``: where derivatives of the height jump. ``grain`` (m): the length over which its shape
    varies beside these lines, inf where it is plane there. ``bends``: whether it bends on the scale
    of a robot, so that a robot's posture follows from the heights under its wheels; elsewhere it is
    the tangent plane at the robot's origin.
    """

    @property
    def lines(self) -> tuple[Line, ...]: ...

    @property
    def grain(self) -> float: ...

    @property
    def bends(self) -> bool: ...

    @property
    def level(self) -> bool: ...

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Height, m, at positions of any shape."""
        ...

    def partial(self, x: ArrayLike, y: ArrayLike, i: int, j: int) -> Array:
        """d^(i+j) h / dx^i dy^j, m^(1-i-j), i + j from 0 to 4. On a line: of the side that
        ``lines`` points to."""
        ...

    def covers(self, x: ArrayLike, y: ArrayLike) -> BoolArray:
        """Whether there is ground at positions of any shape."""
        ...

    def check(self, path: Path) -> None:
        """Raises InfeasibleError where a path cannot be driven on this ground."""
        ...
