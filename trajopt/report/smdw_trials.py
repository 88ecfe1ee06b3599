"""Pictures of the SMDW's trials: climb rates, the phase map, closed-loop endings, motions, searches.

All take plain rows and arrays, so that any run of the trials can be drawn (Figures 5.23-5.25 and 6.4-6.13).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from trajopt.report.ground_plan import draw_robot
from trajopt.report.style import BLACK, BLUE, GREEN, GREY, LIGHT, ORANGE, PURPLE, SKY, VERMILION, new_figure
from trajopt.robots.platform import Platform
from trajopt.simulate.climb import wilson

Array = NDArray[np.float64]

_SOURCE_COLOURS = (BLUE, ORANGE, GREY, GREEN)
_WIDE = 0.8  # share of the room of a group that its bars take


@dataclass(frozen=True)
class ClimbCell:
    """``successes`` of ``trials`` of one configuration in one engine, planned by one ``source``; ``height`` m.

    ``thesis``: least and greatest share of climbs in the thesis, None where it does not count them.
    """

    engine: str
    height: float
    configuration: str
    source: str
    successes: int
    trials: int
    thesis: tuple[float, float] | None


def climb_rates_figure(cells: Sequence[ClimbCell]) -> Figure:
    """Share of trials with both leading wheels up, with Wilson intervals, the thesis's share beside (95 %)."""
    engines = list(dict.fromkeys(c.engine for c in cells))
    heights = sorted({c.height for c in cells})
    sources = list(dict.fromkeys(c.source for c in cells))
    figure = new_figure(2.5 * len(engines) + 0.5)
    grid = figure.subplots(len(engines), len(heights), squeeze=False, sharey=True)
    for row, engine in zip(grid, engines, strict=True):
        for ax, height in zip(row, heights, strict=True):
            here = [c for c in cells if (c.engine, c.height) == (engine, height)]
            _draw_rates(ax, here, sources)
            ax.set_title(f"{engine}, {100 * height:g} cm")
        row[0].set_ylabel("climbs / trials")
    handles = [Line2D([], [], color=_SOURCE_COLOURS[i % 4], linewidth=6, label=s) for i, s in enumerate(sources)]
    handles.append(Line2D([], [], color=VERMILION, marker="_", markersize=12, linestyle="", label="thesis"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


def _draw_rates(ax: Axes, cells: Sequence[ClimbCell], sources: Sequence[str]) -> None:
    names = list(dict.fromkeys(c.configuration for c in cells))
    width = _WIDE / max(len(sources), 1)
    for cell in cells:
        k = sources.index(cell.source)
        x = names.index(cell.configuration) + (k - (len(sources) - 1) / 2) * width
        share = cell.successes / cell.trials if cell.trials else 0.0
        low, high = wilson(cell.successes, cell.trials)
        ax.bar(x, share, 0.9 * width, color=_SOURCE_COLOURS[k % 4])
        ax.errorbar(x, share, [[share - low], [high - share]], color=BLACK, linewidth=0.8, capsize=2)
        if cell.thesis is not None:
            for value in set(cell.thesis):
                ax.plot(names.index(cell.configuration) + np.array([-0.5, 0.5]) * _WIDE, [value, value],
                        color=VERMILION, linewidth=1.2)
    ax.set_xticks(range(len(names)), names)
    ax.set_ylim(0, 1.08)


def phase_map_figure(shares: Mapping[tuple[str, float], Mapping[tuple[float, float], Sequence[float]]],
                     phases: Sequence[float]) -> Figure:
    """Share that climbs over the phase (rad) at which the wheel meets the step; a panel a (configuration, height m).

    ``shares``: for each panel and each (torque N m, friction) one share for each phase.
    """
    columns = list(dict.fromkeys(h for _, h in shares))
    figure = new_figure(2.3 * math.ceil(len(shares) / len(columns)) + 0.4)
    grid = figure.subplots(math.ceil(len(shares) / len(columns)), len(columns), squeeze=False)
    drawn = None
    for ax, (panel, rows) in zip(grid.ravel(), sorted(shares.items()), strict=False):
        values = np.array(list(rows.values()), dtype=np.float64)
        drawn = ax.imshow(values, aspect="auto", cmap="viridis", vmin=0, vmax=1, interpolation="nearest")
        ax.set_xticks(range(0, len(phases), 2), [f"{p:+.1f}" for p in phases[::2]])
        ax.set_yticks(range(len(rows)), [f"{torque:g} N m, \N{GREEK SMALL LETTER MU} {friction:g}"
                                         for torque, friction in rows])
        ax.set(title=f"{panel[0]}, {100 * panel[1]:g} cm", xlabel="phase at contact (rad)")
        ax.grid(False)
    if drawn is not None:
        figure.colorbar(drawn, ax=grid.ravel().tolist(), label="critical wheels up", shrink=0.6)
    return figure


def endings_figure(endings: Mapping[str, Array], bounds: Mapping[str, tuple[float, float, float]]) -> Figure:
    """Final errors (n, 3) of position (m), yaw (rad) and critical phase (rad) for each control, beside its bounds."""
    figure = new_figure(3.4)
    names = list(endings)
    for k, (ax, label, scale) in enumerate(zip(figure.subplots(1, 3), ("position (mm)", "yaw (deg)", "phase (rad)"),
                                               (1e3, 180 / math.pi, 1.0), strict=True)):
        for i, name in enumerate(names):
            values = np.sort(np.maximum(scale * endings[name][:, k], 1e-4))
            spread = i + 0.5 * (np.linspace(0, 1, len(values)) - 0.5)
            ax.plot(spread, values, ".", color=(BLUE, SKY, ORANGE, VERMILION, PURPLE)[i % 5], markersize=3)
            ax.plot([i - 0.35, i + 0.35], [scale * bounds[name][k]] * 2, color=BLACK, linewidth=1.2)
        ax.set_yscale("log")
        ax.set_xticks(range(len(names)), [n.replace(", ", "\n").replace(" and ", "\nand ") for n in names], rotation=0,
                      fontsize=6.5)
        ax.set_title(label)
    return figure


@dataclass(frozen=True, eq=False)
class Motions:
    """Simulated motions for one panel: ``poses`` a list of (N, 3), m and rad; ``good`` says which count as success.

    ``target`` (3,) is the wanted end, ``edge`` (m) the x of the step's edge, None without a step.
    """

    title: str
    poses: Sequence[Array]
    good: Sequence[bool]
    target: Array | None
    edge: float | None
    note: str


def motions_figure(panels: Sequence[Motions], robot: Platform, columns: int = 3) -> Figure:
    """Paths of the robot's centre from above with its last outline; successes blue, the others vermilion."""
    rows = math.ceil(len(panels) / columns)
    figure = new_figure(2.7 * rows + 0.3, 8.4)
    grid = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
    for ax, panel in zip(grid, panels, strict=False):
        for pose, good in zip(panel.poses, panel.good, strict=True):
            ax.plot(pose[:, 0], pose[:, 1], color=BLUE if good else VERMILION, linewidth=0.8)
            draw_robot(ax, robot, pose[-1], colour=BLUE if good else VERMILION)
        if panel.target is not None:
            draw_robot(ax, robot, panel.target, colour=BLACK, strong=True)
        if panel.edge is not None:
            low, high = ax.get_ylim()
            x = panel.edge
            ax.add_patch(Polygon([(x, low), (x + 3, low), (x + 3, high), (x, high)], color=LIGHT, zorder=0.3))
            ax.set_ylim(low, high)
            ax.set_xlim(ax.get_xlim()[0], max(ax.get_xlim()[1], x + 0.1))
        ax.set(title=panel.title, xlabel=f"x (m)\n{panel.note}", ylabel="y (m)", aspect="equal")
    for ax in grid[len(panels):]:
        ax.set_axis_off()
    return figure


def searches_figure(groups: Sequence[tuple[str, Sequence[tuple[str, Array]]]], goal: Array) -> Figure:
    """Paths (N, 2), m, that searches found: a panel a group, a labelled line a search (Figures 5.23-5.25)."""
    from matplotlib import colormaps

    figure = new_figure(3.6, 8.4)
    for ax, (title, lines) in zip(figure.subplots(1, len(groups), squeeze=False, sharex=True, sharey=True).ravel(),
                                  groups, strict=True):
        for k, (label, path) in enumerate(lines):
            colour = colormaps["viridis"](k / max(len(lines) - 1, 1))
            ax.plot(path[:, 0], path[:, 1], color=colour, linewidth=1.0, label=label)
        ax.plot(*goal, "x", color=VERMILION)
        ax.set(title=title, xlabel="x (m)", ylabel="y (m)", aspect="equal")
        ax.legend(fontsize=6, ncols=2, loc="best")
    return figure


def costs_figure(panels: Sequence[tuple[str, Sequence[tuple[Array, Array]]]]) -> Figure:
    """Best cost over iterations of several searches: panels of (iterations, cost) lines (Figures 6.5, 6.12)."""
    figure = new_figure(2.4 * math.ceil(len(panels) / 3) + 0.2, 8.4)
    grid = figure.subplots(math.ceil(len(panels) / 3), 3, squeeze=False, sharey=True).ravel()
    for ax, (title, lines) in zip(grid, panels, strict=False):
        for iterations, cost in lines:
            ax.plot(iterations, np.maximum(cost, 1e-16), color=BLUE, linewidth=0.8, alpha=0.7)
        ax.set(title=title, xlabel="iteration", ylabel="best cost", yscale="log")
    for ax in grid[len(panels):]:
        ax.set_axis_off()
    return figure
