"""Figures of the SMDW page: outline of the wheel, wheel at a step, set-ups (Figures 4.10, 4.3,
6.9)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from benchmarks.theses.smdw_study import outline
from trajopt.problem import Problem
from trajopt.report.ground_plan import draw_robot
from trajopt.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LIGHT,
    VERMILION,
    new_figure,
)
from trajopt.systems.smdw.climbing import (
    Motion,
    climb_window,
)
from trajopt.systems.smdw.entry import start_pose, step_of
from trajopt.systems.smdw.geometry import DoubleWheel, contact_offset, meet_step
from trajopt.systems.smdw.pictures import draw_ground


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


def setups_figure(
    setups: Sequence[tuple[str, Problem, Mapping[str, tuple[float, float, float]]]],
) -> Figure:
    """Start, space and step of manoeuvre problems, with named printed targets (m, m, rad; Figures
    6.3 and 6.10)."""
    figure = new_figure(3.7, 8.4)
    colours = (VERMILION, BLUE, GREEN)
    for ax, (title, problem, targets) in zip(
        figure.subplots(1, len(setups), squeeze=False)[0], setups, strict=True
    ):
        draw_ground(ax, problem)
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
