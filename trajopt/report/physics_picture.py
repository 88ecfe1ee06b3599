"""Planned against simulated motion: path, pose error and wheel angle error over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trajopt.errors import ArgumentError
from trajopt.report.ground_plan import draw_robot, draw_scene, frame_points, outline
from trajopt.report.motion import turning_wheels
from trajopt.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LIGHT,
    LINE_COLOURS,
    MOST_LINES,
    VERMILION,
    WHEEL_COLOURS,
    WHEEL_DASHES,
    first_in_front,
    legend_beside,
    new_figure,
    telling,
)
from trajopt.solution import Solution

_SMOOTH = 0.3  # s, over which loads are averaged for the eye; chosen

if TYPE_CHECKING:
    from trajopt.simulate.check import ValidationReport


def physics_figure(solution: Solution, report: ValidationReport) -> Figure:
    """Path above (m); position (mm), yaw (mrad) and wheel angle errors (mrad), simulated minus
    planned, below, then loads of wheels (N) and steering errors (mrad) of those that turn.

    Raises ArgumentError for a solution without a trajectory.
    """
    trajectory, recording = solution.trajectory, report.recording
    if trajectory is None:
        raise ArgumentError("solution", solution.status, "a solution with a trajectory")
    times, end = recording.times, trajectory.duration
    error = 1e3 * (recording.pose - report.planned)
    planned_wheels = trajectory.at(np.minimum(times, end)).wheel_angles
    turns = turning_wheels(solution.problem.robot)
    heights = [3.4, 1.2, 1.0, 1.3, 1.3] + [1.0] * bool(turns)
    figure = new_figure(1.3 * sum(heights))
    panels: list[Axes] = list(
        figure.subplots(len(heights), 1, gridspec_kw={"height_ratios": heights})
    )
    _draw_paths(panels[0], solution, report)
    panels[1].plot(times, error[:, 0], color=BLUE, label="x")
    panels[1].plot(times, error[:, 1], color=VERMILION, label="y")
    panels[1].plot(times, np.hypot(error[:, 0], error[:, 1]), color=BLACK, label="distance")
    panels[1].set_ylabel("position error (mm)")
    panels[2].plot(times, error[:, 2], color=BLACK)
    panels[2].set_ylabel("yaw error (mrad)")
    off, names = 1e3 * (recording.wheel_angles - planned_wheels), solution.problem.robot.wheel_names
    for i in telling(off):
        panels[3].plot(
            times,
            off[:, i],
            linewidth=1.1,
            color=WHEEL_COLOURS[i % 8],
            linestyle=WHEEL_DASHES[i % 8],
            label=names[i],
        )
    panels[3].set_ylabel("wheel error (mrad)")
    _draw_loads(panels[4], report)
    for k, name in enumerate(turns[:MOST_LINES]):
        i = report.wheels.index(name)
        error_of = 1e3 * (report.steering[:, i] - report.wheel_plan.steering[:, i])
        look: dict[str, Any] = {"color": WHEEL_COLOURS[k % 8], "linestyle": WHEEL_DASHES[k % 8]}
        panels[5].plot(times, error_of, **look, linewidth=1.1, label=name)
        panels[5].set_ylabel("steering error (mrad)")
    panels[-1].set_xlabel("time (s)")
    for axes in panels[1:]:
        axes.set_xlim(times[0], times[-1])
        axes.axhline(0.0, color=LIGHT, linewidth=0.8, zorder=0.8)
        if times[-1] > end + 1e-9:
            axes.axvline(
                end,
                color=GREY,
                linestyle="--",
                linewidth=0.9,
                label="end of the plan" if axes is panels[1] else None,
            )
        legend_beside(axes)
    for axes in panels[1:-1]:
        axes.tick_params(labelbottom=False)
    figure.align_ylabels(panels[1:])
    return figure


def _draw_loads(axes: Axes, report: ValidationReport) -> None:
    """Loads as measured, smoothed, and dashed as planned, of the wheels whose loads are furthest from the plan."""
    times, loads, plan = report.recording.times, report.recording.loads, report.wheel_plan.loads
    count = max(1, round(_SMOOTH * (len(times) - 1) / float(np.ptp(times))))
    kernel = np.ones(count) / count
    weight = np.convolve(np.ones(len(times)), kernel, "same")
    smoothed = np.column_stack([np.convolve(column, kernel, "same") / weight for column in loads.T])
    for i in telling(smoothed - plan, MOST_LINES // 2):
        colour = LINE_COLOURS[i % MOST_LINES]
        axes.plot(times, smoothed[:, i], color=colour, linewidth=1.0, label=report.wheels[i])
        axes.plot(times, plan[:, i], color=colour, linewidth=1.0, linestyle="--")
    axes.set_ylabel("load (N)\ndashed: planned")
    first_in_front(axes)


def _draw_paths(axes: Axes, solution: Solution, report: ValidationReport) -> None:
    robot, pose = solution.problem.robot, report.recording.pose
    planned, final = report.planned[-1], pose[-1]
    ends = (outline(robot, p) for p in (report.planned[0], planned, final))
    seen = np.vstack([pose[:, :2], *ends])
    draw_scene(axes, solution.problem.scene, seen)
    draw_robot(axes, robot, report.planned[0], GREEN, strong=True, label="start")
    draw_robot(axes, robot, planned, GREY, strong=True, label="end, planned")
    draw_robot(axes, robot, final, VERMILION, strong=True, label="end, simulated")
    axes.plot(
        report.planned[:, 0], report.planned[:, 1], color=GREY, linewidth=2.6, label="path, planned"
    )
    axes.plot(pose[:, 0], pose[:, 1], color=VERMILION, linewidth=1.3, label="path, simulated")
    frame_points(axes, seen)
    axes.set_title(
        f"{solution.problem.title}: simulated in {report.engine}\nfinal position off by "
        f"{1e3 * report.final_distance:.1f} mm, yaw by {1e3 * report.yaw:.1f} mrad"
    )
    legend_beside(axes)
