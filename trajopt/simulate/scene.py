"""A scene as engines build it: solids on a plane, plates or a height field.

World frame: x, y level, z up. What no engine can build is refused by name.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.simulate.model import Pose, Shape, cylinder, prisms
from trajopt.world.height_map import HeightMap
from trajopt.world.obstacles import Circle, Obstacle, Step
from trajopt.world.ramp import Ramps
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

PLATE = 0.2  # m of solid below a surface, chosen: deeper than any penetration
BEYOND = 50.0  # m that ramps' plates extend to the sides, before and behind; chosen
EDGE_PLATES = 8  # across a ramp's rounded edge, chosen: a change of slope in nine small ones


@dataclass(frozen=True)
class Solid:
    """One convex piece of the ground, or of the thing on it called ``name``; wheels and chassis
    meet "ground", the robot's outline "obstacles"."""

    name: str
    shape: Shape
    meets: Literal["ground", "obstacles"]


@dataclass(frozen=True, eq=False)
class Stage:
    """What stands in an engine: ``solids``, and a ``plane`` at height 0 or a height ``field``."""

    scene: Scene
    solids: tuple[Solid, ...]
    plane: bool
    field: HeightMap | None

    @property
    def broken(self) -> bool:
        """Whether wheels meet faces and bumps, so that the width of a tyre counts."""
        return self.field is not None or any(isinstance(o, Step) for o in self.scene.obstacles)

    @property
    def has_obstacles(self) -> bool:
        return any(solid.meets == "obstacles" for solid in self.solids)

    def height(self, places: Array) -> Array:
        """Heights (...,) of the ground, without what stands on it, at places (..., 2)."""
        return np.asarray(self.scene.ground.height(places[..., 0], places[..., 1]))


def stage(scene: Scene) -> Stage:
    """Solids for an engine. Raises ArgumentError for a ground that no engine can build."""
    ground = scene.ground
    if scene.friction_varies:
        expected = "one coefficient in physics: of a problem, ground.friction = one number"
        raise ArgumentError("scene.friction", "varies", expected)
    plates: tuple[Solid, ...] = ()
    if isinstance(ground, Ramps):
        plates = tuple(Solid("ground", plate, "ground") for plate in _plates(ground))
    elif not isinstance(ground, (Flat, HeightMap)):
        raise ArgumentError("scene.ground", ground, "Flat(), Ramps or a HeightMap in physics")
    things = tuple(solid for thing in scene.obstacles for solid in _solids(thing, scene))
    field = ground if isinstance(ground, HeightMap) else None
    return Stage(scene, plates + things, isinstance(ground, Flat), field)


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

    Convex pieces rather than a mesh, because MuJoCo takes the convex hull of any mesh. Raises
    ArgumentError where ramps rise in different directions.
    """
    first = ground.ramps[0]
    turn = np.array([r.direction - first.direction for r in ground.ramps])
    if np.abs(np.sin(turn)).max() > 1e-9:
        raise ArgumentError(
            "ground.ramps", [r.direction for r in ground.ramps],
            "ramps along one line in physics (directions that differ by 0 or half a turn)",
        )  # fmt: skip
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
