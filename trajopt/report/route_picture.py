"""What pictures of routes show: cells of a map, the borders of a space, the ways tried, the ground
that the outline sweeps, and where it comes nearest."""

from __future__ import annotations

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Shape

from trajopt.arrays import Array
from trajopt.report.style import GREY, PURPLE, SKY, VERMILION
from trajopt.solution import Solution
from trajopt.world.crossing import outlines_at
from trajopt.world.scene import Scene

_MOST_SWEPT = 200  # outlines whose union is drawn as swept; chosen
_TOLD = 1.0  # m of clearance from which it is not marked; chosen


def draw_borders(axes: Axes, scene: Scene) -> None:
    """Occupied cells, and the ground outside of a space."""
    if scene.map is not None:
        cells = PolyCollection(
            list(scene.map.polygons), facecolors=GREY, edgecolors="none", zorder=0.25, label="map"
        )
        axes.add_collection(cells, autolim=False)
    if scene.space is not None:
        axes.add_patch(
            PathPatch(
                _shape(scene.space), facecolor="none", edgecolor=GREY, linewidth=1.2, zorder=0.3
            )
        )


def draw_route(axes: Axes, solution: Solution, poses: Array) -> None:
    """The swept ground, the other ways, and the least clearance, along poses (N, 3)."""
    robot, route = solution.problem.robot, solution.route
    some = poses[np.linspace(0, len(poses) - 1, _MOST_SWEPT).round().astype(int)]
    outlines = shapely.polygons(outlines_at(some[:, :2], some[:, 2], robot.footprint))
    for k, part in enumerate(shapely.get_parts(shapely.union_all(outlines))):
        label = None if k else "swept by the outline"
        axes.add_patch(
            PathPatch(_shape(part), facecolor=SKY, alpha=0.25, linewidth=0, zorder=1.2, label=label)
        )
    if route is not None:
        others = [a for a in route.attempts if a is not route.best and a.path is not None]
        for attempt in others:
            assert attempt.path is not None
            u = np.linspace(attempt.path.start, attempt.path.end, 400)
            p = attempt.path.position(u)
            told = "" if attempt.trajectory is None else f", {attempt.trajectory.duration:.2f} s"
            label = f"tried: {attempt.method}{told}"
            axes.plot(p[:, 0], p[:, 1], color=PURPLE, lw=0.9, ls="--", zorder=2.1, label=label)
    near = solution.clearance
    if near is None or not 0 <= near.distance < _TOLD:
        return
    pose = np.array([near.pose])
    outline = shapely.polygons(outlines_at(pose[:, :2], pose[:, 2], robot.footprint))[0]
    keep_out = solution.problem.scene.keep_out
    solid = keep_out.solids[int(keep_out.distances(np.array([outline]))[1][0])]
    (x, y), _ = shapely.shortest_line(outline, solid).coords
    label = f"nearest: {near.distance:.3f} m"
    axes.plot([x], [y], "o", color=VERMILION, markersize=5, zorder=3.2, label=label)


def _shape(area: shapely.Polygon) -> Shape:
    rings = [area.exterior, *area.interiors]
    return Shape.make_compound_path(*(Shape(np.array(ring.coords)) for ring in rings))
