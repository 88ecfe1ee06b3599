"""How the search went: best cost and violation over evaluations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trajopt.arrays import Array, BoolArray
from trajopt.errors import ArgumentError
from trajopt.optimize.base import FEASIBLE, OptimizeResult, Status
from trajopt.report.style import (
    BLUE,
    GREY,
    LINE_COLOURS,
    ORANGE,
    VERMILION,
    first_in_front,
    new_figure,
)
from trajopt.solution import Solution

_DECADES = 1.0  # an axis is logarithmic where its values span more decades than this, chosen
_BAND = (10.0, 90.0)  # percentiles between which the band of several seeds lies, chosen
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
    log_where_wide(cost, drawn)
    cost.set_ylabel(f"{kind} ({unit})" if timed else "terminal cost (–)")
    if violation is not None:
        drawn = _curve(violation, search, history.violation, feasible, search.violation)
        log_where_wide(violation, drawn)
        violation.set_ylabel("violation (–)")
    lowest = cost if violation is None else violation
    lowest.set_xlabel("evaluations of the objective (–)")
    say_one_shot(cost, search)
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


def one_shot(search: OptimizeResult) -> bool:
    """Whether the first feasible candidate was the answer already, so that its curve is flat."""
    feasible = search.history.violation <= FEASIBLE
    return int(feasible.sum()) == 1 and search.status in (Status.TARGET, Status.CONVERGED)


def say_one_shot(axes: Axes, search: OptimizeResult) -> None:
    """A word on a curve that is flat."""
    if one_shot(search):
        text = f"{search.optimizer} finds its answer in one go: nothing converges"
        axes.text(0.5, 0.55, text, transform=axes.transAxes, ha="center", color=GREY)


def seeds_figure(searches: Mapping[str, Sequence[OptimizeResult]], unit: str = "–") -> Figure:
    """Best feasible cost over evaluations of searches with several seeds, a line each name: the median, and a band from
    the 10th to the 90th percentile. A search that has met no feasible candidate yet counts as infinitely costly.

    Raises ArgumentError for more than 8 names, or a name without searches.
    """
    if not 1 <= len(searches) <= len(LINE_COLOURS) or not all(searches.values()):
        raise ArgumentError("searches", list(searches), f"1 to {len(LINE_COLOURS)} names, each with results")  # fmt: skip
    figure = new_figure(3.4)
    axes = figure.add_subplot()
    drawn = []
    for (name, results), colour in zip(searches.items(), LINE_COLOURS, strict=False):
        counts, best = best_of_seeds(results)
        drawn.append(draw_band(axes, counts, best, colour, f"{name}, {len(results)} seeds"))
    values = np.concatenate([part.ravel() for part in drawn])
    log_where_wide(axes, values[np.isfinite(values)])
    axes.set_xscale("log")
    first_in_front(axes)
    axes.set_xlabel("evaluations of the objective (–)")
    axes.set_ylabel(f"best cost so far ({unit})")
    axes.set_title("Median and 10-90 % of the seeds")
    axes.legend()
    return figure


def best_of_seeds(results: Sequence[OptimizeResult]) -> tuple[Array, Array]:
    """(N,) evaluations and (N, S) best feasible cost of each search by then, inf before there is one."""
    counts = np.unique(np.concatenate([[r.nfev, *r.history.evaluations] for r in results]))
    best = np.full((len(counts), len(results)), np.inf)
    for k, result in enumerate(results):
        good = result.history.violation <= FEASIBLE
        for count, cost in zip(result.history.evaluations[good], result.history.cost[good], strict=True):  # fmt: skip
            best[counts >= count, k] = cost
    return counts.astype(np.float64), best


def draw_band(axes: Axes, x: Array, values: Array, colour: str, label: str | None = None) -> Array:
    """Steps of the median of (N, S) and a band around it; what was drawn, (3, N). Infinite values have no line."""
    low, middle, high = np.percentile(
        np.maximum(values, _FLOOR), (_BAND[0], 50.0, _BAND[1]), axis=1, method="nearest"
    )
    axes.step(x, np.where(np.isfinite(middle), middle, np.nan), where="post", color=colour, label=label)  # fmt: skip
    top = np.where(
        np.isfinite(high), high, max(2.0 * np.max(values[np.isfinite(values)], initial=0.0), _FLOOR)
    )
    shown = np.isfinite(low)
    axes.fill_between(x, low, top, where=shown.tolist(), step="post", color=colour, alpha=0.18, linewidth=0)  # fmt: skip
    return np.array([low, middle, high])


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


def log_where_wide(axes: Axes, values: Array) -> None:
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
