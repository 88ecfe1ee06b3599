"""Picture of what time scaling costs against the number of gridpoints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from trajopt.errors import ArgumentError
from trajopt.report.style import (
    BLUE,
    GREY,
    ORANGE,
    VERMILION,
    legend_beside,
    new_figure,
)

_COLOURS = (BLUE, VERMILION, ORANGE)


def growth_exponent(points: Sequence[float], seconds: Sequence[float]) -> float:
    """Slope of the straight line through log(seconds) over log(points): 1 where cost is linear.

    Raises ArgumentError for fewer than two pairs, or numbers that are not positive.
    """
    x, y = np.asarray(points, dtype=np.float64), np.asarray(seconds, dtype=np.float64)
    if x.shape != y.shape or len(x) < 2 or not (np.all(x > 0) and np.all(y > 0)):
        raise ArgumentError(
            "points, seconds",
            (list(points), list(seconds)),
            "two or more pairs of positive numbers",
        )
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def growth_figure(series: Mapping[str, tuple[Sequence[float], Sequence[float]]]) -> Figure:
    """Seconds over gridpoints, both logarithmic; ``series`` maps a name to (points, seconds).

    Each is labelled with its exponent; the dashed line through the first series' last point is cost
    proportional to the number of points.
    """
    figure = new_figure(3.8)
    axes = figure.add_subplot()
    for (name, (points, seconds)), colour in zip(series.items(), _COLOURS, strict=False):
        exponent = growth_exponent(points, seconds)
        axes.loglog(
            points,
            1e3 * np.asarray(seconds),
            "o-",
            ms=4,
            color=colour,
            label=f"{name}: cost ~ N^{exponent:.2f}",
        )
    points, seconds = next(iter(series.values()))
    axes.loglog(
        points,
        1e3 * seconds[-1] / points[-1] * np.asarray(points),
        "--",
        color=GREY,
        lw=0.9,
        zorder=1,
        label="proportional to N",
    )
    axes.set(
        xlabel="gridpoints N (–)",
        ylabel="time (ms)",
        title="Cost of time scaling against the gridpoints",
    )
    legend_beside(axes)
    return figure
