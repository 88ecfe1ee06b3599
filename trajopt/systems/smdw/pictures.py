"""Pictures of the SMDW: what the wheel's outline says about a step (Figures 4.10, 4.18, 6.9), and
plans."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon, Rectangle

from trajopt.arrays import Array
from trajopt.problem import Problem
from trajopt.report.ground_plan import draw_robot
from trajopt.report.style import (
    BLACK,
    BLUE,
    GREEN,
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
    Motion,
    climb_window,
    forward_alphas,
)
from trajopt.systems.smdw.entry import start_pose, step_of
from trajopt.systems.smdw.geometry import DoubleWheel, contact_offset, meet_step, outline
from trajopt.systems.smdw.planner import Maneuver, Plan, wheel_of

Pose = tuple[float, float, float]  # m, m, rad

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
        figure.colorbar(drawn, ax=ax)
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


def cam_figure(wheel: DoubleWheel, fitted: DoubleWheel) -> Figure:
    """Contact offset over wheel angle beside the printed values (Figure 4.10), and windows over
    step height."""
    figure = new_figure(3.6)
    left, right = figure.subplots(1, 2)
    theta = np.linspace(0, math.pi / 2, 181)
    for sizes, colour, label in ((wheel, BLUE, "default"), (fitted, GREEN, "fitted to the print")):
        left.plot(
            np.degrees(theta),
            100 * contact_offset(sizes, theta),
            color=colour,
            label=f"{label}: Rc {100 * sizes.radius:.2f}, Re {100 * sizes.minor_radius:.2f} cm",
        )
    left.plot([0, 30, 60, 90], [0, 4.63, 3.49, 0], "o", color=BLACK, label="printed (4.10)")
    left.set(title="Contact offset (Figure 4.10)", xlabel="wheel angle (deg)", ylabel="offset (cm)")
    heights = np.linspace(0.02, wheel.greatest_clearance - 1e-4, 60)
    for motion, alpha, colour, dash, label in (
        (Motion.LEFT, 0.0, VERMILION, "-", "lateral"),
        (Motion.FORWARD, math.radians(-35), BLUE, "--", "forward -35 deg"),
        (Motion.FORWARD, math.radians(-45), GREEN, ":", "forward -45 deg"),
    ):
        windows = [climb_window(wheel, motion, alpha, float(h)) for h in heights]
        for k, ends in enumerate(
            ([w.low if w else np.nan for w in windows], [w.high if w else np.nan for w in windows])
        ):
            right.plot(
                100 * heights, ends, color=colour, linestyle=dash, label=label if k == 0 else None
            )
    right.set(
        title="Least and greatest angle that climbs",
        xlabel="step (cm)",
        ylabel="wheel angle at contact (rad)",
    )
    for ax in (left, right):
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18))
    return figure


def wheel_at_step_figure(wheel: DoubleWheel, alpha: float, theta: float, low_step: float) -> Figure:
    """The wheel at its collision line, seen along the step's edge, and which wheel angles climb
    (Figure 6.9).

    ``alpha`` and ``theta`` (rad) as in ``robots.smdw`` in forward motion; left the step is as high
    as the clearance there, in the middle ``low_step`` (m).
    """
    top = clearance_at(wheel, theta, alpha)
    figure = new_figure(3.9, 9.6)
    axes = figure.subplots(1, 3, gridspec_kw={"width_ratios": [1, 1, 1.1]})
    for ax, height, words in (
        (axes[0], top, "as high as the clearance"),
        (axes[1], low_step, "below the clearance"),
    ):
        tangent = math.degrees(float(meet_step(wheel, theta, -abs(alpha), height).tangent))
        _draw_wheel_at_step(ax, wheel, alpha, theta, height)
        ax.set_title(
            f"Step of {100 * height:.1f} cm, {words}\ntangent at the contact {tangent:.0f} deg",
            fontsize=8.5,
        )
    angles = np.radians(np.linspace(-60, 60, 481))
    for height, colour in ((top, VERMILION), (low_step, BLUE)):
        found = meet_step(wheel, angles, -abs(alpha), height)
        room = np.where(found.over, 100 * (found.clearance - height), np.nan)
        axes[2].plot(np.degrees(angles), room, color=colour, label=f"step of {100 * height:.1f} cm")
        window = climb_window(wheel, Motion.FORWARD, alpha, height)
        if window is not None:
            axes[2].axvspan(
                math.degrees(window.low),
                math.degrees(window.high),
                color=colour,
                alpha=0.15,
                label="lands level enough",
            )
    axes[2].axhline(0.0, color=BLACK, linewidth=0.8)
    axes[2].axvline(math.degrees(theta), color=GREY, linestyle=":")
    axes[2].set(xlabel="wheel angle theta (deg)", ylabel="room above the step (cm)")
    axes[2].set_title(
        f"Figure 6.9: alpha = {math.degrees(alpha):.0f} deg,\ntheta = {math.degrees(theta):.0f} deg "
        "dotted",
        fontsize=8.5,
    )
    for ax in axes:
        ax.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.2))
    return figure


def clearance_at(wheel: DoubleWheel, theta: float, alpha: float) -> float:
    """The highest step (m) that the lifted hub clears in forward motion at wheel angle ``theta``: h
    = clearance(h)."""
    heights = np.linspace(1e-3, wheel.radius - 1e-3, 2000)
    clears = [float(meet_step(wheel, theta, -abs(alpha), float(h)).clearance) >= h for h in heights]
    return float(heights[np.flatnonzero(clears)[-1]]) if any(clears) else 0.0


def _draw_wheel_at_step(
    ax: Axes, wheel: DoubleWheel, alpha: float, theta: float, height: float
) -> None:
    """Both hubs projected on the plane of the step's normal and the vertical; lengths in cm, the
    ground at 0."""
    yaw = -abs(alpha)
    normal = np.array([math.cos(yaw), -math.sin(yaw)])  # in the wheel frame
    found = meet_step(wheel, theta, yaw, height)
    line, x, z = float(found.line), *outline(wheel, 721)
    for facing, colour, name in ((False, GREY, "other hub"), (True, BLUE, "hub facing the step")):
        turn = theta if facing else theta + math.pi
        along, up = (
            math.cos(turn) * x + math.sin(turn) * z,
            -math.sin(turn) * x + math.cos(turn) * z,
        )
        for k, y in enumerate((wheel.gap / 2, wheel.gap / 2 + wheel.depth)):
            across = normal[0] * along + normal[1] * (y if facing else -y)
            ax.fill(
                100 * across,
                100 * (up + wheel.radius),
                facecolor=colour,
                alpha=0.25,
                edgecolor=colour,
                label=name if k == 0 else None,
            )
    ax.fill_between(
        [100 * line, 100 * (line + wheel.radius)], 0, 100 * height, color=LIGHT, zorder=0.5
    )
    ax.axhline(0.0, color=BLACK, linewidth=0.8)
    if bool(found.over):
        far = wheel.gap / 2 + wheel.depth if math.cos(theta) >= 0 else -wheel.gap / 2
        ax.plot(
            100 * (normal[0] * float(found.offset) + normal[1] * far),
            100 * float(found.clearance),
            "o",
            color=VERMILION,
            markersize=4,
            label="lowest above the step",
            zorder=4,
        )
    ax.set(
        aspect="equal",
        xlabel="along the step's normal (cm)",
        ylabel="height (cm)",
        xlim=(-12, 18),
        ylim=(-1, 21),
    )
    ax.grid(visible=False)


def setups_figure(setups: Sequence[tuple[str, Problem, Mapping[str, Pose]]]) -> Figure:
    """Start, space and step of manoeuvre problems, with named printed targets (m, m, rad; Figures
    6.3 and 6.10)."""
    figure = new_figure(3.7, 8.4)
    colours = (VERMILION, BLUE, GREEN)
    for ax, (title, problem, targets) in zip(
        figure.subplots(1, len(setups), squeeze=False)[0], setups, strict=True
    ):
        _draw_ground(ax, problem)
        draw_robot(ax, problem.robot, np.array(start_pose(problem)), strong=True)
        for target, colour in zip(targets.values(), colours, strict=False):
            draw_robot(ax, problem.robot, np.array(target), colour=colour)
        ax.set(
            title=title,
            xlabel=f"x (m)\nstep of {100 * step_of(problem).height:g} cm at x = "
            f"{step_of(problem).place[0]:g} m",
        )
    names = setups[0][2]
    handles = [
        Line2D([], [], color=GREY, linewidth=2, label="start"),
        *(
            Line2D([], [], color=c, label=f"target: {n}")
            for n, c in zip(names, colours, strict=False)
        ),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


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


def _draw_ground(ax: Axes, problem: Problem) -> None:
    """The step, the place where it shall be met, and the space."""
    step, space = step_of(problem), problem.space
    assert space is not None  # the job needs it
    ax.add_patch(Polygon(step.outline, color=LIGHT))
    (x0, x1), (y0, y1) = space.x, space.y
    ax.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor=GREY, linestyle="--"))
    ax.plot(*step.place, "x", color=BLACK)
    ax.set(aspect="equal", ylabel="y (m)", xlim=(x0 - 0.1, x1 + 0.3), ylim=(y0 - 0.1, y1 + 0.1))


def _draw_plan(ax: Axes, problem: Problem, plan: Plan) -> None:
    _draw_ground(ax, problem)
    times = np.linspace(0.0, plan.duration, 200)
    pose = plan.trajectory.at(times).pose
    for k in np.linspace(0, len(times) - 1, _OUTLINES).astype(int):
        draw_robot(ax, problem.robot, pose[k], strong=k in (0, len(times) - 1))
    ax.plot(pose[:, 0], pose[:, 1], color=BLUE)
    ax.plot(
        plan.control_points[:, 0], plan.control_points[:, 1], "o", color=VERMILION, markersize=3
    )
    ax.set(title=f"{plan.configuration.name}: {plan.duration:.2f} s", xlabel="x (m)", ylabel="")


def save_maneuver_pictures(maneuver: Maneuver, folder: FilePath) -> tuple[FilePath, ...]:
    """Write plans.png (every plan) and geometry.png (what the wheel's outline says) into
    ``folder``; their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    plans, geometry = folder / "plans.png", folder / "geometry.png"
    with in_style():
        save_figure(plans_figure(maneuver), plans)
        save_figure(
            geometry_figure(wheel_of(maneuver.problem), step_of(maneuver.problem).height),
            geometry,
        )
    return plans, geometry
