"""Pictures of the climb rate study (problems/sweeps/climb_rate.toml): shares of trials with both
leading wheels up.

Shares come with Wilson's 95 % interval. Trials that left physics are left out, and counted in the
title.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trajopt.errors import ArgumentError
from trajopt.report.intervals import wilson
from trajopt.report.style import BLUE, GREEN, VERMILION, legend_beside, new_figure

if TYPE_CHECKING:
    import pandas as pd

_COLOURS = (BLUE, VERMILION, GREEN)
_NEEDED = (
    "configuration",
    "obstacles.step.height",
    "friction",
    "heading_error",
    "torque",
    "climbed",
    "status",
)
_DARK = 0.55  # share from which a cell's text is white; chosen for the colour map


def rate_maps(frame: pd.DataFrame) -> Figure:
    """Heat maps of the climb rate over step height and friction, one a configuration, all else
    averaged over.

    ``frame`` is the study's table. Raises ArgumentError for a table without its columns or without
    finished trials.
    """
    rows, exploded = _sound(frame)
    names = _configurations(rows)
    figure = new_figure(2.9)
    heights, frictions = (sorted(set(rows[name])) for name in ("obstacles.step.height", "friction"))
    panels: Sequence[Axes] = figure.subplots(1, len(names), squeeze=False, sharey=True)[0]
    for axes, name in zip(panels, names, strict=True):
        here = rows[rows["configuration"] == name]
        cells = here.pivot_table(
            index="obstacles.step.height", columns="friction", values="climbed", aggfunc="mean"
        )
        cells = cells.reindex(
            index=heights, columns=frictions
        )  # the same grid in all panels, also half-way
        image = axes.imshow(
            cells.to_numpy(), origin="lower", aspect="auto", cmap="cividis_r", vmin=0.0, vmax=1.0
        )
        for (i, j), share in np.ndenumerate(cells.to_numpy()):
            if math.isfinite(share):
                axes.text(
                    j,
                    i,
                    f"{100 * share:.0f}",
                    ha="center",
                    va="center",
                    fontsize=8.5,
                    color="white" if share > _DARK else "black",
                )
        axes.set_xticks(range(len(frictions)), [f"{v:g}" for v in frictions])
        axes.set_yticks(range(len(heights)), [f"{100 * v:g}" for v in heights])
        axes.grid(visible=False)
        axes.set_title(name)
        axes.set_xlabel("friction (–)")
    panels[0].set_ylabel("step height (cm)")
    figure.colorbar(
        image, ax=list(panels), label="climb rate (%)", format=lambda v, _: f"{100 * v:.0f}"
    )
    each = len(rows) / max(
        1, len(rows.groupby(["configuration", "obstacles.step.height", "friction"]))
    )
    figure.suptitle(
        f"Climb rate in % over step height and friction: {len(rows)} trials, about {each:.0f} a cell"
        + (f"; {exploded} left physics" if exploded else ""),
        fontsize=9.5,
    )
    return figure


def rate_lines(frame: pd.DataFrame) -> Figure:
    """Climb rate over heading error and over wheel torque with 95 % intervals, a line a
    configuration.

    ``frame`` and errors as in ``rate_maps``.
    """
    rows, _ = _sound(frame)
    figure = new_figure(2.8)
    left, right = figure.subplots(1, 2, sharey=True)
    for colour, name in zip(_COLOURS, _configurations(rows), strict=False):
        here = rows[rows["configuration"] == name]
        _line(
            left,
            np.degrees(here["heading_error"].to_numpy(dtype=float)).round(1),
            here["climbed"],
            colour,
            name,
        )
        _line(right, here["torque"].to_numpy(dtype=float), here["climbed"], colour, name)
    left.set_xlabel("heading error (deg)")
    left.set_ylabel("climb rate (%)")
    left.set_ylim(0.0, 1.02)
    left.yaxis.set_major_formatter(lambda v, _: f"{100 * v:.0f}")
    right.set_xlabel("wheel torque (N m)")
    right.set_xscale("log", base=2)
    torques = sorted(set(rows["torque"]))
    right.set_xticks(torques, [f"{t:g}" for t in torques])
    right.minorticks_off()
    legend_beside(right)
    return figure


def _line(axes: Axes, places: np.ndarray, climbed: pd.Series, colour: str, name: str) -> None:
    values = climbed.to_numpy(dtype=float)
    found = np.unique(places)
    counts = [(int(values[places == p].sum()), int((places == p).sum())) for p in found]
    spans = np.array([wilson(k, n) for k, n in counts])
    axes.plot(
        found, [k / n for k, n in counts], marker="o", markersize=3.5, color=colour, label=name
    )
    axes.fill_between(found, spans[:, 0], spans[:, 1], color=colour, alpha=0.2, linewidth=0)


def _sound(frame: pd.DataFrame) -> tuple[pd.DataFrame, int]:
    """Finished trials that stayed physical, and how many did not."""
    lacking = [name for name in _NEEDED if name not in frame.columns]
    if lacking:
        raise ArgumentError(
            "frame", lacking, "a table of problems/sweeps/climb_rate.toml with these columns"
        )
    done = frame[frame["status"] == "done"]
    rows = done.dropna(subset=["climbed"])
    if rows.empty:
        raise ArgumentError("frame", len(frame), "at least one finished trial")
    return rows.assign(climbed=rows["climbed"].astype(float)), len(done) - len(rows)


def _configurations(rows: pd.DataFrame) -> list[str]:
    """Lateral first, then forward by angle."""
    return sorted(
        {str(n) for n in rows["configuration"]}, key=lambda n: (n.startswith("forward"), n)
    )
