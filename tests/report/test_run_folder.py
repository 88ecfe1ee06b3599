"""The folder of a run: round trips, equal bytes for equal seeds, names with units."""

from __future__ import annotations

import json
import random
import shutil
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import trajopt
from tests.report.conftest import problem_file
from trajopt.errors import ArgumentError, MissingDependencyError, TrajoptError
from trajopt.optimize.search import optimizer_names
from trajopt.provenance import commit, versions
from trajopt.report.files import as_toml, finite
from trajopt.report.motion import binding_at, binding_shares, trajectory_table
from trajopt.report.run_folder import (
    read_solution,
    solution_summary,
    write_solution,
    write_validation,
)
from trajopt.robots.robot import DATA
from trajopt.simulate.check import ValidationReport
from trajopt.solution import Solution
from trajopt.systems.smdw.entry import WHEELS

ALL = ("exact", "through_actuators", "violated", "without_motion")


@pytest.fixture(params=ALL)
def solution(request: pytest.FixtureRequest) -> Solution:
    found: Solution = request.getfixturevalue(request.param)
    return found


def summary_of(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    return content


def test_read_solution_gives_back_what_was_written(solution: Solution, tmp_path: Path) -> None:
    back = read_solution(
        write_solution(solution, tmp_path / "run", seed=7, command="trajopt solve x")
    )
    assert back.problem == solution.problem
    assert back.search is not None
    assert solution.search is not None
    np.testing.assert_array_equal(back.search.x, solution.search.x)
    np.testing.assert_array_equal(back.control_points, solution.control_points)
    for name in ("evaluations", "seconds", "cost", "violation", "samples"):
        np.testing.assert_array_equal(
            getattr(back.search.history, name), getattr(solution.search.history, name)
        )
    for name in ("deviation", "wheel_deviation"):
        np.testing.assert_array_equal(getattr(back, name), getattr(solution, name))
    assert back.terms == solution.terms
    assert (back.cost, back.evaluations, back.search.status) == (
        solution.cost,
        solution.evaluations,
        solution.search.status,
    )
    assert (back.holds, back.faults, back.status) == (
        solution.holds,
        solution.faults,
        solution.status,
    )


def test_trajectory_is_rebuilt_to_the_last_bit(exact: Solution, tmp_path: Path) -> None:
    back = read_solution(write_solution(exact, tmp_path, seed=0)).trajectory
    assert back is not None
    assert exact.trajectory is not None
    assert back.duration == exact.trajectory.duration
    assert dict(back.margins()) == dict(exact.trajectory.margins())
    times = np.linspace(0.0, back.duration, 50)
    for name in ("pose", "twist", "wheel_angles", "wheel_speeds"):
        np.testing.assert_array_equal(
            getattr(back.at(times), name), getattr(exact.trajectory.at(times), name)
        )


def test_a_summary_is_the_same_after_reading_back(solution: Solution, tmp_path: Path) -> None:
    back = read_solution(write_solution(solution, tmp_path, seed=4))
    assert finite(solution_summary(back, seed=4)) == finite(solution_summary(solution, seed=4))


@pytest.mark.parametrize("optimizer", sorted(optimizer_names()))
def test_equal_seeds_give_equal_summaries(optimizer: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "trajopt.report.run_folder.commit", lambda: "somebody may commit while the test runs"
    )
    texts = []
    for _ in range(2):
        try:
            found = trajopt.solve(
                problem_file("table_5_3"),
                optimizer=optimizer,
                seed=5,
                budget=trajopt.Budget(evaluations=200),
            )
        except MissingDependencyError as error:
            pytest.skip(str(error))
        texts.append(json.dumps(finite(solution_summary(found, seed=5))))
    assert texts[0] == texts[1]


@pytest.mark.parametrize("optimizer", ["lattice", "pso"])
def test_equal_seeds_give_equal_bytes_but_for_the_run(
    optimizer: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "trajopt.report.run_folder.commit", lambda: "somebody may commit while the test runs"
    )
    texts = []
    for attempt in ("first", "second"):
        found = trajopt.solve(
            problem_file("scenario_2_lateral"),
            optimizer=optimizer,
            seed=5,
            budget=trajopt.Budget(evaluations=300),
        )
        write_solution(found, tmp_path / attempt, seed=5, command=attempt)
        summary = summary_of(tmp_path / attempt)
        assert set(summary.pop("run")) == {
            "written",
            "host",
            "system",
            "processor",
            "command",
            "folder",
            "problem_file",
            "wall_time_s",
            "search_time_s",
            "files",
        }
        del summary["checksum"]
        text = (tmp_path / attempt / "summary.json").read_text(encoding="utf-8")
        texts.append(text[: text.index('"run": {')])
        assert json.loads(texts[-1].rstrip().rstrip(",") + "}") == summary  # run is the last key
    assert texts[0] == texts[1]
    for name in ("trajectory.csv", "timing.csv", "problem.toml", "explored.npz"):
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "second" / name).read_bytes()


