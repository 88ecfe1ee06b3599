"""Figures of [udengaard2008] from our numbers: isotropy (8, 9, 11, 13) and tracking (29-31), and
the Pareto front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.report.style import BLACK, BLUE, GREEN, GREY, ORANGE, VERMILION, new_figure

COLOURS = (BLUE, VERMILION, GREEN, ORANGE, BLACK)
DASHES = (
    "-",
    (0, (6, 2)),
    (0, (3, 2)),
    (0, (1, 1)),
    "-.",
)  # lines on top of each other stay visible


def curve_figure(
    x: Array, y: Array, printed: Mapping[float, float], labels: tuple[str, str, str]
) -> Figure:
    """One curve of ours (x, y) with values read from the thesis; ``labels``: title, x, y (Figures
    9, 11)."""
    figure = new_figure(3.2, 5.2)
    axes = figure.add_subplot()
    axes.plot(x, y, color=BLUE, label="quadrature")
    axes.plot(
        list(printed),
        list(printed.values()),
        "o",
        color=VERMILION,
        label="thesis's figure",
        clip_on=False,
        zorder=3,
    )
    axes.set_title(labels[0])
    axes.set_xlabel(labels[1])
    axes.set_ylabel(labels[2])
    axes.set_ylim(0, 1.05)
    axes.legend()
    return figure


def map_figure(
    x: Array,
    y: Array,
    values: Array,
    labels: tuple[str, str, str],
    ridge: tuple[Array, Array] | None = None,
) -> Figure:
    """Contours of ``values`` (len(y), len(x)); ``ridge``: a line to compare with (Figures 8,
    13)."""
    figure = new_figure(3.8, 5.4)
    axes = figure.add_subplot()
    lines = axes.contourf(x, y, values, levels=np.linspace(0, 1, 21), cmap="viridis")
    figure.colorbar(lines, ax=axes, label="mean isotropy (–)", ticks=np.linspace(0, 1, 6))
    if ridge is not None:
        axes.plot(*ridge, color="white", linestyle="--", label="2 / cos(tilt)")
        axes.legend(labelcolor="white")
        axes.set_xlim(x[0], x[-1])
        axes.set_ylim(y[0], y[-1])
    axes.set_title(labels[0])
    axes.set_xlabel(labels[1])
    axes.set_ylabel(labels[2])
    axes.grid(visible=False)
    return figure


def tracks_figure(corners: Array, tracks: Sequence[tuple[str, Array]], title: str) -> Figure:
    """Paths from above: ``tracks`` are (label, (n, 2) m), five at most, beside the commanded
    corners (Figures 29, 31)."""
    if len(tracks) > len(COLOURS):
        raise ArgumentError("tracks", len(tracks), f"at most {len(COLOURS)}, or lines look alike")
    figure = new_figure(4.6)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.plot(*corners.T, color=GREY, linestyle="--", label="commanded")
    for style, (label, track) in zip(zip(COLOURS, DASHES, strict=True), tracks, strict=False):
        axes.plot(
            track[:, 0], track[:, 1], color=style[0], linestyle=style[1], linewidth=1.2, label=label
        )
    axes.set_title(title)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    figure.legend(loc="outside right upper")
    return figure


def speed_figure(
    series: Sequence[tuple[str, Array, Array]], commanded: float, title: str
) -> Figure:
    """Speeds (label, times s, m/s) over time beside the commanded one and 48 % of it (Figure
    30)."""
    figure = new_figure(3.0)
    axes = figure.add_subplot()
    for colour, (label, times, speed) in zip(COLOURS * len(series), series, strict=False):
        axes.plot(times, speed, color=colour, linewidth=1.0, label=label)
    axes.axhline(commanded, color=GREY, linestyle="--", linewidth=0.8, label="commanded")
    axes.axhline(
        0.48 * commanded, color=GREY, linestyle=":", linewidth=0.8, label="48 %, thesis's least"
    )
    axes.set_title(title)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("speed (m/s)")
    axes.set_ylim(bottom=0)
    figure.legend(loc="outside right upper")
    return figure


def front_figure(terms: Array, names: Sequence[str], best: Array) -> Figure:
    """Pareto front: each term (p, m, shares of its peak) against range; ``best`` (m,) the optimum
    of J."""
    figure = new_figure(2.8)
    axis = names.index("d_max")
    others = [k for k in range(len(names)) if k != axis]
    for place, k in enumerate(others):
        axes = figure.add_subplot(1, len(others), place + 1)
        front = axes.plot(terms[:, axis], terms[:, k], ".", color=BLUE, markersize=3)
        star = axes.plot(best[axis], best[k], "*", color=VERMILION, markersize=9, clip_on=False)
        axes.set_ylim(0, 1.05)
        axes.set_title(names[k])
        axes.set_xlabel("d_max / best (–)")
        if place == 0:
            axes.set_ylabel("share of best (–)")
            figure.legend(
                [*front, *star],
                ["Pareto front", "optimum of J"],
                loc="outside lower center",
                ncols=2,
            )
        else:
            axes.tick_params(labelleft=False)
    return figure
