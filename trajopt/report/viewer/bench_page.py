"""The page of a comparison of optimizers: the curves of its figures and the tables of its report."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from trajopt.report.viewer.pages import packed, write_page

_DASHES = {"-": [], "--": [5, 3], ":": [1.5, 2.5]}


def write_bench_page(
    file: FilePath, about: str, figures: Iterable[Figure], sections: Mapping[str, list[str]]
) -> FilePath:
    """Write the page of figures of step curves and of sections in Markdown; its path."""
    charts = [chart for figure in figures for chart in _charts(figure)]
    data = {"title": "Optimizers compared", "about": about, "charts": charts, "sections": sections}
    return write_page("bench", data, file)


def _charts(figure: Figure) -> list[dict[str, Any]]:
    """The curves of each panel as they are drawn, labels and colours too."""
    shared = figure.get_supxlabel()
    found = []
    for axes in figure.axes:
        lines = [
            {
                "name": str(line.get_label()),
                "x": packed(np.asarray(line.get_xdata())),
                "y": packed(np.asarray(line.get_ydata())),
                "colour": to_hex(line.get_color()),
                "dash": _DASHES.get(str(line.get_linestyle()), []),
            }
            for line in axes.lines
        ]
        if lines:
            title = axes.get_title().replace("\n", ", ") or axes.get_title("left").replace(
                "\n", ", "
            )
            found.append(
                {
                    "title": title or axes.get_ylabel() or figure.axes[0].get_ylabel(),
                    "xlabel": axes.get_xlabel() or shared,
                    "log": axes.get_xscale() == "log",
                    "lines": lines,
                }
            )
    return found