def test_other_seeds_give_other_bytes(tmp_path: Path) -> None:
    costs = []
    for seed in (1, 2):
        found = trajopt.solve(
            problem_file("scenario_2_lateral"),
            optimizer="pso",
            seed=seed,
            budget=trajopt.Budget(evaluations=300),
        )
        costs.append(summary_of(write_solution(found, tmp_path / str(seed), seed=seed))["cost"])
    assert costs[0] != costs[1]


def test_columns_of_the_trajectory_have_units(exact: Solution, tmp_path: Path) -> None:
    table = pd.read_csv(write_solution(exact, tmp_path, seed=0) / "trajectory.csv")
    corners = [name.replace("-", "_") for name in WHEELS]
    assert list(table.columns) == [
        "t_s",
        "x_m",
        "y_m",
        "yaw_rad",
        "z_m",
        "roll_rad",
        "pitch_rad",
        "vx_m_s",
        "vy_m_s",
        "yaw_rate_rad_s",
        *(f"wheel_{corner}_angle_rad" for corner in corners),
        *(f"wheel_{corner}_speed_rad_s" for corner in corners),
        "s_m",
        "s_dot_m_s",
        "s_ddot_m_s2",
        "energy_j",
        "limit",
    ]
    assert not table.drop(columns="limit").isna().to_numpy().any()
    steps = np.diff(table["t_s"])
    assert steps.max() <= 0.01 + 1e-12
    assert np.ptp(steps) < 1e-12
    assert table["t_s"].iloc[-1] == exact.duration


def test_trajectory_table_agrees_with_itself(exact: Solution) -> None:
    """Speeds integrate to positions and wheel angles; the start is the problem's, the end is the
    goal's."""
    start_wheels = (0.3, -0.2, 0.1, 0.0)
    assert exact.trajectory is not None
    shifted = replace(exact.trajectory, start_wheels=np.array(start_wheels))
    table = pd.DataFrame(trajectory_table(shifted))
    time = table["t_s"].to_numpy()
    for i, name in enumerate(WHEELS):
        corner = name.replace("-", "_")
        angle, speed = (
            table[f"wheel_{corner}_angle_rad"].to_numpy(),
            table[f"wheel_{corner}_speed_rad_s"].to_numpy(),
        )
        assert angle[0] == pytest.approx(start_wheels[i], abs=1e-12)
        assert angle[-1] - angle[0] == pytest.approx(np.trapezoid(speed, time), abs=2e-3)
    yaw, vx, vy = (table[name].to_numpy() for name in ("yaw_rad", "vx_m_s", "vy_m_s"))
    x = np.trapezoid(np.cos(yaw) * vx - np.sin(yaw) * vy, time)
    assert table["x_m"].iloc[0] + x == pytest.approx(exact.problem.search.goal[0], abs=1e-3)
    assert table["yaw_rad"].iloc[-1] == pytest.approx(exact.problem.search.goal[2], abs=1e-9)


def test_binding_limits_share_the_time(exact: Solution) -> None:
    assert exact.trajectory is not None
    shares = binding_shares(exact.trajectory)
    assert (
        0.9 < sum(shares.values()) <= 1.0 + 1e-12
    )  # a time-optimal motion: something binds nearly always
    assert list(shares.values()) == sorted(shares.values(), reverse=True)
    assert set(binding_at(exact.trajectory, np.linspace(0, exact.duration, 200))) <= {*shares, ""}


def test_summary_names_what_fails(without_motion: Solution, violated: Solution) -> None:
    summary = solution_summary(without_motion, seed=0)
    assert summary["holds"] is False
    assert summary["infeasible"] == {
        "limit": "tip",
        "place_m": 0.25,
        "reason": "rest already breaks it",
    }
    assert summary["timing"] is None
    assert any("tip" in fault for fault in summary["faults"])
    assert solution_summary(violated, seed=0)["search"]["status"] == "INFEASIBLE"
    assert solution_summary(violated, seed=0)["search"]["violation"] > 0


def test_summary_has_no_number_that_json_lacks(without_motion: Solution, tmp_path: Path) -> None:
    text = (write_solution(without_motion, tmp_path, seed=0) / "summary.json").read_text(
        encoding="utf-8"
    )
    assert "NaN" not in text
    assert "Infinity" not in text
    assert json.loads(text)["duration_s"] is None
    assert not (tmp_path / "trajectory.csv").exists()


