"""One look for all pictures: colours that colour-blind readers can tell apart, thin axes, SI units.

The colours are those of [okabe2008].
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path as FilePath
from types import MappingProxyType
from typing import Any

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imsave
from matplotlib.ticker import FuncFormatter, LogFormatter, NullFormatter

from trajopt.arrays import AnyArray, Array
from trajopt.errors import ArgumentError
from trajopt.files import whole_file
from trajopt.report.files import FORMATS

BLACK, GREY, LIGHT = "#000000", "#6b6b6b", "#c9c9c9"
ORANGE, SKY, GREEN, YELLOW = "#E69F00", "#56B4E9", "#009E73", "#F0E442"
BLUE, VERMILION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
BROWN = "#a08060"  # chosen: contour lines

MOST_LINES = 8  # of a plot, chosen: as many as colours that can be told apart
LINE_COLOURS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK, GREY)

# Wheels in the order of every per-wheel array: colour tells left from right, the dash front from
# rear, and further pairs from these.
WHEEL_COLOURS = (BLUE, VERMILION) * 4
WHEEL_DASHES: tuple[Any, ...] = (
    *("-", "-", (0, (4, 1.5)), (0, (4, 1.5))),
    *(":", ":", (0, (4, 1.5, 1, 1.5)), (0, (4, 1.5, 1, 1.5))),
)

LIMIT_COLOURS: Mapping[str, str] = MappingProxyType(
    {
        "speed": BLUE,
        "acceleration": ORANGE,
        "wheel_speed": GREEN,
        "wheel_acceleration": PURPLE,
        "slip": VERMILION,
        "tip": BLACK,
        "yaw_rate": SKY,
        "speed_profile": YELLOW,
        "speed_zones": YELLOW,
        "steering_rate": "#5e3c99",  # chosen: two violets that the rest has not
        "steering_acceleration": "#b2abd2",
        "contact": GREY,
        "wheel_torque": "#8c510a",  # chosen: two browns
        "motor_curve": "#bf812d",
    }
)
_SPARE = (YELLOW, SKY, GREEN, PURPLE)  # for limits that are not listed

RESOLUTION = 160  # dots an inch, chosen: sharp on a screen, 1100 pixels for a full-width figure
WIDTH = 7.0  # inch, the text width of a report

_RC: Any = {
    "figure.dpi": RESOLUTION,
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.linewidth": 0.7,
    "axes.edgecolor": GREY,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#ececec",
    "grid.linewidth": 0.6,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": BLACK,
    "ytick.labelcolor": BLACK,
    "lines.linewidth": 1.4,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "legend.handlelength": 2.0,
    "savefig.facecolor": "white",
    "axes.prop_cycle": cycler(color=LINE_COLOURS),
    "image.cmap": "viridis",
    "text.parse_math": False,  # titles and names are the user's: a "$" in them is one
}


def in_style() -> Any:
    """Context in which figures are drawn and saved; matplotlib's settings are as before
    afterwards."""
    return mpl.rc_context(_RC)


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """Empty figure (inches) whose parts are laid out without overlap; needs no display."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def plain_powers(figure: Figure) -> Figure:
    """The figure with powers of ten in plain text on its logarithmic axes: mathematics is not parsed in its texts."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if axis.get_scale() == "log" and isinstance(axis.get_major_formatter(), LogFormatter):
                low, high = sorted(axis.get_view_interval())
                axis.set_major_formatter(FuncFormatter(_power))
                axis.set_minor_formatter(
                    NullFormatter() if high > 10.0 * low else FuncFormatter(_power)
                )
    return figure


def _power(value: float, _: int | None) -> str:
    power = round(np.log10(value)) if value > 0 else 0
    if 1e-3 < value < 1e4 or not np.isclose(value, 10.0**power, rtol=1e-9, atol=0.0):
        return f"{value:g}"
    return "10" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


_PAD = 0.1  # inches of white around what is drawn; chosen


def save_figure(figure: Figure, file: FilePath) -> FilePath:
    """Write a picture, PNG, PDF or SVG by its suffix, whole or not at all. Returns ``file``.

    Raises ArgumentError for another suffix.
    """
    kind = file.suffix.lower().lstrip(".")
    if kind not in FORMATS:
        raise ArgumentError("file", str(file), "a name that ends in .png, .pdf or .svg")
    plain_powers(figure)
    picture = _drawn(figure) if kind == "png" else None
    with whole_file(file) as part:
        if picture is None:
            figure.savefig(part, format=kind, dpi=RESOLUTION, bbox_inches="tight", pad_inches=_PAD)
        else:
            imsave(part, picture, format=kind, dpi=RESOLUTION)
    return file


def _drawn(figure: Figure) -> AnyArray | None:
    """Pixels (H, W, 4) of what a figure shows with ``_PAD`` around it: drawn once, where ``savefig``
    draws twice and measures in between. None where something reaches beyond the figure."""
    figure.dpi = RESOLUTION
    figure.set_facecolor("white")
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    parts: list[Any] = list(figure.axes)
    titles = [title for axes in parts for title in (axes.title, axes._left_title)]
    reach = [title.get_window_extent(canvas.get_renderer()) for title in titles]
    pixels = np.asarray(canvas.buffer_rgba())
    inked = np.asarray(np.min(pixels[..., :3], axis=2) < 255)
    edges = (inked[:2], inked[-2:], inked[:, :2], inked[:, -2:])
    if (
        any(edge.any() for edge in edges)
        or any(box.x1 > figure.bbox.x1 for box in reach)
        or not inked.any()
    ):
        return None
    rows, columns = np.flatnonzero(inked.any(axis=1)), np.flatnonzero(inked.any(axis=0))
    pad = round(_PAD * RESOLUTION)
    high, wide = (
        slice(max(int(ink[0]) - pad, 0), int(ink[-1]) + 1 + pad) for ink in (rows, columns)
    )
    return np.ascontiguousarray(pixels[high, wide])


def telling(values: Array, most: int = MOST_LINES) -> list[int]:
    """Columns of (N, K) that reach furthest from 0, ``most`` at most, in their order; what is not finite does not
    count."""
    reach = np.nan_to_num(np.abs(values), nan=0.0, posinf=0.0).max(axis=0, initial=0.0)
    return sorted(np.argsort(-reach, kind="stable")[:most].tolist())


def first_in_front(axes: Axes) -> None:
    """Lines that were drawn earlier lie over later ones: the subject comes first."""
    for k, line in enumerate(axes.lines):
        line.set_zorder(2.0 + 0.9 * (1.0 - k / len(axes.lines)))


def limit_colour(name: str, index: int) -> str:
    """Colour of a limit; ``index`` is its place among the limits used together."""
    return LIMIT_COLOURS.get(name, _SPARE[index % len(_SPARE)])


def legend_beside(axes: Axes, **options: Any) -> None:
    """Legend to the right of the axes, where it covers nothing; nothing for axes without labels."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        axes.legend(
            handles,
            labels,
            loc="upper left",
            bbox_to_anchor=(1.0, 1.02),
            borderaxespad=0.2,
            **options,
        )
