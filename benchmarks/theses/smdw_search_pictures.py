"""Pictures of searches for control points: paths, swarms, costs over iterations and over the place
of P2.

All take plain arrays, so that any search can be drawn ([guzman2015], Figures 5.15-5.25, 6.5 and
6.12).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from trajopt.arrays import Array
from trajopt.report.convergence_picture import draw_band
from trajopt.report.style import (
    BLACK,
    BLUE,
    GREY,
    LINE_COLOURS,
    MOST_LINES,
    VERMILION,
    new_figure,
)

Box = tuple[tuple[float, float], tuple[float, float]]  # x and y range, m

_WIDE = 8.4  # inch
_DISTINCT = 4  # up to which lines get colours without an order, chosen
_LEAST = 1e-16  # smallest cost drawn: rounding of doubles


def searches_figure(
    groups: Sequence[tuple[str, Sequence[tuple[str, Array]]]], goal: Array
) -> Figure:
    """Paths (N, 2), m, that searches found: a panel a group, a labelled line a search (Figures
    5.23-5.25); of more than 8 as many, evenly out of all."""
    columns = 2
    rows = math.ceil(len(groups) / columns)
    figure = new_figure(2.9 * rows + 0.2, _WIDE)
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for ax, (title, lines) in zip(grid, groups, strict=False):
        chosen = np.linspace(0, len(lines) - 1, min(len(lines), MOST_LINES)).round().astype(int)
        for k, (label, path) in enumerate(lines[i] for i in chosen):
            colour = (
                LINE_COLOURS[k]
                if len(chosen) <= _DISTINCT
                else colormaps["viridis"](0.95 * k / (len(chosen) - 1))
            )
            ax.plot(path[:, 0], path[:, 1], color=colour, linewidth=1.1, label=label)
        ax.plot(*goal, "x", color=BLACK)
        ax.set(title=title, aspect="equal")
        ax.set_xlabel("x (m)")
        ax.legend(fontsize=6.5, loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.2)
    for ax in grid[::columns]:
        ax.set_ylabel("y (m)")
    for ax in grid[len(groups) :]:
        ax.set_axis_off()
    return figure


@dataclass(frozen=True, eq=False)
class SwarmSearch:
    """One search: where its particles were, ``places`` (n, 2), m, and the path (N, 2) it found
    through ``best``."""

    title: str
    places: Array
    path: Array
    best: Array


def swarms_figure(
    searches: Sequence[SwarmSearch], space: Box, view: Box, columns: int = 4
) -> Figure:
    """What swarms explored of the place of P2, with the path found (Figures 5.15-5.22).

    ``space`` is the navigation space, ``view`` the part of the ground that is shown.
    """
    rows = math.ceil(len(searches) / columns)
    figure = new_figure(2.6 * rows + 0.2, 9.6)
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for ax, search in zip(grid, searches, strict=False):
        ax.plot(
            search.places[:, 0],
            search.places[:, 1],
            ".",
            color=GREY,
            markersize=0.8,
            alpha=0.25,
            rasterized=True,
        )
        _box(ax, space)
        ax.plot(search.path[:, 0], search.path[:, 1], color=BLUE, linewidth=1.4)
        ax.plot(*search.best, "o", color=VERMILION, markersize=4)
        ax.set(title=search.title, aspect="equal", xlim=view[0], ylim=view[1])
        ax.title.set_fontsize(8.5)
    for ax in grid[::columns]:
        ax.set_ylabel("y (m)")
    for ax in grid[max(0, len(searches) - columns) : len(searches)]:
        ax.set_xlabel("x (m)")
        ax.xaxis.set_tick_params(labelbottom=True)
    for ax in grid[len(searches) :]:
        ax.set_axis_off()
    handles = [
        Line2D([], [], color=GREY, marker=".", linestyle="", label="explored"),
        Line2D([], [], color=BLACK, linestyle="--", linewidth=0.9, label="space"),
        Line2D([], [], color=BLUE, label="path"),
        Line2D([], [], color=VERMILION, marker="o", markersize=4, linestyle="", label="P2"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


def _box(ax: Axes, box: Box) -> None:
    (x0, x1), (y0, y1) = box
    ax.add_patch(
        Rectangle(
            (x0, y0), x1 - x0, y1 - y0, fill=False, edgecolor=BLACK, linestyle="--", linewidth=0.9
        )
    )


def costs_figure(panels: Sequence[tuple[str, Sequence[tuple[Array, Array]]]]) -> Figure:
    """Best cost over iterations: panels of (iterations, cost) of several seeds, drawn as their median and a band."""
    figure = new_figure(2.4 * math.ceil(len(panels) / 3) + 0.2, _WIDE)
    grid = figure.subplots(
        math.ceil(len(panels) / 3), 3, squeeze=False, sharex=True, sharey=True
    ).ravel()
    for ax, (title, lines) in zip(grid, panels, strict=False):
        counts = np.unique(np.concatenate([iterations for iterations, _ in lines]))
        best = np.column_stack(
            [
                np.where(counts < iterations[0], np.inf, cost[np.searchsorted(iterations, counts, side="right") - 1])
                for iterations, cost in lines  # the best so far holds until it is beaten
            ]
        )  # fmt: skip
        draw_band(ax, counts, np.maximum(best, _LEAST), BLUE)
        ax.set(title=title, yscale="log")
    for ax in grid[::3]:
        ax.set_ylabel("best cost (–)")
    for ax in grid[max(0, len(panels) - 3) : len(panels)]:
        ax.set_xlabel("iteration (–)")
        ax.xaxis.set_tick_params(labelbottom=True)
    for ax in grid[len(panels) :]:
        ax.set_axis_off()
    return figure


@dataclass(frozen=True, eq=False)
class CostMap:
    """Cost (m, n) over the place of P2, ``x`` (n,) and ``y`` (m,), m, and where searches ended,
    ``found`` (k, 2)."""

    title: str
    x: Array
    y: Array
    cost: Array
    found: Array


def cost_maps_figure(maps: Sequence[CostMap], columns: int = 3) -> Figure:
    """Cost over the place of P2 with the ends of searches (Figures 6.5 and 6.12)."""
    rows = math.ceil(len(maps) / columns)
    figure = new_figure(2.5 * rows + 0.2, _WIDE)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    values = np.concatenate([m.cost.ravel() for m in maps])
    norm = LogNorm(max(float(values.min()), _LEAST), float(values.max()))
    drawn = None
    for ax, shown in zip(grid, maps, strict=False):
        drawn = ax.pcolormesh(
            shown.x,
            shown.y,
            shown.cost,
            cmap="viridis_r",
            norm=norm,
            shading="nearest",
            rasterized=True,
        )
        ax.plot(
            shown.found[:, 0],
            shown.found[:, 1],
            "o",
            color=VERMILION,
            markeredgecolor="white",
            markersize=4.5,
            markeredgewidth=0.6,
        )
        ax.set(title=shown.title, aspect="equal", xlabel="P2: x (m)", ylabel="P2: y (m)")
        ax.grid(visible=False)
    for ax in grid[len(maps) :]:
        ax.set_axis_off()
    if drawn is not None:
        figure.colorbar(drawn, ax=grid.tolist(), label="cost (–)", shrink=0.7)
    return figure
