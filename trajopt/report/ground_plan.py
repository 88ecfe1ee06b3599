"""What pictures of the ground share: robot outlines, the navigation space, obstacles, room around
it all."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon, Rectangle
from matplotlib.ticker import MaxNLocator

from trajopt.arrays import Array
from trajopt.problem.task import Space
from trajopt.report.style import BLACK, BROWN, GREY, LIGHT
from trajopt.robots.robot import Robot
from trajopt.world.ground import Ground
from trajopt.world.scene import Scene

_NOSE = 0.22  # share of the robot's length that the mark of its front takes, chosen
_AROUND = 1.0  # m, around a motion in which heights are drawn, chosen
_PLACES = 200  # along x and y, where heights are read, chosen
_LEVELS = 9  # contour lines, about; chosen
_FLAT = 1e-6  # m, chosen: above rounding
_ROOM = 0.15  # m, around a motion in which obstacles are drawn, chosen


def outline(robot: Robot, pose: Array) -> Array:
    """(K, 2): corners of the robot's footprint in the world, m, at pose (x, y, yaw)."""
    return placed(np.asarray(robot.footprint, dtype=np.float64), pose)


def placed(points: Array, pose: Array) -> Array:
    """(K, 2): points of the body frame in the world, m."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + pose[:2])


def draw_robot(
    axes: Axes,
    robot: Robot,
    pose: Array,
    colour: str = GREY,
    *,
    strong: bool = False,
    label: str | None = None,
    **options: Any,
) -> None:
    """Outline of the robot with a triangle at its front; ``strong`` for the poses that matter."""
    corners = np.asarray(robot.footprint, dtype=np.float64)
    front, half = corners[:, 0].max(), np.ptp(corners[:, 1]) * 0.09  # slender, so that it points
    nose = np.array(
        [
            [front, 0.0],
            [front - _NOSE * np.ptp(corners[:, 0]), half],
            [front - _NOSE * np.ptp(corners[:, 0]), -half],
        ]
    )
    width, shade = (1.5, 0.9) if strong else (0.7, 0.25)
    axes.add_patch(
        Polygon(
            outline(robot, pose).tolist(),
            closed=True,
            fill=False,
            edgecolor=colour,
            linewidth=width,
            alpha=max(shade, 0.6),
            label=label,
            **options,
        )
    )
    axes.add_patch(
        Polygon(
            placed(nose, pose).tolist(),
            closed=True,
            facecolor=colour,
            edgecolor="none",
            alpha=shade,
            **options,
        )
    )


def draw_space(axes: Axes, space: Space) -> None:
    """The navigation space, where control points may lie."""
    (x0, x1), (y0, y1) = space.x, space.y
    axes.add_patch(
        Rectangle(
            (x0, y0),
            x1 - x0,
            y1 - y0,
            facecolor="#f6f6f2",
            edgecolor=LIGHT,
            linewidth=1.0,
            zorder=0.2,
            label="navigation space",
        )
    )


def draw_scene(axes: Axes, scene: Scene, seen: Array) -> None:
    """Obstacles hatched, and contour lines of the ground around ``seen`` (N, 2) where it is not
    level."""
    if not scene.ground.level:
        _draw_heights(axes, scene.ground, seen)
    for thing in scene.obstacles:
        axes.add_patch(
            Polygon(
                thing.outline,
                closed=True,
                facecolor="#e4ddd0",
                edgecolor=GREY,
                hatch="//////",
                linewidth=0.8,
                zorder=0.3,
                label=f"{thing.name}, {thing.height:g} m high",
            )
        )


def _draw_heights(axes: Axes, ground: Ground, seen: Array) -> None:
    low, high = seen.min(axis=0) - _AROUND, seen.max(axis=0) + _AROUND
    x, y = np.meshgrid(*(np.linspace(low[k], high[k], _PLACES) for k in (0, 1)))
    z = ground.height(x, y)
    levels = MaxNLocator(_LEVELS).tick_values(float(z.min()), float(z.max()))
    inner = (levels > z.min() + _FLAT) & (levels < z.max() - _FLAT)  # no lines on level stretches
    if inner.any():
        lines = axes.contour(
            x, y, z, levels=levels[inner], colors=BROWN, linewidths=0.6, zorder=0.3
        )
        axes.clabel(lines, fmt="%g", fontsize=6.5)
    axes.plot([], [], color=BROWN, linewidth=0.6, label="height of the ground, m")


def near_points(scene: Scene, seen: Array) -> Array:
    """(N, 2): points of the obstacles, moved into the box around ``seen`` (N, 2) with a little
    room, so that a picture shows what stands there and not the whole of it."""
    corners = [np.array(thing.outline) for thing in scene.obstacles]
    low, high = seen.min(axis=0) - _ROOM, seen.max(axis=0) + _ROOM
    return np.asarray(np.clip(np.vstack([*corners, seen[:1]]), low, high))


def frame_points(axes: Axes, points: Array, margin: float = 0.05) -> None:
    """Equal scales on both axes, with room around points (N, 2)."""
    low, high = points.min(axis=0), points.max(axis=0)
    room = margin * float(np.max(high - low))
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(low[0] - room, high[0] + room)
    axes.set_ylim(low[1] - room, high[1] + room)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def mark_pose(axes: Axes, pose: Array, text: str, offset: tuple[float, float]) -> None:
    """A short text beside a position, offset in points."""
    axes.annotate(
        text,
        (float(pose[0]), float(pose[1])),
        xytext=offset,
        textcoords="offset points",
        fontsize=8,
        color=BLACK,
        ha="center",
        va="center",
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.8},
    )
