"""The figures of an optimizer benchmark: ECDF of targets, data and performance profiles."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from trajopt.arrays import Array
from trajopt.bench.profiles import data_profile, ecdf, performance_profile
from trajopt.bench.tables import BenchTables, Unit
from trajopt.files import whole_file
from trajopt.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    in_style,
    new_figure,
)

_COLOURS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK, GREY)
_DASHES = ("-", "--", ":")
_SHOWN = (
    "pso",
    "pso-gbest",
    "pso-thesis-enhanced",
    "pyswarms",
    "cma-es",
    "differential-evolution",
    "auto",
    "lattice",
    "ipopt",
    "slsqp",
    "l-bfgs-b",
    "least-squares",
)  # in the small pictures, where they apply
PROFILE_SHARE = (
    1e-5  # of reference - best: the accuracy of data and performance profiles; Moré and Wild's tau
)


def save_bench_pictures(tables: BenchTables, out: Path) -> dict[str, tuple[str, Figure]]:
    """Draw the figures of a benchmark as PNG and SVG into ``out``: title -> name of the PNG, figure."""
    accuracy = f"(accuracy {PROFILE_SHARE:g})"
    drawn = {
        "Targets reached (ECDF over problems, seeds and targets)": ("ecdf", _ecdf_figure),
        f"Data and performance profiles {accuracy}": ("profiles", _profile_figure),
        "Targets reached over time, family by family": ("families", _family_figure),
    }
    found = {}
    with in_style():
        for title, (name, draw) in drawn.items():
            figure = draw(tables)
            found[title] = (f"{name}.png", figure)
            for kind in ("svg", "png"):
                with whole_file(out / f"{name}.{kind}") as part:
                    figure.savefig(part, format=kind)
    return found


def _ecdf_figure(tables: BenchTables) -> Figure:
    figure = new_figure(3.8, 9.5)
    columns = figure.subplots(1, 3, sharey=True)
    units: tuple[Unit, ...] = ("evaluations", "evaluations and gradients", "seconds")
    for axes, unit in zip(columns, units, strict=True):
        times = tables.times(unit)
        if unit != "seconds":
            times = times / tables.dimension[:, None, None, None]
        _curves(axes, tables, times, ecdf)
        axes.set_xlabel("seconds" if unit == "seconds" else f"{unit} / dimension")
    columns[0].set_ylabel("share of targets reached")
    columns[1].set_title("gradients count as n evaluations")
    figure.legend(*columns[2].get_legend_handles_labels(), loc="outside right upper")
    return figure


def _profile_figure(tables: BenchTables) -> Figure:
    figure = new_figure(3.8, 9.5)
    left, right = figure.subplots(1, 2, sharey=True)

    def solved(times: Array, budgets: Array) -> Array:
        return data_profile(times, tables.dimension, budgets)

    evaluations = tables.times("evaluations", [PROFILE_SHARE])[..., 0]
    _curves(left, tables, evaluations, solved, scale=1 / 3)
    left.set_xlabel("evaluations / (dimension + 1)")
    left.set_ylabel("share solved")
    left.set_title("data profile")
    ratios = np.geomspace(1.0, 1e4, 200)
    curves = performance_profile(tables.times("seconds", [PROFILE_SHARE])[..., 0], ratios)
    for k, name in enumerate(tables.optimizers):
        _steps(right, ratios, curves[:, k], k, name)
    right.set_xscale("log")
    right.set_xlabel("seconds / seconds of the fastest")
    right.set_title("performance profile")
    figure.legend(*right.get_legend_handles_labels(), loc="outside right upper")
    return figure


def _family_figure(tables: BenchTables) -> Figure:
    """One small picture a family: share of targets reached over seconds, of the methods people
    choose between."""
    families = tables.families()
    rows, columns = (len(families) + 3) // 4, min(4, len(families))
    figure = new_figure(2.4 * rows + 0.4, 10.0)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    chosen = [k for k, name in enumerate(tables.optimizers) if name in _SHOWN]
    times = tables.times("seconds")[:, chosen]
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
        for i, k in enumerate(chosen):
            name = tables.optimizers[k]
            _steps(axes, budgets, curves[:, i], k, name)
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    for axes in grid[len(families) :]:
        axes.set_axis_off()
    figure.legend(named.values(), named.keys(), loc="outside right upper", fontsize=8)
    figure.supxlabel("seconds of processor time", fontsize=9)
    figure.supylabel("share of targets reached", fontsize=9)
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
    for k, name in enumerate(tables.optimizers):
        _steps(axes, budgets, curves[:, k], k, name)
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.02)


def _steps(axes: Axes, x: Array, y: Array, place: int, name: str) -> None:
    """One optimizer's step curve; its ``place`` in the order chooses colour and dash."""
    colour, dash = _COLOURS[place % 8], _DASHES[place // 8 % 3]
    axes.step(x, y, label=name, where="post", color=colour, ls=dash)
