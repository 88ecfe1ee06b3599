"""Pictures of the SMDW: what the wheel's outline says about a step (Figure 4.18), and manoeuvre plans."""

from __future__ import annotations

import math
from pathlib import Path as FilePath

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from trajopt.maneuver import Maneuver, Plan
from trajopt.report.ground_plan import draw_robot
from trajopt.report.style import BLACK, BLUE, GREEN, GREY, LIGHT, ORANGE, VERMILION, in_style, new_figure, save_figure
from trajopt.robots.smdw import (
    STEEPEST_TANGENT,
    THESIS_FORWARD_ALPHA,
    Motion,
    climb_window,
    forward_alphas,
    region_of_contact,
)
from trajopt.robots.smdw_geometry import DoubleWheel, meet_step

Array = NDArray[np.float64]

_OUTLINES = 7  # robot outlines drawn along a path


def geometry_figure(wheel: DoubleWheel, height: float) -> Figure:
    """Clearance and tangent angle over (theta, alpha) with the feasible region, and at theta = 0 (Figure 4.18)."""
    theta, alpha = np.radians(np.linspace(-90, 90, 361)), np.radians(np.linspace(-90, 0, 361))
    found = meet_step(wheel, theta[None, :], alpha[:, None], height)
    feasible = found.over & (found.clearance >= height) & (found.tangent > -STEEPEST_TANGENT)
    figure = new_figure(6.2)
    axes = figure.subplots(2, 2)
    clearance = np.where(found.over, 100 * found.clearance, np.nan)
    tangent = np.where(found.over, np.degrees(found.tangent), np.nan)
    for ax, values, levels, title, colours in (
            (axes[0, 0], clearance, np.arange(0, 11, 1.0), "Clearance (cm)", "viridis"),
            (axes[0, 1], tangent, np.arange(-60, 1, 10.0), "Tangent angle at the contact (deg)", "magma")):
        drawn = ax.contourf(np.degrees(theta), np.degrees(alpha), values, levels=levels, cmap=colours, extend="both")
        figure.colorbar(drawn, ax=ax)
        ax.contour(np.degrees(theta), np.degrees(alpha), feasible.astype(float), levels=[0.5], colors=[ORANGE])
        ax.axhline(-45, color=LIGHT, linestyle=":")
        ax.set(title=title, xlabel="wheel angle theta (deg)", ylabel="yaw to the step's normal (deg)")
        ax.grid(False)
    _neutral_axes(axes[1], wheel, height, alpha)
    window = forward_alphas(wheel, height, theta=0.0)
    text = "none" if window is None else f"{-math.degrees(window[1]):.0f} to {-math.degrees(window[0]):.0f} deg"
    low, high = (math.degrees(v) for v in THESIS_FORWARD_ALPHA)
    figure.suptitle(f"Step of {100 * height:g} cm: feasible inside the orange line; forward alpha at theta = 0: {text} "
                    f"(thesis {low:.0f} to {high:.0f})", fontsize=9, x=0.02, ha="left")
    return figure


def _neutral_axes(axes: Array, wheel: DoubleWheel, height: float, alpha: Array) -> None:
    found = meet_step(wheel, 0.0, alpha, height)
    for ax, values, limit, label in ((axes[0], 100 * found.clearance, 100 * height, "clearance (cm)"),
                                     (axes[1], np.degrees(found.tangent), -math.degrees(STEEPEST_TANGENT),
                                      "tangent angle (deg)")):
        ax.plot(np.degrees(alpha), values, color=BLUE)
        ax.axhline(limit, color=VERMILION, linestyle="--")
        low, high = (math.degrees(v) for v in THESIS_FORWARD_ALPHA)
        ax.axvspan(low, high, color=LIGHT, alpha=0.4, label="thesis's range")
        ax.axvline(-45, color=GREY, linestyle=":", label="rollers' limit")
        ax.set(title=f"At theta = 0: {label}", xlabel="yaw to the step's normal (deg)", ylabel=label)
        ax.legend(loc="best", frameon=False)


