"""Pictures are drawn for every kind of result, show something, and keep matplotlib's settings as
they were."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.image import imread

from trajopt.errors import ArgumentError
from trajopt.optimize.base import History, Status
from trajopt.report.convergence_picture import convergence_figure
from trajopt.report.motion import limit_use
from trajopt.report.path_picture import path_figure
from trajopt.report.pictures import save_physics_picture, save_pictures
from trajopt.report.profile_picture import band_times, profile_figure
from trajopt.simulate.check import ValidationReport
from trajopt.solution import Solution


def assert_shows_something(file: Path) -> None:
    pixels = np.asarray(imread(file))[..., :3]
    assert min(pixels.shape[:2]) > 300
    assert pixels.std() > 0.04  # a blank page has 0
    border = np.concatenate(
        [pixels[:4].ravel(), pixels[-4:].ravel(), pixels[:, :4].ravel(), pixels[:, -4:].ravel()]
    )
    assert border.min() > 0.99  # nothing is cut off at the edge


@pytest.mark.parametrize("name", ["exact", "through_actuators", "violated", "without_motion"])
def test_every_kind_of_result_has_its_pictures(
    name: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    solution: Solution = request.getfixturevalue(name)
    before = dict(mpl.rcParams)
    files = save_pictures(solution, tmp_path)
    expected = {"path.png", "convergence.png"} | (
        {"profile.png", "loads.png"} if solution.trajectory is not None else set()
    )
    assert {file.name for file in files} == expected == {file.name for file in tmp_path.iterdir()}
    for file in files:
        assert_shows_something(file)
    assert dict(mpl.rcParams) == before


def test_physics_and_engine_pictures(
    exact: Solution, drifted: ValidationReport, tmp_path: Path
) -> None:
    files = save_physics_picture(exact, drifted, tmp_path)
    assert [file.name for file in files] == ["physics.png", "engine.png"]
    assert_shows_something(files[0])
    shown = np.round(255 * np.asarray(imread(files[1]))[..., :3]).astype(np.uint8)
    np.testing.assert_array_equal(shown, drifted.recording.picture)


def test_without_an_engine_picture_there_is_none(
    exact: Solution, drifted: ValidationReport, tmp_path: Path
) -> None:
    plain = replace(drifted, recording=replace(drifted.recording, picture=None))
    assert [file.name for file in save_physics_picture(exact, plain, tmp_path)] == ["physics.png"]


def test_physics_picture_needs_a_trajectory(
    without_motion: Solution, drifted: ValidationReport, tmp_path: Path
) -> None:
    with pytest.raises(ArgumentError, match="trajectory"):
        save_physics_picture(without_motion, drifted, tmp_path)


@pytest.mark.parametrize(
    ("cost", "violation"),
    [
        ([], []),
        ([1e-15], [0.0]),
        ([0.0], [0.0]),
        ([2.0, 1.9], [0.0, 0.0]),
        ([3.0, 1e-9], [0.0, 0.0]),
        ([5.0, 7.0], [0.4, 0.0]),
        ([5.0, 4.0], [0.4, 0.2]),
        ([np.inf, 1.0], [np.inf, 0.0]),
    ],
)
def test_convergence_of_any_history(
    cost: list[float], violation: list[float], exact: Solution, tmp_path: Path
) -> None:
    n = len(cost)
    history = History(
        np.arange(1, n + 1) * 3,
        np.linspace(0, 1, n),
        np.array(cost),
        np.array(violation),
        np.zeros((0, 2)),
    )
    search = replace(
        exact.search,
        history=history,
        nfev=max(3 * n, 1),
        fun=cost[-1] if n else np.inf,
        violation=violation[-1] if n else np.inf,
        status=Status.CONVERGED if n else Status.FAILED,
    )
    solution = replace(exact, search=search)
    file = tmp_path / "convergence.png"
    assert solution.search is not None
    figure = convergence_figure(solution, solution.search)
    figure.savefig(file)
    broken = n == 0 or any(v > 1e-9 for v in violation)
    assert len(figure.axes) == (2 if broken else 1)


def test_bands_are_the_active_stretches(exact: Solution) -> None:
    trajectory = exact.trajectory
    assert trajectory is not None
    bands = band_times(trajectory)
    assert [name for *_, name in bands] == [part.limit for part in trajectory.active]
    assert all(0.0 <= first < last <= trajectory.duration for first, last, _ in bands)
    for (first, last, _), part in zip(bands, trajectory.active, strict=True):
        np.testing.assert_allclose(
            trajectory.along([first, last])[0], [part.start, part.end], atol=1e-9
        )


@pytest.mark.parametrize("name", ["exact", "through_actuators"])
def test_use_of_limits_is_one_minus_the_margin(name: str, request: pytest.FixtureRequest) -> None:
    trajectory = request.getfixturevalue(name).trajectory
    times, used = limit_use(trajectory)
    assert np.all(
        (times[1:-1] >= trajectory.times[:-1, None]) & (times[1:-1] <= trajectory.times[1:, None])
    )
    for k, (limit, margin) in enumerate(trajectory.margins().items()):
        # Margins come from a finer grid; a knot or a peak between the three places read may add a
        # little.
        assert used[:, k].max() == pytest.approx(1 - margin, rel=0.02), limit
        assert used[:, k].max() <= 1 - margin + 1e-6


def test_profile_marks_broken_limits(through_actuators: Solution) -> None:
    assert through_actuators.trajectory is not None
    figure = profile_figure(through_actuators, through_actuators.trajectory)
    assert "broken" in figure.legends[0].get_title().get_text()


def test_what_stands_there_is_drawn_and_where_the_outline_crosses_it(exact: Solution) -> None:
    assert exact.path is not None
    labels = path_figure(exact, exact.path).axes[0].get_legend_handles_labels()[1]
    assert "step, 0.05 m high" in labels
    assert not any("crosses" in label for label in labels)
    crossing = replace(exact, problem=exact.problem.replace({"obstacles.step.place": [1.0, 0.0]}))
    labels = path_figure(crossing, exact.path).axes[0].get_legend_handles_labels()[1]
    assert any("crosses" in label for label in labels)
    flat = replace(exact, problem=exact.problem.replace({"obstacles": None}))
    labels = path_figure(flat, exact.path).axes[0].get_legend_handles_labels()[1]
    assert not any("step" in label for label in labels)
