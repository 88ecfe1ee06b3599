"""The pictures of docs/time_scaling.md: python -m benchmarks.time_scaling_pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from trajopt.arrays import Array
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.paths.path import Path as Route
from trajopt.report.style import (
    BLUE,
    GREY,
    VERMILION,
    in_style,
    limit_colour,
    new_figure,
    save_figure,
)
from trajopt.robots.robot import robot
from trajopt.timing.cells import Measure, cells_of
from trajopt.timing.curved import source_of
from trajopt.timing.fastest import _ceilings
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory

FOLDER = Path("docs/pictures")
ROUTE = Route.through([[0, 0], [1.5, 0], [2.2, 0.6], [1.4, 1.0], [1.6, 1.7], [3.2, 1.6]])
LIMITS = (
    Speed(1.2),
    Acceleration(0.7, 0.9),
    Slip(0.25),
    WheelSpeed(11.0),
    WheelAcceleration(9.0),
)
SIZES = (25, 50, 100, 200, 400, 800)


def timed(gridpoints: int | None = None, gap: float = 1e-3) -> Trajectory:
    return time_scale(ROUTE, LIMITS, robot=robot("powerbot"), gridpoints=gridpoints, gap=gap)


def ceiling(trajectory: Trajectory) -> tuple[Array, Array]:
    """Path parameter (m) and the greatest path speed (m/s) that limits leave there."""
    measure = Measure.of(trajectory.track)
    source = source_of(trajectory.track, measure, trajectory.limits)
    cells = cells_of(trajectory.track, measure, trajectory.u, source, trajectory.u)
    top, _, _ = _ceilings(cells, cells.table.c, cells.cap)
    at = cells.solved
    g, _ = measure.stretch(cells.places[at])
    return ROUTE.parameter(cells.places[at]), np.sqrt(top[at]) / g


def phase(trajectory: Trajectory) -> Figure:
    figure = new_figure(3.0)
    axes = figure.add_subplot()
    s, most = ceiling(trajectory)
    high = 1.6 * float(trajectory.sd.max())
    axes.fill_between(s, np.minimum(most, high), high, color=GREY, alpha=0.25, linewidth=0)
    axes.plot(s, most, color=GREY, label="greatest speed that limits leave")
    axes.plot(*driven(trajectory), color=BLUE, label="fastest motion")
    axes.set(xlabel="s (m)", ylabel="s' (m/s)", xlim=(0, ROUTE.length), ylim=(0, high))
    axes.legend(loc="upper right")
    return figure


def driven(trajectory: Trajectory) -> tuple[Array, Array]:
    """Path parameter (m) and path speed (m/s), close enough to draw a curve."""
    s, speed, _ = trajectory.along(np.linspace(0, trajectory.duration, 2001))
    return s, speed


def rows(trajectory: Trajectory) -> Figure:
    figure = new_figure(3.0)
    axes = figure.add_subplot()
    s, speed = driven(trajectory)
    axes.plot(s, speed, color=GREY, linewidth=0.8)
    for index, limit in enumerate(trajectory.limits):
        here = [part for part in trajectory.active if part.limit == limit.name]
        binds = np.any([(s >= part.start) & (s <= part.end) for part in here], axis=0)
        if here:
            look = {"color": limit_colour(limit.name, index), "label": limit.name.replace("_", " ")}
            axes.plot(s, np.where(binds, speed, np.nan), linewidth=3, **look)
    axes.set(xlabel="s (m)", ylabel="s' (m/s)", xlim=(0, ROUTE.length), ylim=(0, 1.6))
    axes.legend(loc="upper right", title="binds", ncols=2)
    return figure


def grid() -> Figure:
    """Few gridpoints on a path with a tight turn, on the path and over it."""
    route = Route.through([[0, 0], [1.2, 0], [2.2, 0.1], [1.2, 0.25], [0, 0.3]])
    found = time_scale(route, LIMITS[:2], robot=robot("powerbot"), gridpoints=60, gap=None)
    figure = new_figure(2.8)
    path, over = figure.subplots(1, 2)
    line = route.position(np.linspace(route.start, route.end, 800))
    points = route.position(found.u)
    path.plot(line[:, 0], line[:, 1], color=GREY)
    path.plot(points[:, 0], points[:, 1], ".", color=VERMILION, markersize=4)
    path.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
    over.semilogy((found.s[1:] + found.s[:-1]) / 2, np.diff(found.s) * 1e3, ".", color=VERMILION)
    over.set(xlabel="s (m)", ylabel="length of cells (mm)", xlim=(0, route.length))
    return figure


def gap() -> Figure:
    found = [timed(size, gap=1.0) for size in SIZES]
    cells = [len(one.u) - 1 for one in found]
    best = timed(3000)
    assert best.bound is not None
    figure = new_figure(2.8)
    times, share = figure.subplots(1, 2)
    times.semilogx(cells, [one.duration for one in found], "o-", color=BLUE, label="time")
    times.semilogx(
        cells, [one.bound or np.nan for one in found], "o-", color=VERMILION, label="bound"
    )
    times.axhline(best.duration, color=GREY, linewidth=0.8)
    times.set(xlabel="cells (–)", ylabel="time (s)")
    times.legend()
    share.loglog(cells, [one.gap or np.nan for one in found], "o-", color=BLUE)
    share.axhline(1e-3, color=GREY, linewidth=0.8)
    share.annotate("asked for", (cells[0], 1e-3), (0, 3), textcoords="offset points", color=GREY)
    share.set(xlabel="cells (–)", ylabel="gap, share of the time (–)")
    return figure


def main() -> None:
    with in_style():
        trajectory = timed()
        for name, figure in (
            ("phase", phase(trajectory)),
            ("rows", rows(trajectory)),
            ("grid", grid()),
            ("gap", gap()),
        ):
            print(f"wrote {save_figure(figure, FOLDER / f'time_scaling_{name}.png')}")


if __name__ == "__main__":
    main()
