"""Grounds and paths that the tests of postures and forces share."""

from __future__ import annotations

import numpy as np

from trajopt.paths.path import Path
from trajopt.world.height_map import HeightMap
from trajopt.world.mesh import Mesh
from trajopt.world.plane import Plane
from trajopt.world.ramp import Ramp, Ramps

AXIS = np.arange(-30, 61) * 0.1
X, Y = np.meshgrid(AXIS, AXIS)
ORIGIN = (float(AXIS[0]), float(AXIS[0]))


def height_map(values: np.ndarray) -> HeightMap:
    return HeightMap(values, 0.1, ORIGIN)


def plane_map(plane: Plane) -> HeightMap:
    return height_map(plane.height(X, Y))


def mesh_of(heights: HeightMap) -> Mesh:
    """The same points, triangulated."""
    rows, columns = heights.heights.shape
    x, y = (
        heights.origin[k] + heights.spacing * np.arange(n) for k, n in ((0, columns), (1, rows))
    )
    points = np.column_stack(
        [np.tile(x, rows), np.repeat(y, columns), np.asarray(heights.heights).ravel()]
    )
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    lower = np.column_stack([corner, corner + 1, corner + columns + 1])
    upper = np.column_stack([corner, corner + columns + 1, corner + columns])
    return Mesh(points, np.vstack([lower, upper]), heights.spacing)


HILLS = height_map(0.2 * np.sin(X) * np.cos(1.3 * Y))
TILTED = Plane(0.3, 0.7)
RAMP = Ramp((0.5, 0.0), 0.4, 2.0, 0.3, 0.4)
GROUNDS = {
    "plane": TILTED,
    "plane map": plane_map(TILTED),
    "hills": HILLS,
    "mesh": mesh_of(HILLS),
    "ramp": Ramps((RAMP,), 1.0),
    "smooth ramp": Ramps((Ramp((0.5, 0.0), 0.4, 2.0, 0.3, 0.4, "smooth"),), 1.0),
}
POINTS = [[0, 0], [1, 0.4], [2, -0.2], [3, 0.5]]
PATHS = {
    "along": Path.through(POINTS),
    "own": Path.through(POINTS, heading=[0.2, 1.0, 0.1, -0.7], turning_length=0.5),
}
