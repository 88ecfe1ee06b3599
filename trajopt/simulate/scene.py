"""A scene as engines build it: solids on a plane, plates or a height field.

World frame: x, y level, z up. What no engine can build is refused by name. Planes and ramps along
one line are exact but for a ramp's rounded edges; every other ground is a height field: of the
smooth surface that plans drive on where its ``area`` is known, else of a map's own triangles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.simulate.model import Pose, Shape, cylinder, prisms
from trajopt.world.ground import Ground
from trajopt.world.height_map import HeightMap
from trajopt.world.mesh import Mesh
from trajopt.world.obstacles import Circle, Obstacle, Step
from trajopt.world.plane import Plane
from trajopt.world.ramp import Ramps
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

PLATE = 0.2  # m of solid below a surface, chosen: deeper than any penetration
BEYOND = 50.0  # m that ramps' plates extend to the sides, before and behind; chosen
EDGE_PLATES = 8  # across a ramp's rounded edge, chosen: a change of slope in nine small ones
SPACING = 0.02  # m between heights of a smooth surface, chosen: 0.1 mm off at a radius of 0.5 m
MOST_POINTS = 250_000  # of a height field; Bullet copies them through Python, chosen
SURFACE_ERROR = 0.001  # m that a height field may be off the smooth surface, chosen
AROUND = 3.0  # m around ramps in which they are built where no area is given, chosen

Area = tuple[tuple[float, float], tuple[float, float]]  # lowest and highest x, y, m


@dataclass(frozen=True)
class Solid:
    """One convex piece of the ground, or of the thing on it called ``name``; wheels and chassis
    meet "ground", the robot's outline "obstacles"."""

    name: str
    shape: Shape
    meets: Literal["ground", "obstacles"]


@dataclass(frozen=True, eq=False)
class Stage:
    """What stands in an engine: ``solids``, and a ``plane`` or a height ``field``, which is
    ``smooth`` where it follows the surface that plans drive on."""

    scene: Scene
    solids: tuple[Solid, ...]
    plane: Plane | None
    field: HeightMap | None
    smooth: bool

    @property
    def broken(self) -> bool:
        """Whether wheels meet faces and bumps, so that the width of a tyre counts."""
        rough = self.field is not None and not self.smooth
        return rough or any(isinstance(o, Step) for o in self.scene.obstacles)

    @property
    def uneven(self) -> bool:
        """Whether rollers have to give way to share the load: on slopes and hills, not on level
        ground, and not at steps, where rollers are what meets an edge."""
        level = self.plane is not None and self.plane.slope == 0.0
        return not (level or self.broken)

    @property
    def plates(self) -> bool:
        """Whether wheels meet planes that move along with them, instead of plates and ``field``."""
        return self.plane is None and not self.broken

    @property
    def has_obstacles(self) -> bool:
        return any(solid.meets == "obstacles" for solid in self.solids)

    def height(self, places: Array) -> Array:
        """Heights (...,) of the ground, without what stands on it, at places (..., 2)."""
        ground = self.field or self.scene.ground
        return np.asarray(ground.height(places[..., 0], places[..., 1]))


def stage(scene: Scene, area: Area | None = None) -> Stage:
    """Solids for an engine, the ground smooth in ``area``.

    Raises ArgumentError for a ground that no engine can build, or so curved that a height field of
    that area would be off by more than SURFACE_ERROR.
    """
    if scene.friction_varies:
        expected = "one coefficient in physics: of a problem, ground.friction = one number"
        raise ArgumentError("scene.friction", "varies", expected)
    ground, field = scene.ground, None
    flat = isinstance(ground, Flat) or (isinstance(ground, Ramps) and ground.level)
    plane = Plane(0.0, 0.0) if flat else None
    plates: tuple[Solid, ...] = ()
    if isinstance(ground, Plane):
        plane = ground
    elif plane is not None:
        pass
    elif isinstance(ground, Ramps) and _along_one_line(ground):
        plates = tuple(Solid("ground", plate, "ground") for plate in _plates(ground))
    elif isinstance(ground, (HeightMap, Mesh)) and area is None:
        field = ground if isinstance(ground, HeightMap) else ground.map
    elif isinstance(ground, Ramps) and area is None:
        field = _smooth(ground, _around(ground))
    elif area is not None and hasattr(ground, "partial"):
        field = _smooth(ground, area)
    else:
        expected = "Flat(), a Plane, Ramps, a HeightMap or a Mesh in physics"
        raise ArgumentError("scene.ground", ground, expected)
    things = tuple(solid for thing in scene.obstacles for solid in _solids(thing, scene))
    smooth = area is not None or isinstance(ground, Ramps)
    return Stage(scene, plates + things, plane, field, smooth)


