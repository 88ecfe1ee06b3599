"""What the robot drives on: friction and terrain, as engine-independent solids.

World frame: x, y on the level ground, z up, ground at height 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from trajopt.errors import ArgumentError
from trajopt.simulate.rollers import Vector


@dataclass(frozen=True)
class Flat:
    """Level ground at height 0."""


@dataclass(frozen=True)
class Step:
    """A block on level ground: ``height`` [m], the middle of its front edge at ``place`` (x, y)
    [m].

    ``direction`` [rad] is the yaw in which it extends by ``depth`` [m] behind the edge, ``width``
    [m] the length of the edge.
    """

    height: float
    place: tuple[float, float]
    direction: float = 0.0
    width: float = 4.0
    depth: float = 4.0

    def __post_init__(self) -> None:
        """Raise ArgumentError for a block without volume."""
        for name in ("height", "width", "depth"):
            require(name, getattr(self, name), low=0.0, expected="a positive length in m")
        for value in (*self.place, self.direction):
            require("place, direction", value, low=-math.inf, expected="finite numbers (m, m, rad)")


@dataclass(frozen=True)
class Ramp:
    """A tilted plate: its foot edge on the ground at ``place`` (x, y) [m], rising by ``slope``
    [rad].

    ``direction`` [rad] is the yaw in which it rises over ``length`` [m] (measured along the plate),
    ``width`` [m] the length of the foot edge.
    """

    slope: float
    place: tuple[float, float]
    direction: float = 0.0
    width: float = 4.0
    length: float = 4.0

    def __post_init__(self) -> None:
        """Raise ArgumentError for a slope outside (0, 60 deg) or a plate without area."""
        if not 0.0 < self.slope < math.radians(60.0):
            raise ArgumentError("slope", self.slope, "an angle between 0 and 60 deg, in rad")
        for name in ("width", "length"):
            require(name, getattr(self, name), low=0.0, expected="a positive length in m")


Terrain = Flat | Step | Ramp


@dataclass(frozen=True)
class Block:
    """A solid box: ``centre`` [m], full ``size`` [m], turned by ``pitch`` about y, then ``yaw``
    about z."""

    centre: Vector
    size: Vector
    yaw: float
    pitch: float

    def quaternion(self) -> tuple[float, float, float, float]:
        """Attitude as (x, y, z, w)."""
        cy, sy = math.cos(self.yaw / 2.0), math.sin(self.yaw / 2.0)
        cp, sp = math.cos(self.pitch / 2.0), math.sin(self.pitch / 2.0)
        return (-sy * sp, cy * sp, sy * cp, cy * cp)


def blocks(terrain: Terrain) -> tuple[Block, ...]:
    """Solids that stand on the ground plane; a new terrain kind is one case here.

    Raises ArgumentError for a terrain that no engine knows.
    """
    plate = 0.2  # m, thickness below the surface (chosen: deeper than any penetration)
    if isinstance(terrain, Flat):
        return ()
    cosine, sine = math.cos(terrain.direction), math.sin(terrain.direction)
    x, y = terrain.place
    if isinstance(terrain, Step):
        half = terrain.depth / 2.0
        centre = (
            x + half * cosine,
            y + half * sine,
            terrain.height - plate / 2.0 - terrain.height / 2.0,
        )
        size = (terrain.depth, terrain.width, terrain.height + plate)
        return (Block(centre, size, terrain.direction, 0.0),)
    half = terrain.length / 2.0
    along = half * math.cos(terrain.slope) + plate / 2.0 * math.sin(terrain.slope)
    up = half * math.sin(terrain.slope) - plate / 2.0 * math.cos(terrain.slope)
    size = (terrain.length, terrain.width, plate)
    return (
        Block((x + along * cosine, y + along * sine, up), size, terrain.direction, -terrain.slope),
    )


@dataclass(frozen=True)
class Scene:
    """Where the robot drives: ``friction`` [-] between roller and ground, and the ``terrain``."""

    friction: float = 0.8
    terrain: Terrain = Flat()

    def __post_init__(self) -> None:
        """Raise ArgumentError for a friction at which no wheel can drive."""
        require(
            "friction", self.friction, low=0.0, expected="a positive coefficient (0 drives nowhere)"
        )
        blocks(self.terrain)


def require(name: str, value: float, *, low: float, expected: str) -> None:
    """Raise ArgumentError unless ``value`` is finite and greater than ``low``."""
    if not math.isfinite(value) or value <= low:
        raise ArgumentError(name, value, expected)
