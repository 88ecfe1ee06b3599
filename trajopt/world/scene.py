"""Where a robot drives: the ground with its friction, and what stands on it."""

from __future__ import annotations

from dataclasses import dataclass

from trajopt.arrays import require_positive
from trajopt.errors import ArgumentError
from trajopt.world.ground import Ground
from trajopt.world.obstacles import Obstacle


@dataclass(frozen=True)
class Scene:
    """``friction`` (coefficient between wheels and ground), the ``ground``'s shape (``Flat()``, a
    ``Plane``, ``Ramps``, a ``HeightMap`` or a ``Mesh``), and ``obstacles`` that stand on it. Where
    ``friction_varies`` from place to place or wheel to wheel, ``friction`` is the least of it, and
    physics, which drives with one coefficient, refuses.

    Raises ArgumentError for a friction at which no wheel drives.
    """

    friction: float
    ground: Ground
    obstacles: tuple[Obstacle, ...] = ()
    friction_varies: bool = False

    def __post_init__(self) -> None:
        require_positive("scene.friction", self.friction, "(coefficient)")
        if not hasattr(self.ground, "height"):
            raise ArgumentError("scene.ground", self.ground, "the shape of the ground, as Flat()")
        names = [obstacle.name for obstacle in self.obstacles]
        if len(set(names)) < len(names):
            raise ArgumentError("scene.obstacles", names, "obstacles with different names")