def test_an_earlier_run_leaves_nothing_behind(
    exact: Solution, without_motion: Solution, drifted: ValidationReport, tmp_path: Path
) -> None:
    write_solution(exact, tmp_path, seed=0)
    write_validation(drifted, tmp_path, exact.problem.robot)
    (tmp_path / "notes.txt").write_text("mine")
    write_solution(without_motion, tmp_path, seed=0)
    left = {file.name for file in tmp_path.iterdir()}
    assert left == {"problem.toml", "summary.json", "history.csv", "explored.npz", "notes.txt"}


def test_validation_round_trip(exact: Solution, drifted: ValidationReport, tmp_path: Path) -> None:
    content = json.loads(
        (write_validation(drifted, tmp_path, exact.problem.robot) / "validation.json").read_text(
            encoding="utf-8"
        )
    )
    assert content["along_m"] == drifted.along
    assert content["along_share"] == pytest.approx(drifted.along / drifted.length)
    assert content["final_distance_m"] == pytest.approx(np.hypot(2e-3, 1e-3))
    assert content["wheel_deviation_rad"] == dict.fromkeys(WHEELS, -2e-3)
    assert content["run"]["real_time_factor"] == 3.5
    table = pd.read_csv(tmp_path / "simulated.csv")
    np.testing.assert_allclose(table["x_m"] - table["planned_x_m"], 1e-3 * table["t_s"], atol=1e-12)


def test_written_problem_loads_again(exact: Solution, tmp_path: Path) -> None:
    problem = exact.problem.replace(
        {"title": 'quotes " and \\ and ü', "goal.wheels": [1e-7, 2.5, -3.0, 1e6]}
    )
    write_solution(replace(exact, problem=problem), tmp_path, seed=0)
    assert trajopt.load_problem(tmp_path / "problem.toml") == problem


_SCALARS = st.one_of(
    st.booleans(),
    st.integers(-(2**60), 2**60),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(st.characters(exclude_categories=["Cs"]), max_size=12),
)
_TABLES = st.recursive(
    st.dictionaries(
        st.text(st.characters(exclude_categories=["Cs"]), max_size=6),
        st.one_of(_SCALARS, st.lists(_SCALARS, max_size=4)),
        max_size=4,
    ),
    lambda inner: st.dictionaries(
        st.text("abc-_.", max_size=6),
        st.one_of(_SCALARS, inner, st.lists(inner, max_size=3)),
        max_size=4,
    ),
    max_leaves=8,
)


@settings(max_examples=200, deadline=None)
@given(_TABLES)
def test_toml_text_says_what_it_was_given(table: dict[str, Any]) -> None:
    assert tomllib.loads(as_toml(table)) == table


@pytest.mark.parametrize(
    "damage",
    ["no summary", "no timing", "other format", "missing key", "no json", "bad toml", "no rows"],
)
def test_damaged_folders_are_refused_in_words(damage: str, exact: Solution, tmp_path: Path) -> None:
    folder = write_solution(exact, tmp_path / "run", seed=0)
    summary = summary_of(folder)
    if damage == "no summary":
        shutil.rmtree(folder)
    elif damage == "no timing":
        (folder / "timing.csv").unlink()
    elif damage == "no rows":
        (folder / "timing.csv").write_text("")
    elif damage == "bad toml":
        (folder / "problem.toml").write_text("title = ")
    elif damage == "no json":
        (folder / "summary.json").write_text("{")
    else:
        changed = (
            {**summary, "format": 99}
            if damage == "other format"
            else {k: v for k, v in summary.items() if k != "search"}
        )
        (folder / "summary.json").write_text(json.dumps(changed))
    with pytest.raises(TrajoptError, match=r"expected|damaged") as told:
        read_solution(folder)
    assert str(folder) in str(told.value)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda t: t[: len(t) // 2], r"timing\.csv, row \d+ = '\d fields instead of 7'"),
        (lambda t: t.replace(t.splitlines()[9].split(",")[1], "nan"), r"timing.csv, row 10 = .s_m"),
        (lambda t: "".join(t.splitlines(True)[:9]), "timing.csv: damaged: its content"),
        (lambda t: t.replace("s_m", "S"), r"timing\.csv, row 1 = 'its columns are u, S, "),
        (lambda t: t.replace("0.1", "0_1"), r"timing\.csv, row \d+ = "),
        (lambda t: t + '"', r"timing\.csv, row \d+ = "),
        (lambda t: t.replace("0", "\0"), r"timing\.csv"),
    ],
)
def test_damaged_tables_are_refused_with_file_and_row(
    change: Callable[[str], str], told: str, exact: Solution, tmp_path: Path
) -> None:
    folder = write_solution(exact, tmp_path / "run", seed=0)
    file = folder / "timing.csv"
    file.write_text(change(file.read_text()))
    with pytest.raises(TrajoptError, match=told):
        read_solution(folder)


