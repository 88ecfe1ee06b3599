"""Whether an outline is free, told by nothing that planned the route."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from shapely import affinity

from trajopt.paths.path import Path
from trajopt.robots.robot import Robot


def independent_clearance(path: Path, robot: Robot, solids: Sequence[shapely.Geometry]) -> float:
    """Least distance (m) of the outline from ``solids`` at places at most 1 cm and 1 deg apart."""
    outline, whole = shapely.Polygon(robot.footprint), shapely.union_all(list(solids))
    u = np.linspace(path.start, path.end, 20_001)
    place, yaw = path.position(u)[:, :2], np.unwrap(path.yaw(u))
    moved = np.cumsum(np.append(0.0, np.linalg.norm(np.diff(place, axis=0), axis=1)))
    turned = np.cumsum(np.append(0.0, np.abs(np.diff(yaw))))
    cell = np.floor(np.maximum(moved / 0.01, turned / np.radians(1)) * 1.01)
    shapely.prepare(whole)
    least = np.inf
    for i in np.flatnonzero(np.diff(cell, prepend=-1)):
        there = affinity.rotate(outline, yaw[i], origin=(0, 0), use_radians=True)
        least = min(least, affinity.translate(there, *place[i]).distance(whole))
    return float(least)