def _smooth(ground: Ground, area: Area) -> HeightMap:
    """Heights of the smooth surface in ``area``, as far as a map reaches."""
    map_ = ground.map if isinstance(ground, Mesh) else ground
    low, high = np.array(area)
    spacing, start = max(SPACING, math.sqrt(np.prod(high - low) / MOST_POINTS)), low
    if isinstance(map_, HeightMap):  # every point of the map is one of the field's
        spacing = map_.spacing / math.ceil(map_.spacing / spacing - 1e-9)
        start = np.array(map_.origin)
        low, high = np.maximum(low, start), np.minimum(high, start + map_.size)
    first = np.floor((low - start) / spacing + 1e-9).astype(int)
    last = np.maximum(np.ceil((high - start) / spacing - 1e-9).astype(int), first + 1)
    x, y = (float(start[k]) + spacing * np.arange(first[k], last[k] + 1) for k in (0, 1))
    heights = _height(ground, x, y)
    field = HeightMap(heights, spacing, (float(x[0]), float(y[0])))
    between = (x[:-1] + x[1:]) / 2.0, (y[:-1] + y[1:]) / 2.0
    columns, rows = np.meshgrid(*between)
    off = float(np.abs(field.height(columns, rows) - _height(ground, *between)).max())
    if off > SURFACE_ERROR:
        smaller = f"ground that bends less, or a smaller area: a height field is {off:.2g} m off it"
        raise ArgumentError("scene.ground", ground, smaller)
    return field


def _height(ground: Ground, x: Array, y: Array) -> Array:
    """Heights of the smooth surface on a grid of places x by y."""
    columns, rows = np.meshgrid(x, y)
    return ground.partial(columns, rows, 0, 0)


def _around(ground: Ramps) -> Area:
    """What all ramps rise in, seen from above, and AROUND beside them."""
    feet = np.array([ramp.place for ramp in ground.ramps])
    ahead = np.array([(math.cos(r.direction), math.sin(r.direction)) for r in ground.ramps])
    places = np.vstack([feet, feet + ahead * np.array([[r.run] for r in ground.ramps])])
    low, high = (places.min(axis=0) - AROUND).tolist(), (places.max(axis=0) + AROUND).tolist()
    return (low[0], low[1]), (high[0], high[1])


def _along_one_line(ground: Ramps) -> bool:
    turn = [ramp.direction - ground.ramps[0].direction for ramp in ground.ramps]
    return bool(np.abs(np.sin(turn)).max(initial=0.0) < 1e-9)


def _solids(thing: Obstacle, scene: Scene) -> list[Solid]:
    """The thing from below the ground up to its height above the highest ground under it."""
    corners = np.array(thing.outline)
    under = np.asarray(scene.ground.height(corners[:, 0], corners[:, 1]))
    low, high = float(under.min()) - PLATE, float(under.max()) + thing.height
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    if isinstance(thing, Circle):
        at = Pose((*thing.centre, middle))
        shapes: tuple[Shape, ...] = (cylinder(thing.radius, 2.0 * half, at),)
    elif _is_rectangle(corners):
        x, y = corners.mean(axis=0).tolist()
        (ax, ay), (bx, by) = corners[1] - corners[0], corners[2] - corners[1]
        size = (math.hypot(ax, ay) / 2.0, math.hypot(bx, by) / 2.0, half)
        shapes = (Shape("box", size, Pose((x, y, middle), yaw=math.atan2(ay, ax))),)
    else:
        shapes = prisms(thing.outline, low, high)
    meets: Literal["ground", "obstacles"] = "ground" if isinstance(thing, Step) else "obstacles"
    return [Solid(thing.name, shape, meets) for shape in shapes]


def _is_rectangle(corners: Array) -> bool:
    if len(corners) != 4:
        return False
    sides = np.roll(corners, -1, axis=0) - corners
    size = float(np.abs(sides).max())
    square = np.abs(np.sum(sides * np.roll(sides, -1, axis=0), axis=1)).max() < 1e-9 * size**2
    return bool(square and np.abs(sides[0] + sides[2]).max() < 1e-9 * size)


def _plates(ground: Ramps) -> list[Shape]:
    """Tilted plates, edge to edge, through the ramps' rounded profile: exact where it is straight.

    Convex pieces rather than a mesh, because MuJoCo takes the convex hull of any mesh.
    """
    first = ground.ramps[0]
    turn = np.array([r.direction - first.direction for r in ground.ramps])
    along = np.array([math.cos(first.direction), math.sin(first.direction)])
    edges: list[float] = []
    for ramp, sign in zip(ground.ramps, np.sign(np.cos(turn)), strict=True):
        foot = float((np.array(ramp.place) - np.array(first.place)) @ along)
        rounded = ramp.rounding * np.linspace(-0.5, 0.5, EDGE_PLATES + 1)
        edges += [float(foot + sign * (at + d)) for at in (0.0, ramp.run) for d in rounded]
    d = np.unique(np.round(edges, 9))
    d = np.concatenate([[d[0] - BEYOND], d, [d[-1] + BEYOND]])
    x, y = (first.place[k] + d * along[k] for k in (0, 1))
    z = ground.height(x, y)
    found = []
    for i in range(len(d) - 1):
        run, rise = float(d[i + 1] - d[i]), float(z[i + 1] - z[i])
        slope = math.atan2(rise, run)
        ahead = float(d[i] + d[i + 1]) / 2.0 + PLATE / 2.0 * math.sin(slope)
        up = float(z[i] + z[i + 1]) / 2.0 - PLATE / 2.0 * math.cos(slope)
        place = (first.place[0] + ahead * along[0], first.place[1] + ahead * along[1])
        at = Pose((float(place[0]), float(place[1]), up), -slope, first.direction)
        size = (math.hypot(run, rise) / 2.0, BEYOND, PLATE / 2.0)
        found.append(Shape("box", size, at))
    return found
