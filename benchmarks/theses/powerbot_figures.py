"""Figures of the PowerBot page: paths, speed profiles, safe speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from trajopt.control.encounter import safe_speed
from trajopt.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    SKY,
    VERMILION,
    legend_beside,
    limit_colour,
    new_figure,
)
from trajopt.timing.trajectory import Trajectory

_POINTS = 800  # drawn along a path


_RANGES = np.linspace(0.6, 6.0, 60)  # m, sonar settings to modest laser ranges


_DELAYS = (0.1, 0.2, 0.5, 1.0)  # s


def path_speed_figure(trajectory: Trajectory, *, knots: Sequence[Sequence[float]] = ()) -> Figure:
    """Path from above, coloured by planned speed; knots as dots."""
    figure = new_figure(4.6)
    axes = figure.add_subplot()
    state = trajectory.at(np.linspace(0, trajectory.duration, _POINTS))
    xy = state.pose[:, :2]
    lines = LineCollection(
        np.stack([xy[:-1], xy[1:]], axis=1).tolist(), cmap="viridis", linewidths=3
    )
    lines.set_array(state.twist[:-1, 0])
    axes.add_collection(lines)
    if len(knots):
        points = np.asarray(knots, dtype=np.float64)
        axes.plot(points[:, 0], points[:, 1], "o", ms=4, mfc="white", mec=BLACK, label="knots")
        legend_beside(axes)
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x (m)", ylabel="y (m)", title=f"Path and speed, {trajectory.duration:.1f} s")
    figure.colorbar(lines, ax=axes, label="speed (m/s)", shrink=0.8)
    return figure


def speeds_figure(plans: Sequence[tuple[str, Trajectory]]) -> Figure:
    """Speed over the path of several plans; below, which limit binds in the last one."""
    figure = new_figure(4.2)
    speed, binding = figure.subplots(2, 1, sharex=True, height_ratios=[5, 1])
    for (name, plan), colour in zip(plans, (GREY, BLUE, VERMILION, GREEN), strict=False):
        speed.plot(plan.s, plan.sd, color=colour, label=f"{name}, {plan.duration:.1f} s")
    speed.set(ylabel="speed (m/s)", title="Speed over the path")
    legend_beside(speed)
    last = plans[-1][1]
    names = [limit.name for limit in last.limits]
    shown: set[str] = set()
    for part in last.active:
        label = None if part.limit in shown else part.limit
        shown.add(part.limit)
        binding.axvspan(
            part.start,
            part.end,
            color=limit_colour(part.limit, names.index(part.limit)),
            label=label,
            lw=0,
        )
    binding.set(xlabel="path parameter s (m)", yticks=[], title=f"Binding limit, {plans[-1][0]}")
    legend_beside(binding)
    return figure


def safe_speed_figure(*, braking: float, robot_speed: float) -> Figure:
    """Safe speed over sensor range for several delays, ``braking`` in m/s^2; the thesis's rule
    dashed."""
    figure = new_figure(3.6)
    axes = figure.add_subplot()
    for delay, colour in zip(_DELAYS, (BLUE, SKY, GREEN, ORANGE), strict=True):
        axes.plot(
            _RANGES,
            [safe_speed(float(r), delay, braking) for r in _RANGES],
            color=colour,
            label=f"delay {delay:g} s",
        )
    axes.plot(
        _RANGES,
        _RANGES / _DELAYS[-1],
        "--",
        color=VERMILION,
        label="thesis, 1 s: no braking distance",
    )
    axes.axhline(robot_speed, color=GREY, lw=0.8, label="robot's top speed")
    axes.set(
        xlabel="sensor range (m)",
        ylabel="speed (m/s)",
        ylim=(0, 2.2 * robot_speed),
        title=f"Speed from which the robot stops in sight, braking {braking:.2f} m/s²",
    )
    legend_beside(axes)
    return figure
