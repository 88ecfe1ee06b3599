"""Pictures of PowerBot's plans: path with speed, profile against limits, safe speeds, a replanned
run."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from trajopt.control.encounter import Course
from trajopt.control.encounter_run import Run
from trajopt.report.style import (
    BLUE,
    GREEN,
    GREY,
    VERMILION,
    legend_beside,
    new_figure,
)


def replan_figure(run: Run, where: Course, *, free: Run | None = None) -> Figure:
    """Speed and distance to the nearest obstacle over time; ``free`` is the same run without
    obstacles."""
    figure = new_figure(4.4)
    speed, gap = figure.subplots(2, 1, sharex=True)
    if free is not None:
        speed.plot(
            free.times, free.v, color=GREY, lw=1.0, label=f"way free, {_arrival(free):.1f} s"
        )
    speed.plot(run.times, run.v, color=BLUE, label=f"with obstacles, {_arrival(run):.1f} s")
    speed.set(ylabel="speed (m/s)", title="Replanned motion")
    seen = np.isfinite(run.gap)
    stop = run.v**2 / (2 * np.interp(run.s, where.s, where.braking))
    gap.plot(run.times, np.where(seen, run.gap, np.nan), color=VERMILION, label="nearest obstacle")
    gap.plot(run.times, stop, color=GREEN, label="braking distance")
    gap.set(xlabel="time (s)", ylabel="distance (m)", ylim=(0, None))
    for axes in (speed, gap):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], seen, [False]]).astype(int)))
        for first, end in zip(edges[::2], edges[1::2], strict=True):
            axes.axvspan(
                run.times[first], run.times[min(end, len(run.times) - 1)], color="#f3e3d8", lw=0
            )
        legend_beside(axes)
    return figure


def _arrival(run: Run) -> float:
    """When the plan came to its last place, s."""
    return float(run.times[int(np.argmax(run.s >= run.s[-1]))])
