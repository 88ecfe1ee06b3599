"""Pictures of trials and searches, and the page's tables: what they show follows from the rows they
are given."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from benchmarks.theses import smdw_search_pictures as search_pictures
from benchmarks.theses import smdw_trial_figures, smdw_wheel_figures
from trajopt.problem import load_problem
from trajopt.systems.smdw import pictures as smdw
from trajopt.systems.smdw import trial_pictures as smdw_trials
from trajopt.systems.smdw.climbing import DEFAULT_WHEEL, loc8_smdw
from trajopt.systems.smdw.geometry import meet_step
from trajopt.systems.smdw.planner import plan_climb

FILE = Path(__file__).parents[3] / "problems" / "smdw" / "step_5cm.toml"


def cell(source: str, successes: int, name: str = "lateral") -> smdw_trial_figures.ClimbCell:
    return smdw_trial_figures.ClimbCell("mujoco", 0.05, name, source, successes, 20, (0.0, 0.0))


def test_bars_are_the_shares_and_intervals_hold_them() -> None:
    axes = smdw_trial_figures.climb_rates_figure([cell("exact", 20), cell("uniform", 5)]).axes[0]
    bars = [patch.get_height() for patch in axes.patches]
    assert bars == [1.0, 0.25]
    assert axes.get_title(loc="center") + axes.get_title(loc="left") == "mujoco, step of 5 cm"
    assert [t.get_text() for t in axes.texts] == ["20/20", "5/20"]


def test_a_cell_without_trials_is_named_not_drawn_as_zero() -> None:
    cells = [cell("exact", 20), cell("uniform", 5), cell("exact", 3, "forward35")]
    axes = smdw_trial_figures.climb_rates_figure(cells).axes[0]
    assert len(axes.patches) == 3
    assert [t.get_text() for t in axes.texts] == ["20/20", "5/20", "3/20", "not run"]


def test_the_phase_map_shows_every_share() -> None:
    shares = {("lateral", 0.05): {(8.0, 0.8): [0.0, 1.0], (4.0, 0.5): [0.5, 1.0]}}
    image = smdw_trial_figures.phase_map_figure(shares, [-0.6, 0.6]).axes[0].get_images()[0]
    assert np.array_equal(np.asarray(image.get_array()), [[0.0, 1.0], [0.5, 1.0]])


def test_causes_show_a_share_a_value_and_its_interval() -> None:
    figure = smdw_trial_figures.causes_figure(
        {"gap, cm": {"lateral": {2.0: (20, 20), 5.0: (5, 20)}}}
    )
    line = figure.axes[0].get_lines()[0]
    assert np.asarray(line.get_ydata()) == pytest.approx([1.0, 0.25])
    assert [tick.get_text() for tick in figure.axes[0].get_xticklabels()] == ["2", "5"]


def test_every_ending_is_drawn_in_its_units() -> None:
    errors = np.array([[0.002, 0.0175, 0.03], [0.004, 0.0087, 0.05]])
    figure = smdw_trial_figures.endings_figure(
        {"noiseless": errors}, {"noiseless": (0.005, 0.0087, 0.06)}
    )
    points, bound = figure.axes[0].get_lines()[:2]
    assert np.asarray(points.get_xdata()) == pytest.approx([2.0, 4.0])
    assert np.asarray(bound.get_xdata()) == pytest.approx([5.0, 5.0])


def test_motions_draw_a_line_a_run_and_the_step_where_it_is() -> None:
    pose = np.linspace([0.0, 0.0, 0.0], [1.0, 0.5, -0.6], 20)
    panels = [
        smdw_trials.Motions("planned", [pose, pose], [True, False], pose, 1.4, ""),
        smdw_trials.Motions("no plan, no step", [pose], [True], None, None, ""),
    ]
    with_step, without = smdw_trials.motions_figure(panels, loc8_smdw()).axes[:2]
    assert [len(ways.get_segments()) for ways in with_step.collections] == [1, 1]
    assert [len(ways.get_segments()) for ways in without.collections] == [0, 1]
    assert len(with_step.get_lines()) - len(without.get_lines()) == 1  # the plan
    assert with_step.get_xlim()[1] > 1.4
    assert (
        len(with_step.patches) - len(without.patches) == 5
    )  # two more robots (outline and nose), the step


def test_searches_and_costs_draw_a_line_a_run() -> None:
    pose = np.linspace([0.0, 0.0], [1.0, 0.5], 20)
    searches = search_pictures.searches_figure([("PSO", [("1 s", pose)])], np.array([1.0, 0.5]))
    assert len(searches.axes[0].get_lines()) == 2  # and the goal
    costs = search_pictures.costs_figure(
        [("scenario 1", [(np.arange(3.0), np.array([3.0, 1.0, 0.0]))] * 2)]
    )
    assert np.asarray(costs.axes[0].get_lines()[0].get_ydata())[:2].tolist() == [3.0, 1.0]


def test_swarms_and_cost_maps_show_what_they_are_given() -> None:
    path, places = np.linspace([0.0, 0.0], [1.0, 0.5], 20), np.array([[0.1, 0.2], [5.0, 5.0]])
    swarm = search_pictures.SwarmSearch("one", places, path, path[10])
    axes = search_pictures.swarms_figure(
        [swarm], ((0.0, 1.0), (0.0, 1.0)), ((-1.0, 2.0), (-1.0, 2.0))
    ).axes[0]
    assert np.asarray(axes.get_lines()[0].get_xdata()) == pytest.approx([0.1, 5.0])
    assert axes.get_xlim() == (-1.0, 2.0)
    cost = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    shown = search_pictures.CostMap(
        "map", np.arange(3.0), np.arange(2.0), cost, np.array([[1.0, 0.5]])
    )
    mesh = search_pictures.cost_maps_figure([shown]).axes[0].collections[0]
    assert np.asarray(mesh.get_array()).ravel() == pytest.approx(cost.ravel())


def test_figure_6_9_stands_the_step_at_the_highest_that_the_hub_clears() -> None:
    theta, alpha = math.radians(-30), math.radians(-35)
    top = smdw_wheel_figures.clearance_at(DEFAULT_WHEEL, theta, alpha)
    assert float(meet_step(DEFAULT_WHEEL, theta, alpha, top).clearance) >= top
    assert float(meet_step(DEFAULT_WHEEL, theta, alpha, top + 1e-3).clearance) < top + 1e-3
    axes = smdw_wheel_figures.wheel_at_step_figure(DEFAULT_WHEEL, alpha, theta, 0.035).axes
    assert f"{100 * top:.1f} cm" in axes[0].get_title(loc="left") + axes[0].get_title()
    assert axes[1].get_lines()[-1].get_ydata() == pytest.approx(
        100 * float(meet_step(DEFAULT_WHEEL, theta, alpha, 0.035).clearance)
    )


def test_a_folder_of_plans_gets_its_overview(tmp_path: Path) -> None:
    made = smdw.save_maneuver_pictures(plan_climb(load_problem(FILE)), tmp_path)
    assert [file.name for file in made] == ["plans.png", "geometry.png"]
    assert all(file.stat().st_size > 20_000 for file in made)
