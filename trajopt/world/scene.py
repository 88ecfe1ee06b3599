"""Where a robot drives: the ground with its friction, and what stands on it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from trajopt.arrays import Array, require_positive
from trajopt.errors import ArgumentError
from trajopt.world.ground import Ground
from trajopt.world.obstacles import Obstacle, Polygon
from trajopt.world.occupancy import OccupancyMap

if TYPE_CHECKING:
    import shapely

    from trajopt.world.keep_out import KeepOut

_WALLS = 1.0  # m, how high what a map or a space keeps out of stands in physics; chosen


@dataclass(frozen=True)
class Scene:
    """``friction`` (coefficient between wheels and ground), the ``ground``'s shape (``Flat()``, a
    ``Plane``, ``Ramps``, a ``HeightMap`` or a ``Mesh``), and ``obstacles`` that stand on it. Where
    ``friction_varies`` from place to place or wheel to wheel, ``friction`` is the least of it, and
    physics, which drives with one coefficient, refuses. ``map``: cells that are kept out of;
    ``space``: a polygon, with holes or without, that outlines stay in.

    Raises ArgumentError for a friction at which no wheel drives.
    """

    friction: float
    ground: Ground
    obstacles: tuple[Obstacle, ...] = ()
    friction_varies: bool = False
    map: OccupancyMap | None = None
    space: shapely.Polygon | None = None

    def __post_init__(self) -> None:
        require_positive("scene.friction", self.friction, "(coefficient)")
        if not hasattr(self.ground, "height"):
            raise ArgumentError("scene.ground", self.ground, "the shape of the ground, as Flat()")
        names = [obstacle.name for obstacle in self.obstacles]
        if len(set(names)) < len(names):
            raise ArgumentError("scene.obstacles", names, "obstacles with different names")

    @cached_property
    def keep_out(self) -> KeepOut:
        """All that an outline keeps out of: obstacles by name, the "map" and what
        is beyond it, and the outside of "space"."""
        import shapely

        from trajopt.world.keep_out import KeepOut, outside_of

        solids = [shapely.Polygon(thing.outline) for thing in self.obstacles]
        names = [thing.name for thing in self.obstacles]
        if self.map is not None:
            cells = list(shapely.polygons(self.map.polygons))
            beyond = list(outside_of(shapely.Polygon(self.map.corners)))
            solids, names = solids + cells + beyond, names + ["map"] * len(cells)
            names += ["beyond the map"] * len(beyond)
        if self.space is not None:
            outside = list(outside_of(self.space))
            solids, names = solids + outside, names + ["space"] * len(outside)
        return KeepOut(tuple(solids), tuple(names))

    def around(self, places: Array, reach: float) -> Scene:
        """The same with what map and space keep out of as obstacles, as far as it is within
        ``reach`` (m) of places (N, 2): for physics."""
        if self.map is None and self.space is None:
            return self
        import shapely
        from shapely.geometry.polygon import orient

        area, own = shapely.LineString(places).buffer(reach), len(self.obstacles)
        standing = list(self.obstacles)
        for k in self.keep_out.within(area):
            if k >= own:
                solid = self.keep_out.solids[k]
                ring = orient(solid).exterior.coords[:-1]
                name = f"{self.keep_out.names[k]} {k - own}"
                standing.append(Polygon(name, _WALLS, tuple((x, y) for x, y in ring)))
        return replace(self, obstacles=tuple(standing), map=None, space=None)
