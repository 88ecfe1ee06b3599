"""The motion over time: pose, speeds and wheel speeds against their limits, and which limit binds when."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from trajopt.paths.samples import sample_at
from trajopt.pipeline import Solution
from trajopt.report.run_folder import binding_shares, wheel_names
from trajopt.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LIGHT,
    VERMILION,
    WHEEL_COLOURS,
    WHEEL_DASHES,
    legend_beside,
    limit_colour,
    new_figure,
)
from trajopt.timing.trajectory import Trajectory

Array = NDArray[np.float64]

_SAMPLES = 1200  # times at which curves are drawn, chosen: more than pixels across
_BAND = 0.16  # opacity of the bands that mark the limit which binds, chosen
_HEADROOM = 1.12  # axes end this far beyond the limit lines, chosen


def profile_figure(solution: Solution, trajectory: Trajectory) -> Figure:
    """Stacked panels over time (s): position, yaw, speed, wheel speeds, and the share of each limit in use."""
    times = np.linspace(0.0, trajectory.duration, _SAMPLES)
    state = trajectory.at(times)
    limits = solution.problem.limits
    figure = new_figure(9.2)
    panels: Sequence[Axes] = figure.subplots(
        6, 1, sharex=True, gridspec_kw={"height_ratios": [1, 0.8, 1.1, 0.8, 1.4, 1.2]})
    position, yaw, speed, turning, wheels, use = panels
    _lines(position, times, state.pose[:, :2], ("x", "y"), (BLUE, VERMILION), "position (m)")
    _lines(yaw, times, state.pose[:, 2:], ("yaw",), (BLACK,), "yaw (rad)")
    _lines(speed, times, state.twist[:, :2], ("forward", "left"), (BLUE, VERMILION), "speed (m/s)")
    speed.plot(times, np.hypot(state.twist[:, 0], state.twist[:, 1]), color=BLACK, label="total")
    _limit_lines(speed, limits.speed, "limit", both=bool(np.min(state.twist[:, :2]) < -1e-6))
    _lines(turning, times, state.twist[:, 2:], ("yaw rate",), (BLACK,), "yaw rate (rad/s)")
    _limit_lines(turning, limits.yaw_rate, "limit", both=True)
    for i, name in enumerate(wheel_names(state.wheel_speeds.shape[1])):
        wheels.plot(times, state.wheel_speeds[:, i], color=WHEEL_COLOURS[i % 4], linestyle=WHEEL_DASHES[i % 4],
                    label=name)
    wheels.set_ylabel("wheel speed (rad/s)")
    _limit_lines(wheels, limits.wheel_speed, "limit", both=True)
    _draw_actuator(wheels, solution)
    _draw_use(use, trajectory, times)
    for axes in panels:
        _bands(axes, trajectory)
        legend_beside(axes)
    figure.align_ylabels(list(panels))
    panels[-1].set_xlabel("time (s)")
    panels[-1].set_xlim(0.0, trajectory.duration)
    panels[0].set_title(f"{solution.problem.title}: {trajectory.duration:.2f} s ({trajectory.engine})")
    _band_legend(figure, trajectory)
    return figure


def limit_use(trajectory: Trajectory, times: Array) -> Array:
    """(N, L): how much of each limit is in use at times (N,), s; 1 is all of it, more is broken.

    From the limits' own rows: 1 minus the relative margin, as ``Trajectory.margins`` defines it.
    """
    s, speed, acceleration = trajectory.along(times)
    samples = sample_at(trajectory.path, s, trajectory.path.locate(s))
    used = np.zeros((len(times), len(trajectory.limits)))
    for k, limit in enumerate(trajectory.limits):
        rows = limit.rows(samples, trajectory.robot)
        with np.errstate(divide="ignore", invalid="ignore"):
            used[:, k] = np.nan_to_num(speed / np.sqrt(rows.sd2_max))  # 0/0: at rest under a bound of zero
        if rows.a.shape[1]:
            beyond = (rows.a * acceleration[:, None] + rows.b * speed[:, None] ** 2 - rows.c) / rows.scale
            used[:, k] = np.maximum(used[:, k], 1.0 + beyond.max(axis=1))
    return used


def _lines(axes: Axes, times: Array, values: Array, names: Sequence[str], colours: Sequence[str],
           label: str) -> None:
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


def _draw_actuator(axes: Axes, solution: Solution) -> None:
    section = solution.problem.actuator
    if not section.enabled:
        return
    if section.dead_zone > 0:
        axes.axhspan(-section.dead_zone, section.dead_zone, color=LIGHT, alpha=0.6, linewidth=0, zorder=0.6,
                     label="dead-zone")
    for sign in (1, -1):
        axes.axhline(sign * section.saturation, color=GREEN, linestyle=":", linewidth=1.2,
                     label=f"saturation {section.saturation:g}" if sign > 0 else None)


def _draw_use(axes: Axes, trajectory: Trajectory, times: Array) -> None:
    used = limit_use(trajectory, times)
    for k, limit in enumerate(trajectory.limits):
        axes.plot(times, used[:, k], color=limit_colour(limit.name, k), label=_words(limit.name), linewidth=1.2)
    axes.axhline(1.0, color=GREY, linestyle="--", linewidth=1.0)
    axes.set_ylim(0.0, max(1.08, float(used.max()) * 1.05))
    axes.set_ylabel("limit in use (–)")


def _bands(axes: Axes, trajectory: Trajectory) -> None:
    """A coloured band wherever a limit binds."""
    order = [limit.name for limit in trajectory.limits]
    for first, last, name in band_times(trajectory):
        axes.axvspan(first, last, color=limit_colour(name, order.index(name)), alpha=_BAND, linewidth=0, zorder=0.4)


def band_times(trajectory: Trajectory) -> list[tuple[float, float, str]]:
    """Begin and end (s) of every stretch where a limit binds, with its name."""
    return [(float(np.interp(part.start, trajectory.s, trajectory.times)),
             float(np.interp(part.end, trajectory.s, trajectory.times)), part.limit) for part in trajectory.active]


def _band_legend(figure: Figure, trajectory: Trajectory) -> None:
    order, shares = [limit.name for limit in trajectory.limits], binding_shares(trajectory)
    bands = [Patch(facecolor=limit_colour(name, order.index(name)), alpha=2 * _BAND,
                   label=f"{_words(name)} binds ({share:.0%} of the time)") for name, share in shares.items()]
    if not bands:
        bands = [Patch(facecolor="white", edgecolor=LIGHT, label="no limit binds")]
    figure.legend(handles=bands, loc="outside lower center", ncols=3)


def _words(name: str) -> str:
    return name.replace("_", " ")
