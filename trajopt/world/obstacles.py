"""Things that stand on the ground: each an outline and a height, whatever its kind.

A new shape is one class here and one line in ``OBSTACLES``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol

from trajopt.arrays import require_finite, require_positive
from trajopt.errors import ArgumentError

Point = tuple[float, float]
_ROUND = 48  # corners of a circle's outline; chosen: 0.2 % of the radius outside it


class Obstacle(Protocol):
    """Something on the ground: ``outline`` (K corners, counter-clockwise, m) up to ``height``,
    m."""

    @property
    def name(self) -> str: ...

    @property
    def height(self) -> float: ...

    @property
    def outline(self) -> tuple[Point, ...]: ...


@dataclass(frozen=True)
class Step:
    """A block whose front edge is met: ``place`` (x, y, m) in the middle of the edge, extending by
    ``depth`` (m) in the ``direction`` (rad) behind it; ``width`` (m) is the length of the edge."""

    name: str
    height: float
    place: Point
    direction: float
    width: float
    depth: float

    def __post_init__(self) -> None:
        _check(self, ("height", "width", "depth"), ("place",))
        require_finite(f"{self.name}.direction", self.direction, "rad")

    @property
    def normal(self) -> Point:
        """Unit vector into the step."""
        return math.cos(self.direction), math.sin(self.direction)

    @property
    def outline(self) -> tuple[Point, ...]:
        (x, y), (c, s), half = self.place, self.normal, self.width / 2
        back = (x + self.depth * c, y + self.depth * s)
        return (
            (x + half * s, y - half * c),
            (back[0] + half * s, back[1] - half * c),
            (back[0] - half * s, back[1] + half * c),
            (x - half * s, y + half * c),
        )


@dataclass(frozen=True)
class Wall:
    """A straight wall from ``start`` to ``end`` (x, y, m), ``thickness`` and ``height`` m."""

    name: str
    height: float
    start: Point
    end: Point
    thickness: float

    def __post_init__(self) -> None:
        _check(self, ("height", "thickness"), ("start", "end"))
        if tuple(self.start) == tuple(self.end):
            raise ArgumentError(f"{self.name}.end", self.end, "a point different from start")

    @property
    def outline(self) -> tuple[Point, ...]:
        (x0, y0), (x1, y1) = self.start, self.end
        length = math.hypot(x1 - x0, y1 - y0)
        nx, ny = -(y1 - y0) / length * self.thickness / 2, (x1 - x0) / length * self.thickness / 2
        return ((x0 - nx, y0 - ny), (x1 - nx, y1 - ny), (x1 + nx, y1 + ny), (x0 + nx, y0 + ny))


@dataclass(frozen=True)
class Circle:
    """A round post: ``centre`` (x, y, m), ``radius`` and ``height`` m."""

    name: str
    height: float
    centre: Point
    radius: float

    def __post_init__(self) -> None:
        _check(self, ("height", "radius"), ("centre",))

    @property
    def outline(self) -> tuple[Point, ...]:
        """A polygon around the circle."""
        (x, y), reach = self.centre, self.radius / math.cos(math.pi / _ROUND)
        turns = [2 * math.pi * k / _ROUND for k in range(_ROUND)]
        return tuple((x + reach * math.cos(t), y + reach * math.sin(t)) for t in turns)


@dataclass(frozen=True)
class Polygon:
    """A prism over ``corners`` (x, y, m, counter-clockwise, no crossing edges), ``height`` m."""

    name: str
    height: float
    corners: tuple[Point, ...]

    def __post_init__(self) -> None:
        _check(self, ("height",), ())
        require_finite(f"{self.name}.corners", self.corners, "(K, 2), m", (None, 2))

    @property
    def outline(self) -> tuple[Point, ...]:
        return self.corners


def _check(thing: Any, lengths: Sequence[str], points: Sequence[str]) -> None:
    """Raises ArgumentError unless lengths are > 0 and points finite."""
    for name in lengths:
        require_positive(f"{thing.name}.{name}", getattr(thing, name), "m")
    for name in points:
        require_finite(f"{thing.name}.{name}", getattr(thing, name), "x, y, m", (2,))


OBSTACLES: Mapping[str, type] = MappingProxyType(
    {"circle": Circle, "polygon": Polygon, "step": Step, "wall": Wall}
)
