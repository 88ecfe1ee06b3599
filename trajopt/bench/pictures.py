"""The figures of an optimizer benchmark: ECDF of targets, data and performance profiles."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from trajopt.arrays import Array
from trajopt.bench.profiles import data_profile, ecdf, performance_profile
from trajopt.bench.tables import BenchTables, Unit
from trajopt.report.files import FORMATS
from trajopt.report.style import (
    LINE_COLOURS,
    MOST_LINES,
    first_in_front,
    in_style,
    new_figure,
    save_figure,
)

SWARM, _THICK = "pso", 2.6  # how names of swarms begin; width of the leading one's line, chosen
PROFILE_SHARE = (
    1e-5  # of reference - best: the accuracy of data and performance profiles; Moré and Wild's tau
)


def save_bench_pictures(tables: BenchTables, out: Path) -> dict[str, tuple[str, Figure]]:
    """Draw the figures of a benchmark as PNG, PDF and SVG into ``out``: title -> name of the PNG, figure."""
    accuracy = f"(accuracy {PROFILE_SHARE:g})"
    drawn = {
        "Targets reached (ECDF over problems, seeds and targets)": ("ecdf", ecdf_figure),
        f"Data and performance profiles {accuracy}": ("profiles", profiles_figure),
        "Targets reached over time, family by family": ("families", families_figure),
    }
    found = {}
    with in_style():
        for title, (name, draw) in drawn.items():
            figure = draw(tables)
            found[title] = (f"{name}.png", figure)
            for kind in FORMATS:
                save_figure(figure, out / f"{name}.{kind}")
    return found


def shown(tables: BenchTables) -> dict[str, str]:
    """Colours of the optimizers that pictures show: the leading swarm first, drawn thick and in
    front, then as many of the others that lead as can be told apart; tables hold all."""
    swarm = [name for name in tables.leaders if name.startswith(SWARM)][:1]
    others = [name for name in tables.leaders if name not in swarm]
    return dict(zip([*swarm, *others][:MOST_LINES], LINE_COLOURS, strict=False))


def _legend(figure: Figure, tables: BenchTables, named: Mapping[str, Artist]) -> None:
    left = len(tables.optimizers) - len(shown(tables))
    title = f"{left} others: see the tables" if left else None
    figure.legend(named.values(), named.keys(), loc="outside right upper", title=title)


def _named(axes: Axes) -> dict[str, Artist]:
    handles, labels = axes.get_legend_handles_labels()
    return dict(zip(labels, handles, strict=True))


def ecdf_figure(tables: BenchTables) -> Figure:
    """Share of targets reached over evaluations, evaluations with gradients, and seconds."""
    figure = new_figure(3.8, 9.5)
    columns = figure.subplots(1, 3, sharey=True)
    units: tuple[Unit, ...] = ("evaluations", "evaluations and gradients", "seconds")
    for axes, unit in zip(columns, units, strict=True):
        times = tables.times(unit)
        if unit != "seconds":
            times = times / tables.dimension[:, None, None, None]
        _curves(axes, tables, times, ecdf)
        axes.set_xlabel("time (s)" if unit == "seconds" else f"{unit} / dimension (–)")
    columns[0].set_ylabel("share of targets reached (–)")
    columns[1].set_title("gradients count as n evaluations")
    _legend(figure, tables, _named(columns[2]))
    return figure


def profiles_figure(tables: BenchTables) -> Figure:
    """Data profile over evaluations and performance profile over seconds."""
    figure = new_figure(3.8, 9.5)
    left, right = figure.subplots(1, 2, sharey=True)

    def solved(times: Array, budgets: Array) -> Array:
        return data_profile(times, tables.dimension, budgets)

    evaluations = tables.times("evaluations", [PROFILE_SHARE])[..., 0]
    _curves(left, tables, evaluations, solved, scale=1 / 3)
    left.set_xlabel("evaluations / (dimension + 1) (–)")
    left.set_ylabel("share solved (–)")
    left.set_title("data profile")
    ratios = np.geomspace(1.0, 1e4, 200)
    curves = performance_profile(tables.times("seconds", [PROFILE_SHARE])[..., 0], ratios)
    for name, colour in shown(tables).items():
        _steps(right, ratios, curves[:, tables.optimizers.index(name)], colour, name)
    first_in_front(right)
    right.set_xscale("log")
    right.set_xlabel("time / time of the fastest (–)")
    right.set_title("performance profile")
    _legend(figure, tables, _named(right))
    return figure


def families_figure(tables: BenchTables) -> Figure:
    """One small picture a family: share of targets reached over seconds."""
    families = tables.families()
    rows, columns = (len(families) + 3) // 4, min(4, len(families))
    figure = new_figure(2.4 * rows + 0.4, 10.0)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    colours = shown(tables)
    times = tables.times("seconds")[:, [tables.optimizers.index(name) for name in colours]]
    named: dict[str, Artist] = {}
    for axes, (family, places) in zip(grid, families.items(), strict=False):
        part = times[places]
        finite = part[np.isfinite(part) & (part > 0)]
        axes.set_title(family.replace(", ", "\n"), fontsize=8)
        axes.set_ylim(0.0, 1.02)
        axes.set_xscale("log")
        axes.xaxis.set_minor_formatter(NullFormatter())
        if not finite.size:
            continue
        budgets = np.geomspace(finite.min(), finite.max(), 200)
        curves = ecdf(part, budgets)
        for i, (name, colour) in enumerate(colours.items()):
            _steps(axes, budgets, curves[:, i], colour, name)
        first_in_front(axes)
        named = _named(axes) | named
    for axes in grid[len(families) :]:
        axes.set_axis_off()
    _legend(figure, tables, named)
    figure.supxlabel("processor time (s)", fontsize=9)
    figure.supylabel("share of targets reached (–)", fontsize=9)
    return figure


def _curves(
    axes: Axes,
    tables: BenchTables,
    times: Array,
    share: Callable[[Array, Array], Array],
    scale: float = 1.0,
) -> None:
    finite = times[np.isfinite(times) & (times > 0)]
    if not finite.size:
        return
    budgets = np.geomspace(finite.min() * scale, finite.max(), 200)
    curves = share(times, budgets)
    for name, colour in shown(tables).items():
        _steps(axes, budgets, curves[:, tables.optimizers.index(name)], colour, name)
    first_in_front(axes)
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.02)


def _steps(axes: Axes, x: Array, y: Array, colour: str, name: str) -> None:
    width = _THICK if name.startswith(SWARM) else 1.2
    axes.step(x, y, label=name, where="post", color=colour, linewidth=width)
