"""The motion over time: pose, speeds and wheel speeds against their limits, and which limit binds
when."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from trajopt.arrays import Array
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.paths.samples import sample_at
from trajopt.report.motion import binding_shares
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
from trajopt.solution import MARGIN, Solution
from trajopt.timing.trajectory import Trajectory

_SAMPLES = 1200  # times at which curves are drawn, chosen: more than pixels across
_INSIDE = (
    0.001,
    0.5,
    0.999,
)  # of an interval: where limits are read; not on its ends, rows jump at knots. Chosen
_BAND = 0.16  # opacity of the bands that mark the limit which binds, chosen
_HEADROOM = 1.12  # axes end this far beyond the limit lines, chosen


def profile_figure(solution: Solution, trajectory: Trajectory) -> Figure:
    """Stacked panels over time (s): position, yaw, speed, wheel speeds, and the share of each limit
    in use."""
    times = np.linspace(0.0, trajectory.duration, _SAMPLES)
    state = trajectory.at(times)
    limits = solution.problem.limits_section
    figure = new_figure(9.2)
    panels: Sequence[Axes] = figure.subplots(
        6, 1, sharex=True, gridspec_kw={"height_ratios": [1, 0.8, 1.1, 0.8, 1.4, 1.2]}
    )
    position, yaw, speed, turning, wheels, use = panels
    _lines(position, times, state.pose[:, :2], ("x", "y"), (BLUE, VERMILION), "position (m)")
    _lines(yaw, times, state.pose[:, 2:], ("yaw",), (BLACK,), "yaw (rad)")
    _lines(speed, times, state.twist[:, :2], ("forward", "left"), (BLUE, VERMILION), "speed (m/s)")
    speed.plot(times, np.hypot(state.twist[:, 0], state.twist[:, 1]), color=BLACK, label="total")
    _limit_lines(speed, limits.speed, "limit", both=bool(np.min(state.twist[:, :2]) < -1e-6))
    _lines(turning, times, state.twist[:, 2:], ("yaw rate",), (BLACK,), "yaw rate (rad/s)")
    _limit_lines(turning, limits.yaw_rate, "limit", both=True)
    _draw_wheels(wheels, times, state.wheel_speeds, solution)
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


def limit_use(trajectory: Trajectory) -> tuple[Array, Array]:
    """Most of each limit in use between gridpoints, and when: times (s) and shares, both (N + 2,
    L).

    The first and last rows belong to the ends of the motion, the N between to the intervals.

    A share of 1 is all of the limit, more is broken. From the limits' own rows: 1 minus the
    relative margin, as ``Trajectory.margins`` defines it.
    """
    u, sdd = trajectory.u, trajectory.sdd
    shares = np.zeros((len(_INSIDE), len(sdd), len(trajectory.limits)))
    times = np.empty((len(_INSIDE), len(sdd), 1))
    for j, part in enumerate(_INSIDE):
        here = u[:-1] + part * np.diff(u)
        s = trajectory.path.parameter(here)
        sd2 = np.maximum(trajectory.sd[:-1] ** 2 + 2 * sdd * (s - trajectory.s[:-1]), 0.0)
        times[j, :, 0] = trajectory.times[:-1] + 2 * (s - trajectory.s[:-1]) / (
            trajectory.sd[:-1] + np.sqrt(sd2)
        )
        samples = sample_at(trajectory.path, s, here)
        for k, limit in enumerate(trajectory.limits):
            rows = limit.rows(samples, trajectory.robot)
            with np.errstate(divide="ignore", invalid="ignore"):
                shares[j, :, k] = np.nan_to_num(np.sqrt(sd2 / rows.sd2_max))
            if rows.a.shape[1]:
                beyond = (rows.a * sdd[:, None] + rows.b * sd2[:, None] - rows.c) / rows.scale
                shares[j, :, k] = np.maximum(shares[j, :, k], 1.0 + beyond.max(axis=1))
    times = np.broadcast_to(times, shares.shape)
    most = shares.argmax(axis=0)[None]
    curves = (
        np.vstack([v[0, :1], np.take_along_axis(v, most, axis=0)[0], v[-1, -1:]])
        for v in (times, shares)
    )
    return next(curves), next(curves)


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
    for i, name in enumerate(solution.problem.robot.wheel_names):
        axes.plot(
            times,
            speeds[:, i],
            color=WHEEL_COLOURS[i % 4],
            linestyle=WHEEL_DASHES[i % 4],
            label=name,
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
    for k, limit in enumerate(trajectory.limits):
        axes.plot(
            times[:, k],
            used[:, k],
            color=limit_colour(limit.name, k),
            linewidth=1.2,
            label=_words(limit.name),
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
            float(np.interp(part.end, trajectory.s, trajectory.times)),
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
