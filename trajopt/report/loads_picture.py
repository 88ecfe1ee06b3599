"""The way over the ground: its height, the loads of the wheels and the limits in use along the
path."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trajopt.arrays import Array
from trajopt.limits.forces import contact_loads
from trajopt.report.motion import limit_use
from trajopt.report.style import (
    BLACK,
    GREY,
    LIGHT,
    WHEEL_COLOURS,
    WHEEL_DASHES,
    legend_beside,
    limit_colour,
    new_figure,
)
from trajopt.robots.robot import STANDARD_GRAVITY, Robot
from trajopt.solution import Solution
from trajopt.timing.trajectory import Trajectory

_SAMPLES = 800  # places along the path, chosen: about as many as pixels across
_BAND = 0.16  # opacity of the bands that mark the limit which binds, chosen


def stands(robot: Robot) -> bool:
    """Whether its wheels hold it up: three or more, not on one line."""
    contacts = np.asarray(robot.body.contacts, dtype=np.float64)
    return int(np.linalg.matrix_rank(contacts - contacts.mean(axis=0), tol=1e-9)) == 2


def wheel_loads(trajectory: Trajectory, s: Array) -> Array:
    """(N, K): load of every wheel of the robot's file, N, at path parameters (N,), m."""
    robot = trajectory.robot
    assert robot is not None
    i = np.clip(np.searchsorted(trajectory.s, s, side="right") - 1, 0, len(trajectory.sdd) - 1)
    after = s - trajectory.s[i]
    square = np.maximum(trajectory.sd[i] ** 2 + 2 * trajectory.sdd[i] * after, 0.0)
    samples = trajectory.track.samples(s, trajectory.path.locate(s))
    return robot.body.mass * contact_loads(samples, robot).at(trajectory.sdd[i], square)


def loads_figure(solution: Solution, trajectory: Trajectory) -> Figure:
    """Panels over the path parameter (m): height of the robot's origin (m), load of every wheel
    (N), and the share of each limit in use. Bands mark the limit that binds.

    The trajectory's robot ``stands``.
    """
    robot = solution.problem.robot
    s = np.linspace(0.0, trajectory.path.length, _SAMPLES)
    figure = new_figure(6.4)
    height, loads, use = figure.subplots(
        3, 1, sharex=True, gridspec_kw={"height_ratios": [0.8, 1.6, 1.4]}
    )
    position = trajectory.path.position(trajectory.path.locate(s))
    z = position[:, 2] if position.shape[1] > 2 else np.zeros(len(s))
    height.plot(s, z, color=BLACK)
    height.set_ylabel("height (m)")
    values = wheel_loads(trajectory, s)
    for i, wheel in enumerate(robot.description.wheels):
        look = {"color": WHEEL_COLOURS[i % 8], "linestyle": WHEEL_DASHES[i % 4]}
        loads.plot(s, values[:, i], **look, linewidth=1.2, label=wheel.name)
    even = robot.body.mass * STANDARD_GRAVITY / values.shape[1]
    loads.axhline(even, color=LIGHT, linewidth=0.9, zorder=0.8, label="even share of the weight")
    loads.set_ylim(min(0.0, float(values.min())), None)
    loads.set_ylabel("load (N)")
    _draw_use(use, trajectory)
    names = [limit.name for limit in trajectory.limits]
    for axes in (height, loads, use):
        for part in trajectory.active:
            colour = limit_colour(part.limit, names.index(part.limit))
            axes.axvspan(part.start, part.end, color=colour, alpha=_BAND, linewidth=0, zorder=0.4)
        legend_beside(axes)
    figure.align_ylabels([height, loads, use])
    use.set_xlabel("path parameter s (m)")
    use.set_xlim(0.0, trajectory.path.length)
    height.set_title(f"{solution.problem.title}: loads of the wheels, limits in use")
    return figure


def _draw_use(axes: Axes, trajectory: Trajectory) -> None:
    times, used = limit_use(trajectory)
    for k, limit in enumerate(trajectory.limits):
        s = np.interp(times[:, k], trajectory.times, trajectory.s)
        colour = limit_colour(limit.name, k)
        axes.plot(s, used[:, k], color=colour, linewidth=1.2, label=limit.name.replace("_", " "))
    axes.axhline(1.0, color=GREY, linestyle="--", linewidth=1.0)
    axes.set_ylim(0.0, max(1.08, float(used.max()) * 1.05))
    axes.set_ylabel("limit in use (–)")
