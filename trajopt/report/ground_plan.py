"""What pictures of the ground share: robot outlines, the navigation space, the obstacle, room
around it all."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon, Rectangle

from trajopt.arrays import Array, fold
from trajopt.problem.search import WHEELS, Problem
from trajopt.report.style import BLACK, GREY, LIGHT
from trajopt.robots.robot import Robot

_NOSE = 0.22  # share of the robot's length that the mark of its front takes, chosen
_SLAB = 0.06  # m, drawn depth of the obstacle, chosen
_SQUARE = np.radians(
    60.0
)  # largest angle at which the robot is taken to meet an edge across its start yaw, chosen


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


def draw_space(axes: Axes, problem: Problem) -> None:
    """The navigation space, where control points may lie."""
    (x0, x1), (y0, y1) = problem.space.x, problem.space.y
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


def obstacle_strip(problem: Problem, robot: Robot, width: float) -> tuple[Array, float] | None:
    """(4, 2) corners of a strip for the obstacle's near edge, m, and the yaw it faces; None for
    level ground.

    Problem files give the obstacle's height, not its place. It is drawn where the robot's outline
    touches it at the goal, across the start's heading, or across the way the goal pose meets it
    where that differs by more than 60 degrees.
    """
    if problem.scene.obstacle_height <= 0:
        return None
    start, goal = np.asarray(problem.start.pose), np.asarray(problem.goal.pose)
    meets = goal[2]
    if problem.scene.motion == "lateral":
        left = sum(1 if "left" in WHEELS[i] else -1 for i in problem.goal.critical_indices)
        meets = goal[2] + (np.pi / 2 if left >= 0 else -np.pi / 2)
    turned = fold(meets - start[2])
    yaw = float(start[2] if abs(turned) <= _SQUARE else meets)
    ahead, along = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    reach = float(np.max((outline(robot, goal) - goal[:2]) @ ahead))
    near = goal[:2] + reach * ahead
    strip = [
        near - along * width / 2,
        near + along * width / 2,
        near + along * width / 2 + ahead * _SLAB,
        near - along * width / 2 + ahead * _SLAB,
    ]
    return np.array(strip), yaw


def draw_obstacle(axes: Axes, problem: Problem, robot: Robot) -> None:
    """The obstacle's near edge as a hatched strip, where there is one."""
    found = obstacle_strip(problem, robot, 1.2)
    if found is not None:
        height = problem.scene.obstacle_height
        axes.add_patch(
            Polygon(
                found[0].tolist(),
                closed=True,
                facecolor="#e4ddd0",
                edgecolor=GREY,
                hatch="//////",
                linewidth=0.8,
                label=f"obstacle, {height:g} m high (place inferred)",
            )
        )


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
