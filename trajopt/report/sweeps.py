"""Pictures of sweeps: a heat map over two axes, lines with intervals, pairs of columns."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from trajopt.errors import ArgumentError
from trajopt.report.intervals import wilson
from trajopt.report.style import GREY, MOST_LINES, first_in_front, in_style, new_figure, save_figure
from trajopt.report.units import with_unit
from trajopt.sweeps.store import open_store

INTERVAL = (10.0, 90.0)  # percentiles between which a line's band lies; chosen
_MOST_PAIRS = 6  # columns of a picture of pairs, to stay readable; chosen
_MOST_POINTS = 5_000  # points drawn in one panel of pairs; chosen


def heat_map(frame: pd.DataFrame, x: str, y: str, value: str) -> Figure:
    """Mean of ``value`` over two axes, written into the cells; finished cases only.

    A cell without finished cases stays empty. Raises ArgumentError for unknown columns and empty
    tables.
    """
    rows = _done(frame, (x, y, value))
    means = rows.assign(**{value: rows[value].astype(float)}).pivot_table(
        index=y, columns=x, values=value
    )
    figure = new_figure(1.4 + 0.45 * len(means.index), 1.6 + 0.75 * len(means.columns))
    axes = figure.add_subplot()
    cells = means.to_numpy(dtype=np.float64)
    image = axes.imshow(cells, origin="lower", aspect="auto")
    axes.grid(visible=False)
    axes.set_xticks(range(len(means.columns)), [_short(v) for v in means.columns])
    axes.set_yticks(range(len(means.index)), [_short(v) for v in means.index])
    axes.set_xlabel(with_unit(x))
    axes.set_ylabel(with_unit(y))
    middle = (np.nanmin(cells) + np.nanmax(cells)) / 2
    if cells.size <= 400:
        for (row, column), cell in np.ndenumerate(cells):
            if np.isfinite(cell):
                axes.text(
                    column,
                    row,
                    f"{cell:.3g}",
                    ha="center",
                    va="center",
                    fontsize=8,
                    color="black" if cell > middle else "white",
                )
    figure.colorbar(image, label=f"mean {with_unit(value)}")
    return figure


def lines(frame: pd.DataFrame, x: str, value: str, by: str | None = None) -> Figure:
    """Median of ``value`` over ``x``, a line for each value of ``by``, with bands from the 10th to
    the 90th percentile; for a value that is only 0 or 1 (or a boolean) the share of ones with
    Wilson's 95 % interval. Of more than 8 values of ``by`` as many are drawn, evenly out of all.

    Finished cases only. Raises ArgumentError as ``heat_map``.
    """
    rows = _done(frame, (x, value) if by is None else (x, value, by))
    rows = rows.assign(**{value: rows[value].astype(float)})
    yes_or_no = bool(rows[value].isin([0.0, 1.0]).all())
    figure = new_figure(4.2)
    axes = figure.add_subplot()
    groups = [("", rows)] if by is None else list(rows.groupby(by))
    places_of = np.linspace(0, len(groups) - 1, min(len(groups), MOST_LINES)).round().astype(int)
    for name, group in (groups[k] for k in places_of):
        bands = [
            (place, *(_share(v) if yes_or_no else _median(v)))
            for place, v in group.groupby(x)[value]
        ]
        places, middle, low, high = zip(*bands, strict=True)
        label = None if by is None else _short(name)
        (line,) = axes.plot(places, middle, marker="o", markersize=4, label=label)
        axes.fill_between(places, low, high, color=line.get_color(), alpha=0.18, linewidth=0)
    first_in_front(axes)
    axes.set_xlabel(with_unit(x))
    axes.set_ylabel(
        f"{value} (–): share, 95 % interval"
        if yes_or_no
        else f"{with_unit(value)}: median, 10-90 %"
    )
    if by is not None:
        left = len(groups) - len(places_of)
        axes.legend(title=with_unit(by) + (f", {left} values between left out" if left else ""))
    return figure


def _median(values: pd.Series) -> tuple[float, float, float]:
    low, middle, high = np.percentile(values, (INTERVAL[0], 50.0, INTERVAL[1]))
    return float(middle), float(low), float(high)


def _share(values: pd.Series) -> tuple[float, float, float]:
    return (float(values.mean()), *wilson(int(values.sum()), len(values)))


def pairs(frame: pd.DataFrame, columns: Sequence[str]) -> Figure:
    """Scatter of every pair of numeric columns, histograms on the diagonal. Raises
    ArgumentError."""
    if not 2 <= len(columns) <= _MOST_PAIRS:
        raise ArgumentError("columns", list(columns), f"2 to {_MOST_PAIRS} columns")
    rows = _done(frame, columns)
    values = rows[list(columns)].astype(float).to_numpy()
    values = values[:: max(1, len(values) // _MOST_POINTS)]
    count = len(columns)
    figure = new_figure(2.0 * count + 0.5, 2.0 * count + 0.8)
    grid = figure.subplots(count, count, squeeze=False, sharex="col")
    for (i, j), axes in np.ndenumerate(grid):
        if i == j:
            axes.hist(values[:, i], bins=30, color=GREY)
        else:
            axes.plot(values[:, j], values[:, i], ".", markersize=2, alpha=0.5)
        if i == count - 1:
            axes.set_xlabel(with_unit(columns[j]))
        if i == j:
            axes.set_ylabel("cases (–)")
        elif j == 0:
            axes.set_ylabel(with_unit(columns[i]))
        else:
            axes.tick_params(labelleft=False)
    return figure


def draw(
    store: Path,
    out: Path,
    *,
    value: str = "",
    x: str = "",
    y: str = "",
    by: str = "",
    pair: Sequence[str] | None = None,
) -> None:
    """Save a picture (*.png, *.pdf, *.svg) of a sweep's store: x, y and value (heat map), x and value (lines), or pairs
    of columns.

    Raises ArgumentError for any other choice of columns.
    """
    frame = open_store(store, create=False).frame()
    with in_style():
        if pair:
            figure = pairs(frame, pair)
        elif x and y and value:
            figure = heat_map(frame, x, y, value)
        elif x and value:
            figure = lines(frame, x, value, by or None)
        else:
            raise ArgumentError(
                "options", None, "--x --y --value, --x --value [--by], or --pair twice or more"
            )
        save_figure(figure, out)


def _done(frame: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    for name in columns:
        if name not in frame.columns:
            raise ArgumentError("column", name, "one of " + ", ".join(frame.columns))
    rows = frame[frame["status"] == "done"].dropna(subset=list(columns))
    if rows.empty:
        raise ArgumentError("columns", list(columns), "columns with at least one finished case")
    return rows


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