def cam_figure(wheel: DoubleWheel, fitted: DoubleWheel) -> Figure:
    """Contact offset over wheel angle beside the printed values (Figure 4.10), and windows over step height."""
    from trajopt.robots.smdw_geometry import contact_offset

    figure = new_figure(3.2)
    left, right = figure.subplots(1, 2)
    theta = np.linspace(0, math.pi / 2, 181)
    for sizes, colour, label in ((wheel, BLUE, "default"), (fitted, GREEN, "fitted to the print")):
        left.plot(np.degrees(theta), 100 * contact_offset(sizes, theta), color=colour,
                  label=f"{label}: Rc {100 * sizes.radius:.2f}, Re {100 * sizes.minor_radius:.2f} cm")
    left.plot([0, 30, 60, 90], [0, 4.63, 3.49, 0], "o", color=BLACK, label="printed")
    low, high = region_of_contact(wheel)
    left.set(title="Contact offset", xlabel="wheel angle (deg)", ylabel=f"offset (cm), region {100 * low:.0f} to "
                                                                        f"{100 * high:.1f}")
    left.legend(frameon=False, loc="lower center")
    heights = np.linspace(0.02, wheel.greatest_clearance - 1e-4, 60)
    for motion, alpha, colour, label in ((Motion.LEFT, 0.0, VERMILION, "lateral"),
                                         (Motion.FORWARD, math.radians(-35), BLUE, "forward -35 deg"),
                                         (Motion.FORWARD, math.radians(-45), GREEN, "forward -45 deg")):
        windows = [climb_window(wheel, motion, alpha, float(h)) for h in heights]
        lows = [w.low if w else np.nan for w in windows]
        highs = [w.high if w else np.nan for w in windows]
        right.fill_between(100 * heights, lows, highs, color=colour, alpha=0.3, label=label)
    right.set(title="Wheel angles that climb", xlabel="step (cm)", ylabel="angle at contact (rad)")
    right.legend(frameon=False)
    return figure


def plans_figure(maneuver: Maneuver) -> Figure:
    """Every plan on the ground: path, outlines of the robot, the step and the space."""
    count = max(len(maneuver.plans), 1)
    rows = math.ceil(count / 3)
    figure = new_figure(2.6 * rows + 0.3, 8.4)
    for k, ax in enumerate(np.atleast_1d(figure.subplots(rows, min(count, 3), squeeze=False)).ravel()):
        if k < len(maneuver.plans):
            _draw_plan(ax, maneuver, maneuver.plans[k])
        else:
            ax.set_axis_off()
    return figure


def _draw_plan(ax: object, maneuver: Maneuver, plan: Plan) -> None:
    from matplotlib.axes import Axes
    from matplotlib.patches import Polygon, Rectangle

    assert isinstance(ax, Axes)
    problem = maneuver.problem
    nx, ny = problem.obstacle.normal
    edge = np.array(problem.obstacle.place)
    along, depth = 6.0 * np.array([-ny, nx]), 0.25 * np.array([nx, ny])
    ax.add_patch(Polygon([edge - along, edge + along, edge + along + depth, edge - along + depth], color=LIGHT))
    (x0, x1), (y0, y1) = problem.space.x, problem.space.y
    ax.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor=GREY, linestyle="--"))
    times = np.linspace(0.0, plan.duration, 200)
    pose = plan.trajectory.at(times).pose
    for k in np.linspace(0, len(times) - 1, _OUTLINES).astype(int):
        draw_robot(ax, problem.platform, pose[k], strong=k in (0, len(times) - 1))
    ax.plot(pose[:, 0], pose[:, 1], color=BLUE)
    ax.plot(plan.control_points[:, 0], plan.control_points[:, 1], "o", color=VERMILION, markersize=3)
    ax.plot(*edge, "x", color=BLACK)
    ax.set(title=f"{plan.configuration.name}: {plan.duration:.2f} s", xlabel="x (m)", ylabel="y (m)", aspect="equal",
           xlim=(x0 - 0.1, x1 + 0.3), ylim=(y0 - 0.1, y1 + 0.1))


def save_maneuver_pictures(maneuver: Maneuver, folder: FilePath) -> tuple[FilePath, ...]:
    """Write plans.png (every plan) and geometry.png (what the wheel's outline says) into ``folder``; their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    plans, geometry = folder / "plans.png", folder / "geometry.png"
    with in_style():
        save_figure(plans_figure(maneuver), plans)
        save_figure(geometry_figure(maneuver.problem.robot.wheel, maneuver.problem.obstacle.height), geometry)
    return plans, geometry
