"""Results as pictures and as facts beside them, for notebooks."""

from __future__ import annotations

import base64
import io
from functools import singledispatch
from html import escape
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from trajopt.errors import ArgumentError
from trajopt.optimize.base import FEASIBLE, OptimizeResult
from trajopt.problem import Problem
from trajopt.report.convergence_picture import log_where_wide, say_one_shot
from trajopt.report.ground_plan import draw_robot, draw_scene, draw_space, frame_points, outline
from trajopt.report.path_picture import path_figure
from trajopt.report.robot_picture import robot_figure
from trajopt.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    VERMILION,
    in_style,
    new_figure,
    plain_powers,
)
from trajopt.robots.mobility import mobility_of
from trajopt.robots.robot import Robot
from trajopt.simulate.check import ValidationReport
from trajopt.solution import Solution
from trajopt.timing.trajectory import Trajectory

_SAMPLES = 400  # of a motion that is drawn, chosen
_DOTS = 90  # an inch, in a notebook; chosen


def figure_of(thing: Any) -> Figure:
    """The picture of a result, in the style of all pictures. Raises ArgumentError for what has none."""
    with in_style():
        return plain_powers(_figure(thing))


def html(thing: Any) -> str:
    """Facts of a result as a table, and its picture."""
    rows = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th><td style='text-align:left'>{escape(text)}</td></tr>"
        for name, text in _facts(thing).items()
    )
    return f"<table>{rows}</table>{_image(thing)}"


def _image(thing: Any) -> str:
    buffer = io.BytesIO()
    try:
        figure_of(thing).savefig(buffer, format="png", dpi=_DOTS)
    except ArgumentError:
        return ""  # there is nothing to draw, and the facts say so
    return f"<img src='data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}'>"


@singledispatch
def _figure(thing: Any) -> Figure:
    raise ArgumentError("thing", type(thing).__name__, "a result that has a picture")


@singledispatch
def _facts(thing: Any) -> dict[str, str]:
    raise ArgumentError("thing", type(thing).__name__, "a result of this package")


@_figure.register
def _(solution: Solution) -> Figure:
    if solution.path is None:
        raise ArgumentError("solution", solution.status, "a solution with a path")
    return path_figure(solution, solution.path)


@_facts.register
def _(solution: Solution) -> dict[str, str]:
    margins = {f"margin {name}": f"{margin:z.1%}" for name, margin in solution.margins.items()}
    return {
        "problem": solution.problem.title,
        "holds": "yes" if solution.holds else "no",
        "cost": f"{solution.cost:.4g}",
        "duration": f"{solution.duration:.4f} s",
        **margins,
        "status": solution.status,
    }


@_figure.register
def _(trajectory: Trajectory) -> Figure:
    times = np.linspace(0.0, trajectory.duration, _SAMPLES)
    state, figure = trajectory.at(times), new_figure(3.2)
    plan, speed = figure.subplots(1, 2)
    plan.plot(state.pose[:, 0], state.pose[:, 1], color=BLUE)
    seen = state.pose[:, :2]
    if trajectory.robot is not None:
        for pose in (state.pose[0], state.pose[-1]):
            draw_robot(plan, trajectory.robot, pose, GREY)
            seen = np.vstack([seen, outline(trajectory.robot, pose)])
    frame_points(plan, seen)
    speed.plot(
        times, np.hypot(state.twist[:, 0], state.twist[:, 1]), color=BLUE, label="speed (m/s)"
    )
    speed.plot(times, state.twist[:, 2], color=VERMILION, label="yaw rate (rad/s)")
    speed.set_xlabel("time (s)")
    speed.set_ylabel("speed (m/s), yaw rate (rad/s)")
    speed.legend()
    return figure


@_facts.register
def _(trajectory: Trajectory) -> dict[str, str]:
    return {
        "robot": "none" if trajectory.robot is None else trajectory.robot.name,
        "duration": f"{trajectory.duration:.4f} s",
        "length": f"{trajectory.path.length:.4f} m",
        "timing": trajectory.engine,
        **{f"margin {name}": f"{margin:z.1%}" for name, margin in trajectory.margins().items()},
    }


@_figure.register
def _(search: OptimizeResult) -> Figure:
    history, figure = search.history, new_figure(2.6)
    axes, good = figure.add_subplot(), history.violation <= FEASIBLE
    if not good.any():
        raise ArgumentError("search", search.message, "a search that met a feasible candidate")
    axes.step(
        [*history.evaluations[good], search.nfev], [*history.cost[good], history.cost[good][-1]],
        where="post", color=BLUE, marker="o", ms=3,
    )  # fmt: skip
    log_where_wide(axes, history.cost[good])
    say_one_shot(axes, search)
    axes.set_xlabel("evaluations of the objective (–)")
    axes.set_ylabel("best cost so far (–)")
    axes.set_title(f"{search.optimizer}: {search.nfev} evaluations")
    return figure


