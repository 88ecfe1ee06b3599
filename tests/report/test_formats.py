"""Every figure function: PNG, PDF and SVG, one style, units on every axis, at most eight lines a plot."""

from __future__ import annotations

import ast
import io
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.image import imread

from benchmarks.figure_examples import FIGURES
from trajopt.errors import ArgumentError
from trajopt.report import style
from trajopt.report.style import MOST_LINES, in_style, new_figure, plain_powers, save_figure

ROOT = Path(__file__).parents[2]
START = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}
# Those that only put another figure's data together, or take minutes; and the empty one.
OTHERS = {"first_sub_test", "second_sub_test", "searches", "new_figure", "plain_powers"}
UNIT = re.compile(r"\((–|%|deg|c?m|mm|m?s|N|N m|J|m?rad|m/s|rad/s|as stored)\)")
PALETTE = {
    *style.LINE_COLOURS, *style.LIMIT_COLOURS.values(), style.LIGHT, style.BROWN, style.YELLOW, "#ffffff", "#ff0000",
}  # fmt: skip


def test_every_figure_function_has_an_example() -> None:
    found = set()
    for folder in ("trajopt", "benchmarks"):
        for file in (ROOT / folder).rglob("*.py"):
            if file.name == "figure_examples.py":
                continue
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                    found |= {node.name} if node.returns and ast.unparse(node.returns) == "Figure" else set()  # fmt: skip
    assert found - OTHERS == {name.split()[0] for name in FIGURES}


@pytest.mark.parametrize("name", FIGURES)
def test_one_hand(name: str) -> None:
    with in_style():
        figure = plain_powers(FIGURES[name]())
        written = {}
        for kind, start in START.items():
            file = io.BytesIO()
            figure.savefig(file, format=kind, dpi=70)
            figure.set_layout_engine("none")  # laid out once
            written[kind] = file.getvalue()
            assert written[kind].startswith(start)
    pixels = np.asarray(imread(io.BytesIO(written["png"])))[..., :3]
    assert pixels.std() > 0.04  # a blank page has 0
    assert b"mathdefault" not in written["svg"]
    for axes in figure.axes:
        if axes.axison and axes.get_visible():
            check_axes(figure, axes)


def check_axes(figure: Figure, axes: Axes) -> None:
    for axis, word in ((axes.xaxis, figure.get_supxlabel()), (axes.yaxis, figure.get_supylabel())):
        family = axes.get_shared_x_axes() if axis is axes.xaxis else axes.get_shared_y_axes()
        labels = [
            (other.xaxis if axis is axes.xaxis else other.yaxis).get_label_text()
            for other in family.get_siblings(axes)
        ]
        shown = [label.get_text() for label in axis.get_ticklabels() if label.get_visible()]
        numbers = [text for text in shown if re.fullmatch(r"[−+\-]?[\d.]+( ?%)?", text)]
        if numbers and axis.get_visible():
            assert UNIT.search(word + " ".join(labels)), (axes.get_title(loc="left"), labels)
    drawn = [line for line in axes.lines if len(line.get_xdata()) > 2 and line.get_linestyle() != "None"]  # fmt: skip
    assert len(drawn) <= MOST_LINES
    for line in axes.lines:
        ordered = to_hex(line.get_color()) not in {colour.lower() for colour in PALETTE}
        assert not ordered or axes.get_legend() is not None, line.get_color()  # of a colour map
    sizes = {text.get_fontsize() for text in axes.texts} | {axes.xaxis.label.get_fontsize()}
    assert min(sizes) >= 6.0
    assert max(sizes) <= 10.0


def test_other_suffixes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"a\.jpg.*\.png, \.pdf or \.svg"):
        save_figure(new_figure(2.0), tmp_path / "a.jpg")
