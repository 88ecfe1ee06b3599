"""Where a robot's outline meets what stands on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, rotation
from trajopt.paths.path import Path
from trajopt.world.obstacles import Obstacle

if (
    TYPE_CHECKING
):  # takes as long to load as a short command; loaded where things stand on the ground
    import shapely

SPACING = 0.005  # m of path parameter between places that are looked at; chosen
_TOUCH = 1e-9  # m of depth that is rounding; chosen
_INSIDE = "T********"  # of shapely: the interiors meet, a touch is none


@dataclass(frozen=True)
class Crossing:
    """Between path parameters ``start`` and ``end`` (m) the outline and ``obstacle`` overlap, at
    most by ``depth`` (m: how far a corner of one is inside the other)."""

    obstacle: str
    start: float
    end: float
    depth: float

    def __str__(self) -> str:
        return (
            f"the outline crosses '{self.obstacle}' from s = {self.start:.3f} to {self.end:.3f} m, "
            f"by up to {self.depth:.3f} m"
        )


@dataclass(frozen=True)
class Standing:
    """Obstacles as ground that a ``footprint`` (K, 2), m, body frame, keeps off."""

    footprint: tuple[tuple[float, float], ...]
    obstacles: tuple[Obstacle, ...]

    @cached_property
    def _solids(self) -> list[shapely.Polygon]:
        import shapely

        return [shapely.Polygon(thing.outline) for thing in self.obstacles]

    def margin(self, x: Array, y: Array, yaw: Array) -> Array:
        """Distance (m) of the outline from the nearest obstacle at poses of any shape, or less
        where it is farther than the outline's reach; where it crosses one, minus the depth."""
        import shapely

        places, angles = np.stack([np.ravel(x), np.ravel(y)], axis=1), np.ravel(yaw)
        reach = float(np.hypot(*np.transpose(self.footprint)).max())
        least = np.full(len(places), np.inf)
        for solid in self._solids:
            distance = shapely.distance(solid, shapely.points(places)) - reach
            near = np.flatnonzero(distance < 0.0)
            outlines = shapely.polygons(outlines_at(places[near], angles[near], self.footprint))
            distance[near] = shapely.distance(solid, outlines)
            for i in np.flatnonzero(distance[near] <= 0.0):
                distance[near[i]] = -depth_of(solid, outlines[i])
            least = np.minimum(least, distance)
        return least.reshape(np.shape(x))

    def rooms(self, x: Any, y: Any, yaw: Any) -> list[Any]:  # noqa: ARG002 - ground has it
        """None: an obstacle is no row of a smooth program."""
        return []


def crossings(
    path: Path, footprint: Sequence[tuple[float, float]], obstacles: Sequence[Obstacle]
) -> tuple[Crossing, ...]:
    """Every stretch of a path on which the outline crosses an obstacle, obstacle by obstacle."""
    if not obstacles:
        return ()
    import shapely

    s = np.linspace(0.0, path.length, max(int(np.ceil(path.length / SPACING)), 1) + 1)
    u = path.locate(s)
    outlines = shapely.polygons(outlines_at(path.position(u)[:, :2], path.yaw(u), footprint))
    found = []
    for thing in obstacles:
        solid = shapely.Polygon(thing.outline)
        inside = shapely.relate_pattern(solid, outlines, _INSIDE)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8)))
        for first, after in zip(edges[::2], edges[1::2], strict=True):
            depth = max(depth_of(solid, outline) for outline in outlines[first:after])
            if depth <= _TOUCH:
                continue
            found.append(Crossing(thing.name, float(s[first]), float(s[after - 1]), depth))
    return tuple(found)


def outlines_at(places: Array, yaw: Array, footprint: ArrayLike) -> Array:
    """(N, K, 2): corners of an outline at places (N, 2) and yaws (N,)."""
    turned = np.asarray(footprint, dtype=np.float64) @ np.swapaxes(rotation(yaw), -1, -2)
    return np.asarray(turned + places[:, None, :])


def depth_of(solid: shapely.Polygon, outline: shapely.Polygon) -> float:
    """How far (m) a corner of what both have in common is inside one of them."""
    import shapely

    corners = shapely.points(shapely.get_coordinates(shapely.intersection(solid, outline)))
    inside = [shapely.distance(whole.exterior, corners) for whole in (solid, outline)]
    return float(np.max(inside, initial=0.0))
