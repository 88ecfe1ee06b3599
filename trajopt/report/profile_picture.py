"""The motion over time: pose, speeds and wheel speeds against their limits, and which limit binds
when."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from trajopt.arrays import Array
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.report.motion import binding_shares, limit_use, posture
from trajopt.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LIGHT,
    MOST_LINES,
    VERMILION,
    WHEEL_COLOURS,
    WHEEL_DASHES,
    legend_beside,
    limit_colour,
    new_figure,
    telling,
)
from trajopt.robots.steering import steering_of
from trajopt.solution import MARGIN, Solution
from trajopt.timing.states import State
from trajopt.timing.trajectory import Trajectory

_SAMPLES = 1200  # times at which curves are drawn, chosen: more than pixels across
_BAND = 0.16  # opacity of the bands that mark the limit which binds, chosen
_HEADROOM = 1.12  # axes end this far beyond the limit lines, chosen


def profile_figure(solution: Solution, trajectory: Trajectory) -> Figure:
    """Stacked panels over time (s): position, yaw, speed, wheel speeds, tilt where the ground is not
    level, angles and rates of wheels that turn, and the share of each limit in use."""
    times = np.linspace(0.0, trajectory.duration, _SAMPLES)
    state = trajectory.at(times)
    limits = solution.problem.limits_section
    turning_wheels, sloping = _turning_wheels(trajectory), not trajectory.ground.level
    heights = [1, 0.8, 1.1, 0.8, 1.4, 1.2]
    more = [0.8] * sloping + [1.0, 1.0] * bool(turning_wheels)
    figure = new_figure(9.2 + 1.4 * sum(more))
    panels: Sequence[Axes] = figure.subplots(
        6 + len(more), 1, sharex=True, gridspec_kw={"height_ratios": [*heights[:5], *more, 1.2]}
    )
    position, yaw, speed, turning, wheels = panels[:5]
    use = panels[-1]
    _lines(position, times, state.pose[:, :2], ("x", "y"), (BLUE, VERMILION), "position (m)")
    _lines(yaw, times, state.pose[:, 2:], ("yaw",), (BLACK,), "yaw (rad)")
    _lines(speed, times, state.twist[:, :2], ("forward", "left"), (BLUE, VERMILION), "speed (m/s)")
    speed.plot(times, np.hypot(state.twist[:, 0], state.twist[:, 1]), color=BLACK, label="total")
    _limit_lines(speed, limits.speed, "limit", both=bool(np.min(state.twist[:, :2]) < -1e-6))
    _lines(turning, times, state.twist[:, 2:], ("yaw rate",), (BLACK,), "yaw rate (rad/s)")
    _limit_lines(turning, limits.yaw_rate, "limit", both=True)
    _draw_wheels(wheels, times, state.wheel_speeds, solution)
    if sloping:
        tilt = np.degrees(np.column_stack(posture(state.rotation)))
        names = ("roll, left side up", "pitch, nose down")
        _lines(panels[5], times, tilt, names, (VERMILION, BLUE), "tilt (deg)")
    if turning_wheels:
        _draw_steering(panels[-3:-1], times, state, turning_wheels)
    _draw_use(use, trajectory)
    for axes in panels:
        _bands(axes, trajectory)
        legend_beside(axes)
    figure.align_ylabels(list(panels))
    panels[-1].set_xlabel("time (s)")
    panels[-1].set_xlim(0.0, trajectory.duration)
    panels[0].set_title(
        f"{solution.problem.title}: {trajectory.duration:.2f} s, timing: {trajectory.engine}"
    )
    _band_legend(figure, trajectory)
    return figure


def _turning_wheels(trajectory: Trajectory) -> dict[int, str]:
    """Names of the castors and steered wheels by their place in the robot's file; wheels of one
    pivot, which share an angle, under its name."""
    if trajectory.robot is None:
        return {}
    steering, description = steering_of(trajectory.robot), trajectory.robot.description
    found = {i: steering.names[i] for i in sorted((*steering.steered, *steering.castors))}
    for pivot in description.pivots:
        first, *others = (steering.names.index(name) for name in pivot.wheels)
        found[first] = pivot.name
        for i in others:
            del found[i]
    return found


def _draw_steering(
    panels: Sequence[Axes], times: Array, state: State, wheels: dict[int, str]
) -> None:
    """Angles and rates of steered wheels and castors."""
    for k, (i, name) in enumerate(list(wheels.items())[:MOST_LINES]):
        look: dict[str, Any] = {"color": WHEEL_COLOURS[k % 8], "linestyle": WHEEL_DASHES[k % 8]}
        panels[0].plot(times, state.steering_angles[:, i], **look, label=name)
        panels[1].plot(times, state.steering_rates[:, i], **look)
    panels[0].set_ylabel("steering (rad)")
    panels[1].set_ylabel("steering rate (rad/s)")


def _lines(
    axes: Axes,
    times: Array,
    values: Array,
    names: Sequence[str],
    colours: Sequence[str],
    label: str,
) -> None:
    for i, name in enumerate(names):
        axes.plot(times, values[:, i], color=colours[i], label=name if len(names) > 1 else None)
    axes.set_ylabel(label)


def _limit_lines(axes: Axes, value: float | None, label: str, *, both: bool) -> None:
    """Dashed lines at a limit, and at its negative where the curve has two signs."""
    if value is None:
        return
    axes.axhline(value, color=GREY, linestyle="--", linewidth=1.0, label=f"{label} {value:g}")
    if both:
        axes.axhline(-value, color=GREY, linestyle="--", linewidth=1.0)
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, -value * _HEADROOM if both else low), max(high, value * _HEADROOM))


def _draw_wheels(axes: Axes, times: Array, speeds: Array, solution: Solution) -> None:
    names = solution.problem.robot.wheel_names
    for i in telling(speeds):
        axes.plot(
            times,
            speeds[:, i],
            color=WHEEL_COLOURS[i % 8],
            linestyle=WHEEL_DASHES[i % 8],
            label=names[i],
        )
    axes.set_ylabel("wheel speed (rad/s)")
    section, limit = solution.problem.actuator, _wheel_limit(solution)
    same = section is not None and section.saturation == limit
    _limit_lines(axes, limit, "limit, saturation" if same else "limit", both=True)
    if section is None:
        return
    if section.dead_zone > 0:
        axes.axhspan(
            -section.dead_zone,
            section.dead_zone,
            color=LIGHT,
            alpha=0.6,
            linewidth=0,
            zorder=0.6,
            label=f"dead-zone {section.dead_zone:g}",
        )
    for sign in () if same else (1, -1):
        axes.axhline(
            sign * section.saturation,
            color=GREEN,
            linestyle=":",
            linewidth=1.2,
            label=f"saturation {section.saturation:g}" if sign > 0 else None,
        )


def _wheel_limit(solution: Solution) -> float | None:
    """The limit of all wheels; None where they have different ones, or none."""
    found = [limit.largest for limit in solution.problem.limits if isinstance(limit, WheelSpeed)]
    return found[0] if found and isinstance(found[0], float) else None


def _draw_use(axes: Axes, trajectory: Trajectory) -> None:
    times, used = limit_use(trajectory)
    for k in telling(used):
        name = trajectory.limits[k].name
        axes.plot(
            times[:, k],
            used[:, k],
            color=limit_colour(name, k),
            linewidth=1.2,
            label=_words(name),
        )
    axes.axhline(1.0, color=GREY, linestyle="--", linewidth=1.0)
    axes.set_ylim(0.0, max(1.08, float(used.max()) * 1.05))
    axes.set_ylabel("limit in use (–)")


def _bands(axes: Axes, trajectory: Trajectory) -> None:
    """A coloured band wherever a limit binds."""
    order = [limit.name for limit in trajectory.limits]
    for first, last, name in band_times(trajectory):
        axes.axvspan(
            first,
            last,
            color=limit_colour(name, order.index(name)),
            alpha=_BAND,
            linewidth=0,
            zorder=0.4,
        )


def band_times(trajectory: Trajectory) -> list[tuple[float, float, str]]:
    """Begin and end (s) of every stretch where a limit binds, with its name."""
    return [
        (
            float(np.interp(part.start, trajectory.s, trajectory.times)),
            float(np.interp(part.end, trajectory.s, trajectory.times - trajectory.waits)),
            part.limit,
        )
        for part in trajectory.active
    ]


def _band_legend(figure: Figure, trajectory: Trajectory) -> None:
    order, shares = [limit.name for limit in trajectory.limits], binding_shares(trajectory)
    bands = [
        Patch(
            facecolor=limit_colour(name, order.index(name)),
            alpha=2 * _BAND,
            label=f"{_words(name)} {share:.0%}",
        )
        for name, share in shares.items()
    ]
    if not bands:
        bands = [Patch(facecolor="white", edgecolor=LIGHT, label="none")]
    kept = min(trajectory.margins().values()) >= MARGIN
    figure.legend(
        handles=bands,
        loc="outside lower left",
        ncols=4,
        alignment="left",
        title=f"limit that {'binds' if kept else 'binds or is broken'}, share of the time",
    )


def _words(name: str) -> str:
    return name.replace("_", " ")