@_facts.register
def _(search: OptimizeResult) -> dict[str, str]:
    shown = np.array2string(search.x, precision=6, threshold=12)
    return {
        "success": "yes" if search.success else "no",
        "fun": f"{search.fun:.6g}",
        "violation": f"{search.violation:.3g}",
        "x": shown,
        "optimizer": search.optimizer,
        "evaluations": f"{search.nfev}, {search.nit} iterations, {search.seconds:.3g} s",
        "message": search.message,
    }


@_figure.register
def _(problem: Problem) -> Figure:
    poses = [
        (place, name)
        for place, name in ((problem.start, "start"), (problem.goal, "goal"))
        if place is not None
    ]
    path = problem.flat_path if problem.job.name == "path" else None
    figure = new_figure(4.2)
    axes, seen = figure.add_subplot(), np.zeros((0, 2))
    if path is not None:
        line = path.position(np.linspace(path.start, path.end, _SAMPLES))[:, :2]
        axes.plot(line[:, 0], line[:, 1], color=BLUE, label="path")
        seen = np.vstack([seen, line])
    for (place, name), colour in zip(poses, (GREEN, BLACK), strict=False):
        draw_robot(axes, problem.robot, np.array(place.pose), colour, strong=True, label=name)
        seen = np.vstack([seen, outline(problem.robot, np.array(place.pose))])
    if not len(seen):
        raise ArgumentError("problem", problem.title, "a problem with a path, a start or a goal")
    if problem.space is not None:
        draw_space(axes, problem.space)
    draw_scene(axes, problem.scene, seen)
    frame_points(axes, seen, margin=0.25)
    axes.set_title(problem.title)
    axes.legend()
    return figure


@_facts.register
def _(problem: Problem) -> dict[str, str]:
    return {
        "problem": problem.title,
        "job": f"{problem.job.name}: {problem.job.about}",
        "robot": problem.robot.name,
        "limits": ", ".join(limit.name for limit in problem.limits),
        "obstacles": ", ".join(thing.name for thing in problem.scene.obstacles) or "none",
        "friction": f"{problem.scene.friction:g}",
    }


@_figure.register
def _(robot: Robot) -> Figure:
    return robot_figure(robot)


@_facts.register
def _(robot: Robot) -> dict[str, str]:
    degrees = mobility_of(robot)
    return {
        "robot": f"{robot.name}: {robot.description.about or 'no description'}",
        "mass": f"{robot.body.mass:g} kg",
        "wheels": ", ".join(f"{wheel.name} ({wheel.kind})" for wheel in robot.description.wheels),
        "driven": ", ".join(robot.driven) or "none",
        "mobility, steerability": f"{degrees.mobility}, {degrees.steerability}",
    }


@_figure.register
def _(report: ValidationReport) -> Figure:
    times, pose, figure = report.recording.times, report.recording.pose, new_figure(3.2)
    plan, error = figure.subplots(1, 2)
    plan.plot(
        report.planned[:, 0], report.planned[:, 1], color=GREY, linewidth=2.6, label="planned"
    )
    plan.plot(pose[:, 0], pose[:, 1], color=VERMILION, label="simulated")
    frame_points(plan, np.vstack([pose[:, :2], report.planned[:, :2]]))
    plan.legend()
    off = 1e3 * np.hypot(*(pose - report.planned)[:, :2].T)
    error.plot(times, off, color=VERMILION)
    error.set_xlabel("time (s)")
    error.set_ylabel("distance from the plan (mm)")
    return figure


@_facts.register
def _(report: ValidationReport) -> dict[str, str]:
    touched = ", ".join(f"{hit.name} at {hit.time:.2f} s" for hit in report.contacts)
    return {
        "engine": f"{report.engine} {report.recording.version}",
        "control": report.control or "planned wheel speeds",
        "final error": f"{1e3 * report.along:+.2f} mm along, {1e3 * report.across:+.2f} mm across, "
        f"{1e3 * report.yaw:+.2f} mrad",
        "off the path": f"rms {1e3 * report.path_rms:.2f} mm, most {1e3 * report.path_max:.2f} mm",
        "most slip": f"{report.slip.max():.3g} m/s",
        "touched": touched or "nothing",
    }
