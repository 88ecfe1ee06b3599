"""Pictures of trials: what they show follows from the rows they are given."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from trajopt.maneuver import plan_climb
from trajopt.maneuver_problem import load_maneuver
from trajopt.report.smdw import save_maneuver_pictures
from trajopt.report.smdw_trials import (
    ClimbCell,
    Motions,
    climb_rates_figure,
    costs_figure,
    endings_figure,
    motions_figure,
    phase_map_figure,
    searches_figure,
)
from trajopt.robots.smdw import loc8_smdw

FILE = Path(__file__).parents[2] / "problems" / "smdw" / "step_5cm.toml"


def test_bars_are_the_shares_and_intervals_hold_them() -> None:
    cells = [ClimbCell("mujoco", 0.05, "lateral", source, k, 20, (0.0, 0.0))
             for source, k in (("exact", 20), ("uniform", 5))]
    axes = climb_rates_figure(cells).axes[0]
    bars = [patch.get_height() for patch in axes.patches]
    assert bars == [1.0, 0.25]
    assert axes.get_title(loc="center") + axes.get_title(loc="left") == "mujoco, 5 cm"


def test_the_phase_map_shows_every_share() -> None:
    shares = {("lateral", 0.05): {(8.0, 0.8): [0.0, 1.0], (4.0, 0.5): [0.5, 1.0]}}
    image = phase_map_figure(shares, [-0.6, 0.6]).axes[0].get_images()[0]
    assert np.array_equal(np.asarray(image.get_array()), [[0.0, 1.0], [0.5, 1.0]])


def test_every_ending_is_drawn_in_its_units() -> None:
    errors = np.array([[0.002, 0.0175, 0.03], [0.004, 0.0087, 0.05]])
    figure = endings_figure({"noiseless": errors}, {"noiseless": (0.005, 0.0087, 0.06)})
    drawn = figure.axes[0].get_lines()[0].get_ydata()
    assert np.asarray(drawn) == pytest.approx([2.0, 4.0])
    assert np.asarray(figure.axes[0].get_lines()[1].get_ydata()) == pytest.approx([5.0, 5.0])


def test_motions_searches_and_costs_draw_a_line_a_run() -> None:
    pose = np.linspace([0.0, 0.0, 0.0], [1.0, 0.5, -0.6], 20)
    motions = motions_figure([Motions("one", [pose, pose], [True, False], pose[-1], 1.4, "")], loc8_smdw())
    assert len(motions.axes[0].get_lines()) == 2
    searches = searches_figure([("PSO", [("1 s", pose[:, :2])])], np.array([1.0, 0.5]))
    assert len(searches.axes[0].get_lines()) == 2  # and the goal
    costs = costs_figure([("scenario 1", [(np.arange(3.0), np.array([3.0, 1.0, 0.0]))] * 2)])
    assert len(costs.axes[0].get_lines()) == 2


def test_a_folder_of_plans_gets_its_overview(tmp_path: Path) -> None:
    made = save_maneuver_pictures(plan_climb(load_maneuver(FILE)), tmp_path)
    assert [file.name for file in made] == ["plans.png", "geometry.png"]
    assert all(file.stat().st_size > 20_000 for file in made)
