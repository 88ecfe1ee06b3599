"""How the search went: best cost and violation over evaluations."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trajopt.arrays import Array, BoolArray
from trajopt.optimize.base import FEASIBLE, OptimizeResult, Status
from trajopt.report.style import BLUE, GREY, ORANGE, VERMILION, new_figure
from trajopt.solution import Solution

_DECADES = 1.0  # an axis is logarithmic where its values span more decades than this, chosen
_FLOOR = 1e-16  # smallest cost drawn on a logarithmic axis: rounding of doubles
_WORDS = {
    Status.EVALUATIONS: "budget used up",
    Status.SECONDS: "time used up",
    Status.NO_EXACT: "none exact",
}


def convergence_figure(solution: Solution, search: OptimizeResult) -> Figure:
    """Best cost over evaluations, and below it the best violation where the search ever met one."""
    history = search.history
    broken = bool(np.any(history.violation > FEASIBLE)) or not search.violation <= FEASIBLE
    figure = new_figure(4.6 if broken else 3.2)
    if broken:
        cost, violation = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [3, 2]})
    else:
        cost, violation = figure.add_subplot(), None
    feasible = history.violation <= FEASIBLE
    kind, unit = solution.problem.objective.kind, solution.problem.objective.unit.strip()
    timed = kind != "terminal"
    if timed:  # where wheel angles miss, searches rank by violation, and the cost is none
        drawn = _curve(
            cost,
            search,
            np.where(feasible, history.cost, np.nan),
            feasible,
            search.fun if search.violation <= FEASIBLE else np.inf,
        )
    else:
        drawn = _curve(cost, search, history.cost, feasible, search.fun)
    _log_where_wide(cost, drawn)
    cost.set_ylabel(f"{kind} ({unit})" if timed else "terminal cost (–)")
    if violation is not None:
        drawn = _curve(violation, search, history.violation, feasible, search.violation)
        _log_where_wide(violation, drawn)
        violation.set_ylabel("violation (–)")
    lowest = cost if violation is None else violation
    lowest.set_xlabel("evaluations of the objective")
    counts = history.evaluations[history.evaluations > 0]
    if counts.size and search.nfev / counts[0] > 10**_DECADES:
        lowest.set_xscale("log")
        lowest.set_xlim(max(0.8, 0.8 * counts[0]), 1.25 * search.nfev)
    else:
        lowest.set_xlim(0, max(search.nfev, 1) * 1.08 + 1)
        lowest.xaxis.get_major_locator().set_params(integer=True)
    cost.set_title(
        f"{solution.problem.title}: {search.optimizer}, {_final(solution)}{search.nfev} evaluations, "
        f"{_WORDS.get(search.status, search.status.name.lower())}"
    )
    _legend(figure)
    return figure


def _final(solution: Solution) -> str:
    unit = solution.problem.objective.unit
    return f"cost {solution.cost:.3g}{unit}, " if np.isfinite(solution.cost) else ""


def _curve(
    axes: Axes, search: OptimizeResult, values: Array, feasible: BoolArray, final: float
) -> Array:
    """Staircase of the best so far, dashed while infeasible, and the recomputed final value; what
    was drawn."""
    history, nfev = search.history, search.nfev
    kept = np.isfinite(values)
    count, best, good = history.evaluations[kept], values[kept], feasible[kept]
    drawn = [*best, *([final] if np.isfinite(final) else [])]
    wide = _is_wide(np.array(drawn))
    floor = _FLOOR if wide else -np.inf
    for wanted, dash, name in (
        (False, (0, (3, 1.5)), "best so far, infeasible"),
        (True, "-", "best so far"),
    ):
        chosen = np.flatnonzero(good == wanted)
        if not len(chosen):
            continue
        after = chosen[-1] + 1
        x = [*count[chosen], count[after] if after < len(count) else max(nfev, count[-1])]
        y = np.maximum([*best[chosen], best[chosen[-1]]], floor)
        axes.plot(
            x,
            y,
            drawstyle="steps-post",
            color=BLUE if wanted else ORANGE,
            linestyle=dash,
            label=name,
        )
        if len(chosen) <= 40:
            axes.plot(
                x[:-1],
                y[:-1],
                linestyle="none",
                marker="o",
                markersize=3.5,
                color=BLUE if wanted else ORANGE,
            )
    if np.isfinite(final):
        axes.plot(
            [nfev],
            [max(final, floor)],
            linestyle="none",
            marker="D",
            markersize=6,
            color=VERMILION,
            markeredgecolor="white",
            markeredgewidth=0.8,
            zorder=3,
            clip_on=False,
            label="recomputed for the report",
        )
    if not drawn:
        axes.text(
            0.5,
            0.5,
            "no feasible candidate with a finite value",
            transform=axes.transAxes,
            ha="center",
            color=GREY,
        )
    return np.array(drawn)


def _is_wide(values: Array) -> bool:
    positive = values[values > 0]
    if not positive.size:
        return False
    return bool(values.max() > 10**_DECADES * max(values.min(), _FLOOR)) or bool(
        values.max() < 1e-3
    )


def _log_where_wide(axes: Axes, values: Array) -> None:
    """A logarithmic axis for values over decades, or one tiny value; else a linear one from 0."""
    if not values.size:
        axes.set_yticks([])
        return
    if not _is_wide(values):
        top = float(values.max())
        axes.set_ylim(0.0, top * 1.15 if top > 0 else 1.0)
        return
    axes.set_yscale("log")
    shown = np.maximum(values, _FLOOR)
    low, high = np.log10(shown.min()), np.log10(shown.max())
    room = max(0.06 * (high - low), 0.0) if high - low > 2 else 1.0
    axes.set_ylim(10 ** (low - room), 10 ** (high + room))


def _legend(figure: Figure) -> None:
    """One legend below for all panels."""
    found = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    if found:
        figure.legend(list(found.values()), list(found), loc="outside lower center", ncols=3)
