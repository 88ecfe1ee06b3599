"""The way over the ground: its height, the loads of the wheels and the limits in use along the
path."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

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
    telling,
)
from trajopt.robots.robot import STANDARD_GRAVITY, Robot
from trajopt.simulate.plan import wheel_plan
from trajopt.solution import Solution
from trajopt.timing.trajectory import Trajectory

_SAMPLES = 800  # places along the path, chosen: about as many as pixels across
_BAND = 0.16  # opacity of the bands that mark the limit which binds, chosen


def stands(robot: Robot) -> bool:
    """Whether its wheels hold it up: three or more, not on one line."""
    contacts = np.asarray(robot.body.contacts, dtype=np.float64)
    return int(np.linalg.matrix_rank(contacts - contacts.mean(axis=0), tol=1e-9)) == 2


def loads_figure(solution: Solution, trajectory: Trajectory) -> Figure:
    """Panels over the path parameter (m): height of the robot's origin (m), load of every wheel
    (N), and the share of each limit in use. Bands mark the limit that binds.

    The trajectory's robot ``stands``.
    """
    robot, names = solution.problem.robot, [limit.name for limit in trajectory.limits]
    even = np.linspace(0.0, trajectory.path.length, _SAMPLES + 1)[:-1]  # at its end it rests
    times = np.interp(even, trajectory.s, trajectory.times)
    s, plan = trajectory.along(times)[0], wheel_plan(trajectory, times)
    figure = new_figure(6.4)
    height, loads, use = figure.subplots(
        3, 1, sharex=True, gridspec_kw={"height_ratios": [0.8, 1.6, 1.4]}
    )
    height.plot(s, trajectory.at(times).position[:, 2], color=BLACK)
    height.set_ylabel("height (m)")
    for i in telling(plan.loads - plan.loads.mean(axis=0)):
        look = {"color": WHEEL_COLOURS[i % 8], "linestyle": WHEEL_DASHES[i % 8]}
        name = robot.description.wheels[i].name
        loads.plot(s, plan.loads[:, i], **look, linewidth=1.2, label=name)
    share = robot.body.mass * STANDARD_GRAVITY / plan.loads.shape[1]
    loads.axhline(share, color=LIGHT, linewidth=0.9, zorder=0.8, label="even share of the weight")
    loads.set_ylim(min(0.0, float(plan.loads.min())), None)
    loads.set_ylabel("load (N)")
    _draw_use(use, trajectory)
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
    for k in telling(used):
        limit = trajectory.limits[k]
        s = np.interp(times[:, k], trajectory.times, trajectory.s)
        colour = limit_colour(limit.name, k)
        axes.plot(s, used[:, k], color=colour, linewidth=1.2, label=limit.name.replace("_", " "))
    axes.axhline(1.0, color=GREY, linestyle="--", linewidth=1.0)
    axes.set_ylim(0.0, max(1.08, float(used.max()) * 1.05))
    axes.set_ylabel("limit in use (–)")