def test_files_that_no_run_wrote_are_spared(exact: Solution, tmp_path: Path) -> None:
    (tmp_path / "problem.toml").write_text("mine")
    with pytest.raises(ArgumentError, match=r"without problem\.toml: no run"):
        write_solution(exact, tmp_path, seed=0)
    assert (tmp_path / "problem.toml").read_text() == "mine"


@pytest.mark.parametrize("count", [20, pytest.param(300, marks=pytest.mark.slow)])
def test_flipped_bits_of_a_run_folder_are_told(
    count: int, exact: Solution, drifted: ValidationReport, tmp_path: Path
) -> None:
    write_solution(exact, tmp_path, seed=0)
    write_validation(drifted, tmp_path, exact.problem.robot)
    draw = random.Random(3)
    for file in sorted(tmp_path.iterdir()):
        content = file.read_bytes()
        for _ in range(count):
            bit = draw.randrange(8 * len(content))
            changed = bytearray(content)
            changed[bit // 8] ^= 1 << bit % 8
            file.write_bytes(changed)
            try:
                read_solution(tmp_path)
            except TrajoptError as error:
                assert file.name in str(error)  # noqa: PT017
            else:  # 1E5 is 1e5, and the last of twenty digits may change nothing
                assert file.suffix == ".json"
                assert json.loads(changed) == json.loads(content)
        file.write_bytes(content)
    read_solution(tmp_path)


def test_a_file_in_the_way_is_refused(exact: Solution, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(ArgumentError, match="folder"):
        write_solution(exact, tmp_path / "taken", seed=0)


def test_provenance_names_versions_and_commit() -> None:
    found = versions()
    assert found["trajopt"] == trajopt.__version__
    assert found["numpy"] == np.__version__
    assert commit() is None or len(commit() or "") >= 40


def test_a_saved_solution_starts_another_search(exact: Solution, tmp_path: Path) -> None:
    x0 = read_solution(write_solution(exact, tmp_path, seed=0)).search.x
    free = exact.problem.replace({"obstacles": None})  # this optimizer knows no constraints
    again = trajopt.solve(
        free, optimizer="nelder-mead", x0=x0, budget=trajopt.Budget(evaluations=40)
    )
    assert again.cost <= exact.cost + 1e-6


def test_folders_of_every_job_stand_alone(tmp_path: Path) -> None:
    """A given path of a file, a robot of a file, a profile; the folder is moved before it is
    read."""
    robot = tmp_path / "mine.toml"
    robot.write_text((DATA / "powerbot.toml").read_text().replace('"powerbot"', '"mine"', 1))
    (tmp_path / "way.csv").write_text("x,y\n0,0\n1,0.2\n2,0\n")
    file = tmp_path / "problem.toml"
    file.write_text(
        'title = "mine"\n[robot]\nfile = "mine.toml"\nbody.mass = 120.0\n'
        '[path]\nfile = "way.csv"\n[start]\nwheels = [0.5, -0.5]\n'
        "[limits]\nspeed = 1.0\nacceleration = 0.5\ndeceleration = 0.5\n"
        "[ground]\nfriction = 0.6\n[profile]\nplaces = [0.0, 1.0]\nspeeds = [0.3, 0.4]\n"
    )
    solution = trajopt.solve(trajopt.load_problem(file))
    assert solution.holds, solution.faults
    write_solution(solution, tmp_path / "run", seed=0, pictures="png")
    assert {"path.png", "profile.png"} <= {f.name for f in (tmp_path / "run").iterdir()}
    assert not (tmp_path / "run" / "convergence.png").exists()
    shutil.move(tmp_path / "run", tmp_path / "elsewhere")
    for gone in (robot, file, tmp_path / "way.csv"):
        gone.unlink()
    back = read_solution(tmp_path / "elsewhere")
    assert back.problem.robot.name == "mine"
    assert back.problem.robot.body.mass == 120.0
    assert back.trajectory is not None
    assert solution.trajectory is not None
    assert back.duration == solution.duration
    assert [m.name for m in back.trajectory.limits] == [m.name for m in solution.trajectory.limits]
    np.testing.assert_array_equal(back.trajectory.start_wheels, [0.5, -0.5])
    np.testing.assert_array_equal(
        back.trajectory.at(1.0).wheel_angles, solution.trajectory.at(1.0).wheel_angles
    )
