"""Pictures and tables of motions on ground that is not level, and of wheels that turn."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tests.recordings import made_up
from tests.report.test_pictures import assert_shows_something
from trajopt import load_problem, solve
from trajopt.report.loads_picture import loads_figure, stands
from trajopt.report.motion import limit_use, most
from trajopt.report.path_picture import path_figure
from trajopt.report.physics_picture import physics_figure
from trajopt.report.pictures import save_pictures
from trajopt.report.profile_picture import profile_figure
from trajopt.report.run_folder import write_validation
from trajopt.report.tables import validation_table
from trajopt.robots import robot
from trajopt.simulate.check import ValidationReport
from trajopt.simulate.plan import wheel_plan
from trajopt.solution import Solution

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def across() -> Solution:
    """PowerBot, two castors, across a slope."""
    return solve(load_problem(ROOT / "problems" / "powerbot" / "across_slope.toml"))


@pytest.fixture(scope="module")
def level() -> Solution:
    file = ROOT / "problems" / "powerbot" / "across_slope.toml"
    return solve(load_problem(file, {"ground.plane": None}))


def test_all_pictures_are_drawn(across: Solution, tmp_path: Path) -> None:
    files = save_pictures(across, tmp_path)
    assert {file.name for file in files} == {"path.png", "profile.png", "loads.png"}
    for file in files:
        assert_shows_something(file)


def test_heights_are_drawn_where_the_ground_is_not_level(across: Solution, level: Solution) -> None:
    for solution, drawn in ((across, True), (level, False)):
        assert solution.path is not None
        labels = path_figure(solution, solution.path).axes[0].get_legend_handles_labels()[1]
        assert ("height of the ground, m" in labels) == drawn


def test_panels_of_tilt_and_steering(across: Solution, level: Solution) -> None:
    for solution, tilts in ((across, True), (level, False)):
        assert solution.trajectory is not None
        labels = [axes.get_ylabel() for axes in profile_figure(solution, solution.trajectory).axes]
        assert ("tilt (deg)" in labels) == tilts
        assert labels[-3:-1] == ["steering (rad)", "steering rate (rad/s)"]
    mecanum = solve(load_problem(ROOT / "problems" / "smdw" / "table_5_3.toml"))
    assert mecanum.trajectory is not None
    assert len(profile_figure(mecanum, mecanum.trajectory).axes) == 6


def test_loads_are_those_that_hold_the_robot(across: Solution) -> None:
    """Sum of loads: the weight's part along the normal of the plane, which the path does not
    leave."""
    assert across.trajectory is not None
    loads = loads_figure(across, across.trajectory).axes[1]
    drawn = {line.get_label(): np.asarray(line.get_ydata()) for line in loads.get_lines()}
    wheels = across.problem.robot.description.wheels
    total = np.sum([drawn[wheel.name] for wheel in wheels], axis=0)
    weight = across.problem.robot.body.mass * 9.80665
    np.testing.assert_allclose(total, weight * np.cos(0.139626), rtol=1e-9)
    # the slope rises to the left and is along the contour first: the right wheel bears more
    assert drawn["right"][0] > 1.1 * drawn["left"][0]


def test_no_loads_for_a_robot_that_its_wheels_do_not_hold() -> None:
    """Two wheels stand on a line."""
    assert stands(robot("powerbot"))
    line = SimpleNamespace(body=SimpleNamespace(contacts=((0.0, 0.2), (0.0, -0.2), (0.0, 0.1))))
    assert not stands(line)  # type: ignore[arg-type]


def test_use_of_limits_on_a_slope_is_one_minus_the_margin(across: Solution) -> None:
    assert across.trajectory is not None
    used = limit_use(across.trajectory)[1].max(axis=0)
    for share, (name, margin) in zip(used, across.margins.items(), strict=True):
        assert share == pytest.approx(1 - margin, rel=0.02), name


def test_the_largest_on_the_way(across: Solution, level: Solution) -> None:
    assert across.trajectory is not None
    assert level.trajectory is not None
    told = {name: (value, place) for name, value, place in most(across.trajectory)}
    assert told["roll"][0] == "8.00 deg"  # the left side is up
    assert "pitch" in told
    assert {name.split(",")[0] for name in told} == {
        "roll",
        "pitch",
        "castor angle",
        "castor rate",
    }
    assert "roll" not in {name for name, *_ in most(level.trajectory)}


def test_a_check_tells_loads_and_steering(across: Solution, tmp_path: Path) -> None:
    trajectory, machine = across.trajectory, across.problem.robot
    assert trajectory is not None
    times = np.linspace(0.0, trajectory.duration + 0.2, 200)
    at, plan = trajectory.at(np.minimum(times, trajectory.duration)), wheel_plan(trajectory, times)
    recording = made_up(
        times,
        pose=at.pose,
        wheel_angles=at.wheel_angles,
        wheel_speeds=at.wheel_speeds,
        wheel_torques=at.wheel_speeds,
        loads=plan.loads + np.array([1.0, 2.0, 3.0, 4.0]),
        spin_angles=at.spin_angles,
    )
    names = tuple(wheel.name for wheel in machine.description.wheels)
    steering = at.steering_angles + np.array([0.0, 0.0, 0.02, -0.03])
    report = ValidationReport(
        "made-up", 0.0, 0.0, 0.0, np.zeros(2), 0.0, 0.0, 6.0, (), names, np.zeros(4), 1.0, at.pose,
        recording, plan, steering,
    )  # fmt: skip
    write_validation(report, tmp_path, machine)
    told = json.loads((tmp_path / "validation.json").read_text(encoding="utf-8"))
    wanted = {"castor-left": 0.02, "castor-right": 0.03}
    assert told["steering_error_rad"] == {name: pytest.approx(e) for name, e in wanted.items()}
    more = [told["mean_load_n"][n] - told["planned_mean_load_n"][n] for n in names]
    np.testing.assert_allclose(more, [1.0, 2.0, 3.0, 4.0], atol=1e-9)
    table = pd.read_csv(tmp_path / "simulated.csv")
    gap = table["wheel_castor_left_steering_rad"] - table["wheel_castor_left_planned_steering_rad"]
    np.testing.assert_allclose(gap, 0.02, atol=1e-12)
    gap = table["wheel_right_load_n"] - table["wheel_right_planned_load_n"]
    np.testing.assert_allclose(gap, 2.0, atol=1e-9)
    labels = [axes.get_ylabel() for axes in physics_figure(across, report).axes]
    assert labels[-2:] == ["load (N)\ndashed: planned", "steering error (mrad)"]
    rows = validation_table(report, machine).columns[1].cells
    assert "30.00 mrad, wheel castor-right" in [str(cell) for cell in rows]
