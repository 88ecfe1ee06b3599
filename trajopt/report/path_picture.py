"""The path: control points, robot outlines along it, navigation space, obstacles, what was
explored."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from trajopt.arrays import Array
from trajopt.objectives.terminal import terminal_objective
from trajopt.optimize.base import OptimizeResult
from trajopt.paths.path import Path
from trajopt.report.ground_plan import (
    draw_robot,
    draw_scene,
    draw_space,
    frame_points,
    mark_pose,
    near_points,
    outline,
)
from trajopt.report.route_picture import draw_borders, draw_route
from trajopt.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    WIDTH,
    new_figure,
)
from trajopt.solution import Solution
from trajopt.world.crossing import crossings

_MOMENTS = 6  # robot outlines between start and goal, chosen
_MOST_DOTS = 20_000  # explored candidates that are drawn, chosen
_MOST_NAMED = 8  # control points whose names are drawn, chosen


def path_figure(solution: Solution, path: Path) -> Figure:
    """Figure of the path in the world with what stands there, equal scales, m."""
    problem, robot = solution.problem, solution.problem.robot
    poses = _poses(solution, path)
    goal = poses[-1] if problem.goal is None else np.array(problem.goal.pose)
    seen = np.vstack([outline(robot, pose) for pose in (goal, *poses)])
    if problem.space is not None:
        seen = np.vstack([seen, np.column_stack([problem.space.x, problem.space.y])])
    seen = np.vstack([seen, near_points(problem.scene, seen)])
    span = np.ptp(seen, axis=0) * 1.1
    figure = new_figure(float(np.clip((WIDTH - 0.6) * span[1] / span[0] + 1.5, 3.2, 8.0)))
    axes = figure.add_subplot()
    if problem.space is not None:
        draw_space(axes, problem.space)
    if solution.search is not None:
        _draw_explored(axes, solution, solution.search, seen)
    draw_scene(axes, problem.scene, seen)
    draw_borders(axes, problem.scene)
    if problem.job.name == "route":
        draw_route(axes, solution, poses)
    for pose in poses[np.linspace(0, len(poses) - 1, _MOMENTS + 2).round().astype(int)[1:-1]]:
        draw_robot(axes, robot, pose, zorder=2.2)
    draw_robot(axes, robot, poses[0], GREEN, strong=True, label="start", zorder=2.4)
    draw_robot(axes, robot, goal, VERMILION, strong=True, label="goal", zorder=2.4)
    axes.plot(poses[:, 0], poses[:, 1], color=BLUE, linewidth=2.0, zorder=2.6, label="path")
    _draw_crossings(axes, solution, path)
    if problem.job.name != "route" and len(solution.control_points):
        _draw_control_points(axes, solution)
    frame_points(axes, seen)
    axes.set_title(_title(solution))
    figure.legend(loc="outside lower center", ncols=4)
    return figure


def _draw_crossings(axes: Axes, solution: Solution, path: Path) -> None:
    """Outlines where they come into an obstacle and leave it."""
    robot, label = solution.problem.robot, "outline crosses an obstacle"
    for crossing in crossings(path, robot.footprint, solution.problem.scene.obstacles):
        u = path.locate(np.linspace(crossing.start, crossing.end, 3))
        for x, y, yaw in np.column_stack([path.position(u)[:, :2], path.yaw(u)]):
            corners = outline(robot, np.array([x, y, yaw]))
            axes.add_patch(
                Polygon(corners, fill=False, edgecolor="red", lw=1.2, zorder=2.8, label=label)
            )
            label = ""


def _title(solution: Solution) -> str:
    search = solution.search
    found = "" if search is None else f"{search.optimizer}, cost {solution.cost:.3g}, "
    timed = (
        "no motion keeps the limits"
        if solution.trajectory is None
        else f"{solution.duration:.2f} s"
    )
    return f"{solution.problem.title}: {found}{timed}"


def _poses(solution: Solution, path: Path) -> Array:
    """(N, 3): poses along the path, evenly in time where it is timed, else along the path."""
    if solution.trajectory is not None:
        return solution.trajectory.at(np.linspace(0.0, solution.trajectory.duration, 400)).pose
    u = path.locate(np.linspace(0.0, path.length, 400))
    return np.column_stack([path.position(u)[:, :2], path.yaw(u)])


def _draw_explored(axes: Axes, solution: Solution, search: OptimizeResult, seen: Array) -> None:
    """Explored positions of P1 and P2 as dots, fainter the more there are; the legend counts those in the picture,
    around ``seen`` (N, 2), m."""
    names = terminal_objective(solution.problem).names
    samples = search.history.samples
    samples = samples[:: max(1, len(samples) // _MOST_DOTS)]
    if not len(samples):
        return
    alpha = float(np.clip(8.0 / np.sqrt(len(samples)), 0.06, 0.8))
    for point, colour in (("p1", PURPLE), ("p2", SKY)):
        if f"{point}.x_m" not in names:
            continue
        i = names.index(f"{point}.x_m")
        places = samples[:, i : i + 2]
        places = places[np.all((places >= seen.min(axis=0)) & (places <= seen.max(axis=0)), axis=1)]
        if not len(places):
            continue
        axes.scatter(
            places[:, 0],
            places[:, 1],
            s=9,
            marker="o",
            linewidths=0,
            color=colour,
            alpha=alpha,
            zorder=1.5,
        )
        axes.scatter(
            [],
            [],
            s=16,
            color=colour,
            alpha=0.7,
            linewidths=0,
            label=f"explored {point.upper()} ({len(places)} of {len(search.history.samples)})",
        )


def _draw_control_points(axes: Axes, solution: Solution) -> None:
    points = solution.control_points
    axes.plot(
        points[:, 0], points[:, 1], color=GREY, linewidth=0.8, linestyle=(0, (2, 2)), zorder=2.7
    )
    axes.plot(
        points[:, 0],
        points[:, 1],
        linestyle="none",
        marker="o",
        markersize=5.5,
        color=ORANGE,
        markeredgecolor=BLACK,
        markeredgewidth=0.7,
        zorder=3.0,
        label="control points",
    )
    for i, point in enumerate(points if len(points) <= _MOST_NAMED else ()):
        mark_pose(axes, point, f"P{i}", (0.0, 11.0))
