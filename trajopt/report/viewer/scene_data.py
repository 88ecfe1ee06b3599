"""The ground and what stands on it, as the page shows them."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.report.viewer.pages import packed
from trajopt.world.ground import Ground
from trajopt.world.height_map import HeightMap
from trajopt.world.obstacles import Obstacle
from trajopt.world.scene import Scene

_ROOM = 1.2  # m of ground around a motion and what stands near it, chosen
_CELLS = 64  # of a ground along and across, beside the lines where it bends; chosen
_POINTS = 220  # of a height map along a side that are drawn at most, chosen
_BENDS = 6  # stretches between two lines of the ground that are close to each other, chosen
_NEAR = 0.5  # m between lines of the ground that count as close, chosen
_FOOT = 0.02  # m by which things reach below the ground


def scene_data(scene: Scene, places: Array) -> dict[str, Any]:
    """Around ``places`` (N, 2), m: the ground as heights on a grid (a plane at height 0 where it is level), obstacles
    as outlines from below the ground up to their tops."""
    low, high = places.min(axis=0) - _ROOM, places.max(axis=0) + _ROOM
    return {
        "low": low.tolist(),
        "high": high.tolist(),
        "ground": None if scene.ground.level else _surface(scene.ground, low, high),
        "things": [_thing(thing, scene.ground) for thing in scene.obstacles],
    }


def _thing(thing: Obstacle, ground: Ground) -> dict[str, Any]:
    corners = np.array(thing.outline)
    under = ground.height(corners[:, 0], corners[:, 1])
    return {
        "name": thing.name,
        "kind": type(thing).__name__.lower(),
        "outline": thing.outline,
        "low": float(under.min()) - _FOOT,
        "high": float(under.max()) + thing.height,
    }


def _surface(ground: Ground, low: Array, high: Array) -> dict[str, Any]:
    """Heights (M, K) at distances along and across a direction; cells are split from their lower left to their upper
    right corner."""
    shape = getattr(ground, "map", ground)
    if isinstance(shape, HeightMap):
        direction = 0.0
        axes = [_of_map(shape, k, low[k], high[k]) for k in (0, 1)]
    else:
        direction = ground.lines[0].direction if ground.lines else 0.0
        axes = _of_lines(ground, direction, low, high)
    cos, sin = np.cos(direction), np.sin(direction)
    along, across = np.meshgrid(axes[0], axes[1], indexing="ij")
    heights = ground.height(along * cos - across * sin, along * sin + across * cos)
    return {
        "direction": direction,
        "along": packed(axes[0]),
        "across": packed(axes[1]),
        "heights": packed(heights),
    }


def _of_map(ground: HeightMap, k: int, low: float, high: float) -> Array:
    """The map's own points near the motion, thinned where there are too many."""
    points = ground.origin[k] + ground.spacing * np.arange(ground.heights.shape[1 - k])
    near = points[(points >= low - ground.spacing) & (points <= high + ground.spacing)]
    return np.asarray(near[:: -(-len(near) // _POINTS)] if len(near) > 1 else points)


def _of_lines(ground: Ground, direction: float, low: Array, high: Array) -> list[Array]:
    """Evenly spaced, and on the lines along which the ground bends, finer between close ones."""
    cos, sin = np.cos(direction), np.sin(direction)
    corners = np.array([(x, y) for x in (low[0], high[0]) for y in (low[1], high[1])])
    found = []
    for k, axis in enumerate((np.array([cos, sin]), np.array([-sin, cos]))):
        reach = corners @ axis
        points = np.linspace(reach.min(), reach.max(), _CELLS + 1)
        turned = direction + k * np.pi / 2
        for line in ground.lines:
            if abs(np.sin(line.direction - turned)) < 1e-9:
                at = line.distance * np.sign(np.cos(line.direction - turned))
                points = np.append(points, at)
        points = np.unique(points[(points >= reach.min()) & (points <= reach.max())])
        if ground.lines:
            fine = [
                np.linspace(a, b, _BENDS, endpoint=False) if b - a < _NEAR else [a]
                for a, b in pairwise(points)
            ]
            points = np.append(np.concatenate(fine), points[-1])
        found.append(points)
    return found
