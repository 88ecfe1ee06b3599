"""Convergence over several seeds, words on flat curves, units of a sweep's columns, a case's path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from trajopt.errors import ArgumentError
from trajopt.optimize.base import History, OptimizeResult
from trajopt.paths.path import Path
from trajopt.report.convergence_picture import best_of_seeds, convergence_figure, seeds_figure
from trajopt.report.path_picture import path_figure
from trajopt.report.style import telling
from trajopt.report.sweep_case import arrays_figure
from trajopt.report.units import unit_of
from trajopt.solution import Solution


def searched(exact: Solution, counts: list[int], costs: list[float], broken: int) -> OptimizeResult:
    """A search whose first ``broken`` candidates break something."""
    assert exact.search is not None
    n = len(counts)
    violation = np.where(np.arange(n) < broken, 1.0, 0.0)
    history = History(np.array(counts), np.zeros(n), np.array(costs), violation, np.zeros((0, 2)))
    return replace(exact.search, history=history, nfev=counts[-1])


def test_median_and_band_are_those_of_the_best_so_far(exact: Solution) -> None:
    rng = np.random.default_rng(2)
    results = [
        searched(exact, sorted(rng.choice(np.arange(1, 90), 12, replace=False).tolist()),
                 np.sort(rng.random(12))[::-1].tolist(), k % 3)
        for k in range(11)
    ]  # fmt: skip
    counts, best = best_of_seeds(results)
    for i, count in enumerate(counts):
        for k, result in enumerate(results):
            good = (result.history.evaluations <= count) & (result.history.violation == 0)
            assert best[i, k] == np.min(result.history.cost[good], initial=np.inf)
    axes = seeds_figure({"pso": results}).axes[0]
    line = np.asarray(axes.lines[0].get_ydata())
    middle = np.sort(best, axis=1)[:, 5]
    np.testing.assert_array_equal(line[np.isfinite(middle)], middle[np.isfinite(middle)])
    assert np.isnan(line[~np.isfinite(middle)]).all()
    band = axes.collections[0].get_paths()[0].vertices
    for rank in (1, 9):  # the 10th and 90th percentile of eleven
        wanted = np.sort(best, axis=1)[:, rank]
        assert set(wanted[np.isfinite(wanted)]) <= set(band[:, 1])
    with pytest.raises(ArgumentError, match="searches"):
        seeds_figure({})


def test_flat_curves_are_said_in_words(exact: Solution, through_actuators: Solution) -> None:
    assert exact.search is not None
    assert through_actuators.search is not None
    texts = [t.get_text() for t in convergence_figure(exact, exact.search).axes[0].texts]
    assert texts == ["auto finds its answer in one go: nothing converges"]
    assert not convergence_figure(through_actuators, through_actuators.search).axes[0].texts


def test_the_legend_counts_the_explored_points_that_are_drawn(through_actuators: Solution) -> None:
    assert through_actuators.path is not None
    axes = path_figure(through_actuators, through_actuators.path).axes[0]
    labels = [label for label in axes.get_legend_handles_labels()[1] if "explored" in label]
    clouds = [c for c in axes.collections if len(c.get_offsets()) > 1]
    assert len(labels) == len(clouds) == 2
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    for label, cloud in zip(labels, clouds, strict=True):
        x, y = np.asarray(cloud.get_offsets()).T
        assert label.split("(")[1].startswith(f"{len(x)} of ")
        assert np.all((x >= x0) & (x <= x1) & (y >= y0) & (y <= y1))


def test_a_case_shows_its_path_and_not_the_polygon_of_its_points(exact: Solution) -> None:
    points = exact.control_points
    axes = arrays_figure({"control_points": points}, searched=True).axes[0]
    way, dots = axes.lines
    assert dots.get_linestyle() == "None"
    found = np.column_stack(way.get_data())
    path = exact.path
    assert isinstance(path, Path)
    u = np.linspace(path.start, path.end, len(found))
    np.testing.assert_allclose(found, path.position(u)[:, :2], atol=1e-9)
    alone = arrays_figure({"control_points": points}).axes[
        0
    ]  # of a path that was given: any spline
    assert [line.get_linestyle() for line in alone.lines] == ["None"]


def test_the_most_telling_lines_in_their_order() -> None:
    values = np.array([[1.0, -5.0, 0.5, np.nan], [0.0, 1.0, 3.0, 0.1]])
    assert telling(values, 2) == [1, 2]
    assert telling(values) == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("column", "unit"),
    [
        ("obstacles.step.height", "m"), ("ground.friction", "–"), ("limits.speed", "m/s"), ("duration", "s"),
        ("driven.wheel_error.2", "rad"), ("obstacles.0.height", "m"), ("limits.yaw_rate", "rad/s"), ("mine", "as stored"),
    ],
)  # fmt: skip
def test_units_of_columns(column: str, unit: str) -> None:
    assert unit_of(column) == unit
