"""Pictures of platforms and the quick pages of the benchmark."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.theses.asoc_pictures import (
    curve_figure,
    front_figure,
    map_figure,
    speed_figure,
    tracks_figure,
)
from benchmarks.theses.asoc_tables import mobility, table_5
from benchmarks.theses.asoc_tables_tracking import QUICK, difference, interval
from benchmarks.theses.textbook import TEXTBOOK
from trajopt.errors import ArgumentError
from trajopt.report.robot_picture import robot_figure
from trajopt.report.style import save_figure
from trajopt.robots.mobility import steering_for


@pytest.mark.parametrize("name", list(TEXTBOOK))
def test_every_platform_can_be_drawn_with_its_centre(name, tmp_path) -> None:
    platform = TEXTBOOK[name]
    twist = [0.5, 0.0, 0.6]
    figure = robot_figure(platform, steering=steering_for(platform, twist), twist=twist)
    assert save_figure(figure, tmp_path / "a.png").stat().st_size > 5000
    marks = [line for line in figure.axes[0].lines if line.get_marker() == "o"]
    assert [float(marks[0].get_xdata()[0]), float(marks[0].get_ydata()[0])] == pytest.approx(
        [0.0, 0.5 / 0.6]
    )
    straight = robot_figure(platform, twist=[1.0, 0.0, 0.0])
    assert any("infinity" in text.get_text() for text in straight.axes[0].texts)


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(ArgumentError):
        robot_figure(TEXTBOOK["bicycle"], steering=[0.0])
    with pytest.raises(ArgumentError):
        robot_figure(TEXTBOOK["bicycle"], twist=[0.0])


def test_figures_hold_what_they_are_given() -> None:
    x = np.linspace(1, 2, 5)
    assert len(curve_figure(x, x / 2, {1.0: 0.5}, ("t", "x", "y")).axes[0].lines) == 2
    assert (
        map_figure(x, x, np.full((5, 5), 0.5), ("t", "x", "y"), (x, x)).axes[0].get_title() == "t"
    )
    assert len(tracks_figure(np.zeros((2, 2)), [("a", np.zeros((3, 2)))], "t").axes[0].lines) == 2
    assert len(speed_figure([("a", x, x)], 1.5, "t").axes[0].lines) == 3
    assert len(front_figure(np.ones((4, 3)), ["K", "d_max", "S"], np.ones(3)).axes) == 2


def test_pages_of_the_benchmark() -> None:
    assert ("bicycle", "1", "1", "2") in mobility().rows
    assert len(table_5().rows) == 8
    assert interval([0.1, 0.2, 0.3]) == "20.00 +- 24.84"
    assert difference([0.1, 0.1, 0.1], [0.2, 0.2, 0.2]) == ("+10.000 +- 0.000", "smaller")
    assert difference([0.1, 0.2, 0.3], [0.3, 0.2, 0.1])[1] == "no difference seen"
    assert QUICK.seeds in (3, 10)
