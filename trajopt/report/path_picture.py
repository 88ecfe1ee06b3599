"""The planned path: control points, robot outlines along it, navigation space, obstacle, what was
explored."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trajopt.arrays import Array
from trajopt.pipeline import Solution
from trajopt.report.ground_plan import (
    draw_obstacle,
    draw_robot,
    draw_space,
    frame_points,
    mark_pose,
    obstacle_strip,
    outline,
)
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
from trajopt.robots.robot import robot as shipped

_MOMENTS = 6  # robot outlines between start and goal, chosen
_MOST_DOTS = 20_000  # explored candidates that are drawn, chosen


def path_figure(solution: Solution) -> Figure:
    """Figure of the path in the world, equal scales, m."""
    problem, robot = solution.problem, shipped(solution.problem.robot.name)
    start, goal = np.asarray(problem.start.pose), np.asarray(problem.goal.pose)
    poses = _poses(solution)
    ends = [outline(robot, pose) for pose in (start, goal, *poses)]
    corners = np.column_stack([problem.space.x, problem.space.y])
    strip = obstacle_strip(problem, robot, 1.2)
    seen = np.vstack([*ends, corners, poses[:, :2], *([] if strip is None else [strip[0]])])
    span = np.ptp(seen, axis=0) * 1.1
    figure = new_figure(float(np.clip((WIDTH - 0.6) * span[1] / span[0] + 1.5, 3.2, 8.0)))
    axes = figure.add_subplot()
    draw_space(axes, problem)
    _draw_explored(axes, solution)
    draw_obstacle(axes, problem, robot)
    for pose in poses[np.linspace(0, len(poses) - 1, _MOMENTS + 2).round().astype(int)[1:-1]]:
        draw_robot(axes, robot, pose, zorder=2.2)
    draw_robot(axes, robot, start, GREEN, strong=True, label="start", zorder=2.4)
    draw_robot(axes, robot, goal, VERMILION, strong=True, label="goal", zorder=2.4)
    axes.plot(poses[:, 0], poses[:, 1], color=BLUE, linewidth=2.0, zorder=2.6, label="path")
    _draw_control_points(axes, solution)
    frame_points(axes, seen)
    axes.set_title(_title(solution))
    figure.legend(loc="outside lower center", ncols=4)
    return figure


def _title(solution: Solution) -> str:
    found = f"{solution.search.optimizer}, cost {solution.cost:.3g}"
    timed = (
        "no motion keeps the limits"
        if solution.trajectory is None
        else f"{solution.duration:.2f} s"
    )
    return f"{solution.problem.title}: {found}, {timed}"


def _poses(solution: Solution) -> Array:
    """(N, 3): poses along the path, evenly in time where it is timed, else along the path."""
    if solution.trajectory is not None:
        return solution.trajectory.at(np.linspace(0.0, solution.trajectory.duration, 400)).pose
    path = solution.path
    u = path.locate(np.linspace(0.0, path.length, 400))
    return np.column_stack([path.position(u)[:, :2], path.yaw(u)])


def _draw_explored(axes: Axes, solution: Solution) -> None:
    """Explored positions of P1 and P2 as dots, fainter the more there are."""
    names = _decision_names(solution)
    samples = solution.search.history.samples
    samples = samples[:: max(1, len(samples) // _MOST_DOTS)]
    if not len(samples):
        return
    alpha = float(np.clip(8.0 / np.sqrt(len(samples)), 0.06, 0.8))
    for point, colour in (("p1", PURPLE), ("p2", SKY)):
        if f"{point}.x_m" not in names:
            continue
        i = names.index(f"{point}.x_m")
        axes.scatter(
            samples[:, i],
            samples[:, i + 1],
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
            label=f"explored {point.upper()} ({len(solution.search.history.samples)})",
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
    for i, point in enumerate(points):
        mark_pose(axes, point, f"P{i}", (0.0, 11.0))


def _decision_names(solution: Solution) -> tuple[str, ...]:
    from trajopt.objectives.duration import DurationObjective

    objective = solution.objective
    return (objective.terminal if isinstance(objective, DurationObjective) else objective).names
