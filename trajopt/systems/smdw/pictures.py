"""Pictures of the SMDW: what the wheel's outline says about a step (Figures 4.10, 4.18, 6.9), and
plans."""

from __future__ import annotations

import math
from pathlib import Path as FilePath

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from trajopt.arrays import Array
from trajopt.problem import Problem
from trajopt.report.ground_plan import draw_robot
from trajopt.report.style import (
    BLACK,
    BLUE,
    GREY,
    LIGHT,
    ORANGE,
    VERMILION,
    in_style,
    new_figure,
    save_figure,
)
from trajopt.systems.smdw.climbing import (
    STEEPEST_TANGENT,
    THESIS_FORWARD_ALPHA,
    forward_alphas,
)
from trajopt.systems.smdw.configurations import wheel_of
from trajopt.systems.smdw.entry import step_of
from trajopt.systems.smdw.geometry import DoubleWheel, meet_step
from trajopt.systems.smdw.planner import Maneuver, Plan

_OUTLINES = 7  # robot outlines drawn along a path


def geometry_figure(wheel: DoubleWheel, height: float) -> Figure:
    """Clearance and tangent angle over (theta, alpha) with the feasible region, and at theta = 0
    (Figure 4.18)."""
    theta, alpha = np.radians(np.linspace(-90, 90, 361)), np.radians(np.linspace(-90, 0, 361))
    found = meet_step(wheel, theta[None, :], alpha[:, None], height)
    feasible = found.over & (found.clearance >= height) & (found.tangent > -STEEPEST_TANGENT)
    figure = new_figure(6.2)
    axes = figure.subplots(2, 2)
    clearance = np.where(found.over, 100 * found.clearance, np.nan)
    tangent = np.where(found.over, np.degrees(found.tangent), np.nan)
    for ax, values, levels, title, colours in (
        (axes[0, 0], clearance, np.arange(0, 11, 1.0), "Clearance (cm)", "viridis"),
        (
            axes[0, 1],
            tangent,
            np.arange(-60, 1, 10.0),
            "Tangent angle at the contact (deg)",
            "magma",
        ),
    ):
        drawn = ax.contourf(
            np.degrees(theta), np.degrees(alpha), values, levels=levels, cmap=colours, extend="both"
        )
        figure.colorbar(drawn, ax=ax, label=title)
        ax.contour(
            np.degrees(theta),
            np.degrees(alpha),
            feasible.astype(float),
            levels=[0.5],
            colors=[ORANGE],
        )
        ax.axhline(-45, color=LIGHT, linestyle=":")
        ax.set(
            title=title, xlabel="wheel angle theta (deg)", ylabel="yaw to the step's normal (deg)"
        )
        ax.grid(False)
    _neutral_axes(axes[1], wheel, height, alpha)
    window = forward_alphas(wheel, height, theta=0.0)
    text = (
        "none"
        if window is None
        else f"{-math.degrees(window[1]):.0f} to {-math.degrees(window[0]):.0f} deg"
    )
    low, high = (math.degrees(v) for v in THESIS_FORWARD_ALPHA)
    figure.suptitle(
        f"Step of {100 * height:g} cm (Figure 4.18): feasible inside the orange line, white: no hub over "
        f"the step.\nForward alpha at theta = 0: {text} (thesis {low:.0f} to {high:.0f})",
        x=0.02,
        fontsize=9,
        ha="left",
    )
    return figure


def _neutral_axes(axes: Array, wheel: DoubleWheel, height: float, alpha: Array) -> None:
    found = meet_step(wheel, 0.0, alpha, height)
    for ax, values, limit, label in (
        (axes[0], 100 * found.clearance, 100 * height, "clearance (cm)"),
        (
            axes[1],
            np.degrees(found.tangent),
            -math.degrees(STEEPEST_TANGENT),
            "tangent angle (deg)",
        ),
    ):
        ax.plot(np.degrees(alpha), values, color=BLUE)
        ax.axhline(limit, color=VERMILION, linestyle="--")
        low, high = (math.degrees(v) for v in THESIS_FORWARD_ALPHA)
        ax.axvspan(low, high, color=LIGHT, alpha=0.4, label="thesis's range")
        ax.axvline(-45, color=GREY, linestyle=":", label="rollers' limit")
        ax.set(
            title=f"At theta = 0: {label}", xlabel="yaw to the step's normal (deg)", ylabel=label
        )
    axes[1].legend(loc="lower left", fontsize=7)


def plans_figure(maneuver: Maneuver, heading: str = "") -> Figure:
    """Every plan on the ground: path, outlines of the robot, the step and the space."""
    count = max(len(maneuver.plans), 1)
    columns, rows = min(count, 3), math.ceil(count / 3)
    space = maneuver.problem.space
    assert space is not None  # the job needs it
    (x0, x1), (y0, y1) = space.x, space.y
    each = 2.4 * (y1 - y0 + 0.2) / (x1 - x0 + 0.4)  # inch: as high as a panel 2.4 inches wide needs
    figure = new_figure(rows * (each + 0.65) + 0.2, 8.4)
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for k, ax in enumerate(grid.ravel()):
        if k < len(maneuver.plans):
            _draw_plan(ax, maneuver.problem, maneuver.plans[k])
        else:
            ax.set_axis_off()
    for ax in grid[:, 0]:
        ax.set_ylabel("y (m)")
    if heading:
        figure.suptitle(heading, fontsize=9, x=0.02, ha="left")
    return figure


def draw_ground(ax: Axes, problem: Problem) -> None:
    """The step, the place where it shall be met, and the space."""
    step, space = step_of(problem), problem.space
    assert space is not None  # the job needs it
    ax.add_patch(Polygon(step.outline, color=LIGHT))
    (x0, x1), (y0, y1) = space.x, space.y
    ax.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor=GREY, linestyle="--"))
    ax.plot(*step.place, "x", color=BLACK)
    ax.set(aspect="equal", ylabel="y (m)", xlim=(x0 - 0.1, x1 + 0.3), ylim=(y0 - 0.1, y1 + 0.1))


def _draw_plan(ax: Axes, problem: Problem, plan: Plan) -> None:
    draw_ground(ax, problem)
    times = np.linspace(0.0, plan.duration, 200)
    pose = plan.trajectory.at(times).pose
    for k in np.linspace(0, len(times) - 1, _OUTLINES).astype(int):
        draw_robot(ax, problem.robot, pose[k], strong=k in (0, len(times) - 1))
    ax.plot(pose[:, 0], pose[:, 1], color=BLUE)
    ax.plot(
        plan.control_points[:, 0], plan.control_points[:, 1], "o", color=VERMILION, markersize=3
    )
    ax.set(title=f"{plan.configuration.name}: {plan.duration:.2f} s", xlabel="x (m)", ylabel="")


def save_maneuver_pictures(
    maneuver: Maneuver, folder: FilePath, kind: str = "png"
) -> tuple[FilePath, ...]:
    """Write plans.png (every plan) and geometry.png (what the wheel's outline says), or of another ``kind``, into
    ``folder``; their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    plans, geometry = folder / f"plans.{kind}", folder / f"geometry.{kind}"
    with in_style():
        save_figure(plans_figure(maneuver), plans)
        save_figure(
            geometry_figure(wheel_of(maneuver.problem), step_of(maneuver.problem).height),
            geometry,
        )
    return plans, geometry
