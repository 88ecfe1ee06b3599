"""Figures of the SMDW page: climb rates, where phase decides, causes, endings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from trajopt.arrays import Array
from trajopt.report.intervals import wilson
from trajopt.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    new_figure,
)

_SOURCE_COLOURS = (BLUE, ORANGE, GREY, GREEN)


_WIDE = 0.8  # share of the room of a group that its bars take


_ROOM = 0.2  # share from which a bar holds its count, chosen


_SPREAD = 0.5  # share of the room of a row over which its points are spread


_LEAST = {
    "position (mm)": 0.1,
    "yaw (deg)": 0.01,
    "phase (rad)": 1e-4,
}  # smallest error drawn, chosen


@dataclass(frozen=True)
class ClimbCell:
    """``successes`` of ``trials`` of one configuration in one engine, planned by one ``source``;
    ``height`` m.

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
    """Share of trials with both leading wheels up, with Wilson intervals, the thesis's share beside
    (95 %)."""
    engines = list(dict.fromkeys(c.engine for c in cells))
    heights = sorted({c.height for c in cells})
    sources = list(dict.fromkeys(c.source for c in cells))
    figure = new_figure(2.5 * len(engines) + 0.5, 8.4)
    grid = figure.subplots(len(engines), len(heights), squeeze=False, sharey=True)
    for row, engine in zip(grid, engines, strict=True):
        for ax, height in zip(row, heights, strict=True):
            here = [c for c in cells if (c.engine, c.height) == (engine, height)]
            _draw_rates(ax, here, sources)
            ax.set_title(f"{engine}, step of {100 * height:g} cm")
        row[0].set_ylabel("leading wheels up, share (–)")
    handles = [
        Line2D([], [], color=_SOURCE_COLOURS[i % 4], linewidth=6, label=s)
        for i, s in enumerate(sources)
    ]
    handles.append(Line2D([], [], color=VERMILION, linewidth=1.6, label="printed in the thesis"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return figure


def _draw_rates(ax: Axes, cells: Sequence[ClimbCell], sources: Sequence[str]) -> None:
    names = list(dict.fromkeys(c.configuration for c in cells))
    width = _WIDE / max(len(sources), 1)
    for i, name in enumerate(names):
        mine = {c.source: c for c in cells if c.configuration == name}
        for k, source in enumerate(sources):
            x = i + (k - (len(sources) - 1) / 2) * width
            if source not in mine:
                ax.text(
                    x,
                    0.03,
                    "not run",
                    rotation=90,
                    ha="center",
                    va="bottom",
                    fontsize=7,
                    color=GREY,
                )
                continue
            _draw_rate(ax, x, 0.9 * width, mine[source], _SOURCE_COLOURS[k % 4])
        for value in {v for c in mine.values() if c.thesis is not None for v in c.thesis}:
            ax.plot(
                i + np.array([-0.5, 0.5]) * _WIDE,
                [value, value],
                color=VERMILION,
                linewidth=1.6,
                clip_on=False,
                zorder=4,
            )
    ax.set_xticks(range(len(names)), names)
    ax.set_ylim(0, 1.08)


def _draw_rate(ax: Axes, x: float, width: float, cell: ClimbCell, colour: str) -> None:
    share = cell.successes / cell.trials if cell.trials else 0.0
    low, high = wilson(cell.successes, cell.trials)
    ax.bar(x, share, width, color=colour)
    ax.errorbar(x, share, [[share - low], [high - share]], color=BLACK, linewidth=0.8, capsize=2)
    ax.text(
        x,
        0.03,
        f"{cell.successes}/{cell.trials}",
        rotation=90,
        ha="center",
        va="bottom",
        fontsize=7,
        color="white" if share > _ROOM else BLACK,
    )


def phase_map_figure(
    shares: Mapping[tuple[str, float], Mapping[tuple[float, float], Sequence[float]]],
    phases: Sequence[float],
) -> Figure:
    """Share that climbs over the phase (rad) at which the wheel meets the step; a panel a
    (configuration, height m).

    ``shares``: for each panel and each (torque N m, friction) one share for each phase.
    """
    columns = list(dict.fromkeys(h for _, h in shares))
    rows_of_panels = math.ceil(len(shares) / len(columns))
    figure = new_figure(2.3 * rows_of_panels + 0.4)
    grid = figure.subplots(rows_of_panels, len(columns), squeeze=False)
    drawn = None
    for ax, (panel, rows) in zip(grid.ravel(), shares.items(), strict=False):
        values = np.array(list(rows.values()), dtype=np.float64)
        drawn = ax.imshow(
            values, aspect="auto", cmap="viridis", vmin=0, vmax=1, interpolation="nearest"
        )
        ax.set_xticks(range(0, len(phases), 2), [f"{p:+.1f}" for p in phases[::2]])
        ax.set_yticks(
            range(len(rows)),
            [
                f"{torque:g} N m, \N{GREEK SMALL LETTER MU} {friction:g}"
                for torque, friction in rows
            ],
        )
        ax.set(title=f"{panel[0]}, step of {100 * panel[1]:g} cm", xlabel="phase at contact (rad)")
        ax.grid(False)
    if drawn is not None:
        figure.colorbar(
            drawn,
            ax=grid.ravel().tolist(),
            label="critical wheels up, share of the runs (–)",
            shrink=0.6,
        )
    return figure


def causes_figure(causes: Mapping[str, Mapping[str, Mapping[float, tuple[int, int]]]]) -> Figure:
    """Share that climbs over one cause a panel: for each label (a line) and value, (successes,
    trials); bars are Wilson's 95 % intervals, lines are set a little aside of each other."""
    figure = new_figure(3.0, 8.8)
    axes = figure.subplots(1, len(causes), sharey=True, squeeze=False)[0]
    for ax, (cause, lines) in zip(axes, causes.items(), strict=True):
        for k, (label, cells) in enumerate(lines.items()):
            places = np.arange(len(cells)) + 0.08 * (k - (len(lines) - 1) / 2)
            shares = np.array([up / max(of, 1) for up, of in cells.values()])
            ends = np.array([wilson(up, of) for up, of in cells.values()])
            ax.errorbar(
                places,
                shares,
                np.abs(ends.T - shares),
                color=(BLUE, SKY, VERMILION, ORANGE)[k % 4],
                marker="o",
                markersize=3,
                linewidth=1.2,
                elinewidth=0.8,
                label=label,
            )
            ax.set_xticks(range(len(cells)), [f"{value:g}" for value in cells])
        ax.set_xlabel(cause)
    axes[0].set(ylabel="critical wheels up, share (–)", ylim=(-0.03, 1.03))
    figure.legend(
        *axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False
    )
    return figure


def endings_figure(
    endings: Mapping[str, Array], bounds: Mapping[str, tuple[float, float, float]]
) -> Figure:
    """Final errors (n, 3) of position (m), yaw (rad) and critical phase (rad) for each control,
    beside its bounds."""
    names = list(endings)
    figure = new_figure(0.55 * len(names) + 1.1, 8.4)
    axes = figure.subplots(1, 3, sharey=True)
    for k, (ax, label, scale) in enumerate(
        zip(axes, _LEAST, (1e3, 180 / math.pi, 1.0), strict=True)
    ):
        for i, name in enumerate(names):
            values = np.sort(np.maximum(scale * endings[name][:, k], _LEAST[label]))
            spread = i + _SPREAD * (np.linspace(0, 1, len(values)) - 0.5)
            ax.plot(
                values,
                spread,
                ".",
                color=(BLUE, SKY, ORANGE, VERMILION, PURPLE)[i % 5],
                markersize=3,
            )
            ax.plot([scale * bounds[name][k]] * 2, [i - 0.35, i + 0.35], color=BLACK, linewidth=1.4)
        ax.set(xscale="log", xlabel=label)
    axes[0].set_yticks(range(len(names)), [f"{n}\n{len(endings[n])} trials" for n in names])
    axes[0].invert_yaxis()
    return figure
