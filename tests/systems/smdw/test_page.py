"""The reproduction page: tables that follow from trials, printed states as they are, every picture
in its place."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from benchmarks.theses import (
    closed_loop,
    smdw_counts,
    smdw_figures,
    smdw_page,
    smdw_printed,
    smdw_searches,
)
from benchmarks.theses.smdw_study import terminal_cost
from benchmarks.theses.smdw_trial_figures import ClimbCell

EXACT, PSO, UNIFORM = smdw_counts.SOURCE_NAMES.values()


def cells(counts: dict[tuple[str, str], int]) -> list[ClimbCell]:
    return [
        ClimbCell("mujoco", 0.05, name, source, k, 20, None) for (name, source), k in counts.items()
    ]


def test_the_headline_pools_forward_and_names_what_was_not_run() -> None:
    table = smdw_counts.headline(
        cells(
            {
                ("lateral", EXACT): 19,
                ("forward35", EXACT): 20,
                ("forward45", EXACT): 15,
                ("forward35", UNIFORM): 3,
            }
        )
    )
    lateral, forward = table.rows
    assert lateral[:3] == ("mujoco", "5", "lateral")
    assert lateral[3].startswith("19/20 (")
    assert lateral[4] == lateral[5] == "not run"
    assert forward[3].startswith("35/40 (")
    assert forward[5].startswith("3/20 (")
    assert forward[-1] == "10-11/20"


def test_an_order_is_claimed_only_where_intervals_are_apart() -> None:
    assert smdw_counts.ordered({"a": (2, 20), "b": (20, 20), "c": (19, 20)}) == "b ~ c > a"
    assert smdw_counts.ordered({"a": (10, 10), "b": (20, 20)}) == "a = b"
    assert smdw_counts.ordered({}) == "not run"


def test_the_reading_names_the_lines_in_which_planners_differ() -> None:
    text = smdw_counts.reading(
        cells(
            {
                ("lateral", EXACT): 20,
                ("lateral", PSO): 19,
                ("lateral", UNIFORM): 5,
                ("forward35", EXACT): 20,
                ("forward35", UNIFORM): 20,
            }
        )
    )
    assert f'"{PSO}" are apart in no line, of 1.' in text
    assert f'"{UNIFORM}" are apart in mujoco, 5 cm, lateral (20/20 against 5/20), of 2.' in text


def test_phase_decides_where_some_phases_climb(monkeypatch: pytest.MonkeyPatch) -> None:
    def row(torque: str, phase: str, up: bool) -> dict[str, str]:
        return {
            "engine": "mujoco",
            "configuration": "lateral",
            "height": "0.05",
            "torque": torque,
            "friction": "0.8",
            "source": phase,
            "critical_up": str(up),
        }

    rows = [row("8.0", p, True) for p in ("-0.60", "+0.60")] + [
        row("2.0", p, False) for p in ("-0.60", "+0.60")
    ]
    rows += [row("4.0", "-0.60", up) for up in (True, True, False)] + [row("4.0", "+0.60", False)]
    monkeypatch.setattr(smdw_figures, "trial_rows", {"phases": rows}.__getitem__)
    (found,) = smdw_counts.regimes(["mujoco", "pybullet"]).rows
    assert found == ("mujoco", "lateral", "5", "8 N m, 0.8", "4 N m, 0.8 (1 of 2)", "2 N m, 0.8")
    drawn = smdw_figures.phase_map("mujoco")
    assert drawn is not None
    image = drawn.axes[0].get_images()[0]
    assert np.asarray(image.get_array()) == pytest.approx(np.array([[0, 0], [2 / 3, 0], [1, 1]]))
    assert smdw_figures.phase_map("pybullet") is None


def test_printed_states_keep_pose_and_phase_along_the_rotation() -> None:
    groups = list(smdw_printed.groups())
    assert len(groups) == 8
    assert all(len(g.climbs) == 10 for g in groups)
    lateral = groups[0].climbs[0]
    assert lateral.pose == (2.4113, 0.5327, -1.5152)
    assert lateral.critical == (0, 2)
    # Wheel 1 turns forwards in the thesis's lateral motion, backwards in right-handed axes: 5.0285
    # rad along the way.
    assert lateral.wheels == pytest.approx((-5.0285, -4.7747, -1.1989, -2.4351))
    forward = next(g for g in groups if g.configuration == "forward -35 deg").climbs[0]
    assert forward.wheels == pytest.approx((0.6086, 1.7219, 2.0687, 6.1932))
    turned, near = (g for g in groups if g.yaw != "as printed")
    assert {c.pose[2] for c in (*turned.climbs, *near.climbs)} == {-math.pi / 2}
    assert turned.height == near.height == 0.035
    left = np.array([[0.376, 0.316], [-0.376, 0.316]])  # wheel centres, m
    for as_printed, moved in zip(groups[1].climbs, near.climbs, strict=True):
        foremost = [
            c.pose[0] + float((left @ [math.cos(c.pose[2]), -math.sin(c.pose[2])]).max())
            for c in (as_printed, moved)
        ]
        assert foremost[0] == pytest.approx(foremost[1], abs=1e-9)


def test_the_first_swarm_counts_all_four_wheels_with_the_gains_of_table_5_2() -> None:
    objective, fixed = smdw_searches.first_objective()
    values = smdw_searches.first_values(fixed, np.array([[1.2, -0.4, 1.0]]))
    assert values[0] == pytest.approx([0.5, -0.5, 1.2, -0.4, (1.5708 - 0.3927) / 3, 1.0])
    end = objective.predict(values.T)
    pose = np.array([np.squeeze(v) for v in (end.x, end.y, end.yaw)]) - np.array(
        objective.problem.goal.pose
    )
    wheels = np.array([np.squeeze(w) for w in end.wheels])
    assert smdw_searches.first_cost(objective, values)[0] == pytest.approx(
        terminal_cost(pose, wheels, np.array([1.0, 0.125, 1.0]), np.full(4, 10.0))
    )


def test_particles_outside_the_space_never_win() -> None:
    objective, fixed = smdw_searches.first_objective()
    bounds = np.array([[0.0, 2.0], [-1.5, 1.5], [0.0, 2.0]])
    cost = smdw_searches.first_swarm_cost(
        objective, fixed, bounds, np.array([[1.2, -0.4, 1.0], [2.5, 0.0, 1.0]])
    )
    assert cost[0] < cost[1] == smdw_searches.OUTSIDE


def test_every_picture_has_a_place_and_every_named_picture_exists(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(smdw_page, "OUT", tmp_path)
    (tmp_path / "climb_mujoco.md").write_text(
        "# Benchmark: climb\n\n## Sub-test 2\n", encoding="utf-8"
    )
    (tmp_path / "climb_mujoco_quick.md").write_text("# not shown\n", encoding="utf-8")
    names = sorted(
        {
            part.strip(" ,")
            for _, here, _ in smdw_page.CORRESPONDENCE
            for part in here.replace(";", ",").split(",")
            for part in part.split()
            if part.endswith(".png")
        }
    )
    tables = {"headline": smdw_counts.headline(cells({("lateral", EXACT): 1}))}
    text = smdw_page.Page("here", cells({("lateral", EXACT): 1}), tables, "folder", names).text()
    for name in names:
        assert text.count(f"![{name}](folder/{name})") == 1, name
    assert (
        text.index("climb_rates.png")
        < text.index("Climbs of trials")
        < text.index("## What stands for what")
    )
    assert "## Benchmark: climb\n\n### Sub-test 2" in text
    assert "not shown" not in text


def test_a_cell_whose_trials_all_left_physics_has_no_errors_to_show() -> None:
    lost = closed_loop.Row(
        "pose only, noisy",
        "step_5cm.toml",
        "lateral left",
        7,
        9.0,
        9.0,
        9.0,
        3.0,
        4.0,
        exploded=True,
    )
    cell = closed_loop.table([lost]).rows[0]
    assert cell[3].startswith("0/1")
    assert tuple(cell[4:]) == ("-", "-", "-", "-", "1")
