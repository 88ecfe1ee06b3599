"""Pictures of the SMDW's trials: climb rates, the phase map, closed-loop endings, motions.

All take plain rows and arrays, so that any run of the trials can be drawn ([guzman2015], Figures
6.4-6.13).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from trajopt.arrays import Array
from trajopt.report.ground_plan import draw_robot
from trajopt.report.style import (
    BLACK,
    BLUE,
    LIGHT,
    VERMILION,
    new_figure,
)
from trajopt.robots.robot import Robot

_STEP_SHOWN = 0.15  # m, least depth of the step that is drawn, chosen


@dataclass(frozen=True, eq=False)
class Motions:
    """Simulated motions for one panel: ``poses`` a list of (N, 3), m and rad; ``good`` says which
    count as success.

    ``ideal`` (N, 3) is the planned motion, None where there is none; ``edge`` the x (m) of the
    step's edge, None for one that is not drawn.
    """

    title: str
    poses: Sequence[Array]
    good: Sequence[bool]
    ideal: Array | None
    edge: float | None
    note: str


def motions_figure(panels: Sequence[Motions], robot: Robot, columns: int = 3) -> Figure:
    """Paths of the robot's centre from above with its last outline; successes blue, the others
    vermilion."""
    rows = math.ceil(len(panels) / columns)
    figure = new_figure(3.3 * rows + 0.3, 8.8)
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for ax, panel in zip(grid, panels, strict=False):
        for wanted, colour in ((False, VERMILION), (True, BLUE)):
            chosen = [p for p, good in zip(panel.poses, panel.good, strict=True) if good == wanted]
            ways = LineCollection([p[:, :2] for p in chosen], colors=colour, linewidths=0.8)
            ax.add_collection(ways)
            ax.autoscale_view()
            for pose in chosen:
                draw_robot(ax, robot, pose[-1], colour=colour)
        if panel.ideal is not None:
            ax.plot(
                panel.ideal[:, 0], panel.ideal[:, 1], color=BLACK, linewidth=1.2, linestyle="--"
            )
            draw_robot(ax, robot, panel.ideal[-1], colour=BLACK, strong=True)
        ax.set(title=panel.title, xlabel=f"x (m)\n{panel.note}", aspect="equal")
        ax.title.set_fontsize(8.5)
    low, high = grid[0].get_xlim()  # of all panels: they share it
    high = max(high, *(panel.edge + _STEP_SHOWN for panel in panels if panel.edge is not None), low)
    for ax, panel in zip(grid, panels, strict=False):
        if panel.edge is not None:
            ax.axvspan(panel.edge, high, color=LIGHT, zorder=0.3, linewidth=0)
        ax.set_xlim(low, high)
        ax.grid(visible=False)
    for ax in grid[::columns]:
        ax.set_ylabel("y (m)")
    for ax in grid[len(panels) :]:
        ax.set_axis_off()
    return figure
