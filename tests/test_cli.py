"""The command line as a user meets it: exit codes, one-line errors, files, silence when piped."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from smdw_problems import ROOT

from trajopt.problem import load_problem

SCENARIO = "problems/smdw/scenario_1_forward35.toml"
RUN = "from trajopt.cli import main; main()"


def trajopt(*arguments):
    return subprocess.run(
        [sys.executable, "-c", RUN, *map(str, arguments)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A run folder, without pictures."""
    folder = tmp_path_factory.mktemp("run")
    done = trajopt("solve", SCENARIO, "--out", folder, "--no-pictures")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_solve_writes_tables_that_others_read(solved):
    summary = json.loads((solved / "summary.json").read_text())
    assert summary["holds"]
    assert summary["energy_j"] > 0
    table = pd.read_csv(solved / "trajectory.csv")
    assert {"t_s", "x_m", "y_m", "yaw_rad"} <= set(table.columns)
    assert table["t_s"].iloc[-1] == pytest.approx(summary["duration_s"])
    assert table["energy_j"].iloc[-1] == pytest.approx(summary["energy_j"])


def test_nothing_but_the_table_when_piped(solved):
    done = trajopt("solve", SCENARIO, "--optimizer", "pso", "--evaluations", 200)
    assert done.stderr == ""
    assert "\x1b" not in done.stdout
    assert solved.exists()


def test_a_solution_that_does_not_hold_exits_with_one():
    done = trajopt("solve", SCENARIO, "--optimizer", "pso", "--evaluations", 100)
    assert done.returncode == 1
    assert "does not hold" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("solve", "nowhere.toml"), "existing file"),
        (("solve", SCENARIO, "--set", "limits.sped=1"), "nearest is 'speed'"),
        (("solve", SCENARIO, "--set", "limits"), "key=value"),
        (("solve", SCENARIO, "--optimizer", "magic"), "one of auto, pso"),
        (("solve", SCENARIO, "--seed", "-1"), "whole number"),
        (("solve", SCENARIO, "--seconds", "0"), "budget.seconds = 0.0"),
        (("solve", "problems/powerbot/experiment_1.toml", "--optimizer", "pso"), "not searched"),
        (("plan", SCENARIO), "[climb]"),
        (("validate", SCENARIO), "summary.json"),
        (("validate", "nowhere"), "nowhere"),
        (("explain", SCENARIO, "--set", "actuator.duration=0"), "actuator.duration"),
        (("explain", SCENARIO, "--engine", "magic"), "engine"),
    ],
)
def test_unusable_input_is_one_line_and_exit_two(arguments, words):
    done = trajopt(*arguments)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert words in done.stderr
    assert "Traceback" not in done.stderr


def test_x0_from_a_saved_solution(solved):
    done = trajopt("solve", SCENARIO, "--optimizer", "slsqp", "--x0", solved, "--evaluations", 50)
    assert done.returncode == 0, done.stdout


def test_validate_a_saved_solution(solved):
    pytest.importorskip("pybullet")
    done = trajopt("validate", solved, "--no-pictures")
    assert done.returncode == 0, done.stderr
    assert json.loads((solved / "validation.json").read_text())
    assert "build time" not in done.stdout + done.stderr


@pytest.mark.parametrize("plan", [SCENARIO, "problems/powerbot/experiment_4.toml"])
def test_explain_names_binding_limits(plan):
    done = trajopt("explain", plan)
    assert done.returncode == 0, done.stderr
    assert "acceleration" in done.stdout


def test_explain_names_motors_and_power():
    curve = "robot.motors.all.curve=[[0, 20], [10, 0]]"
    plan = ("problems/powerbot/experiment_1.toml", "--set", "limits.power=60", "--set", curve)
    done = trajopt("explain", *plan)
    assert done.returncode == 0, done.stderr
    binding = done.stdout.split("least margin")[0]
    assert "power" in binding
    assert all(name in done.stdout for name in ("wheel_torque", "motor_curve"))


def test_robot_tells_the_slopes_it_climbs():
    shown = trajopt("robot", "powerbot", "--set", "motors.all.torque=30").stdout
    assert "18.5 deg by the torque of its motors, 11.3 deg by friction 0.4, 18.5 deg by" in shown
    assert "not counted" in trajopt("robot", "powerbot", "--set", "motors=[]").stdout


def test_export_ends_at_rest(tmp_path):
    file = tmp_path / "commands.csv"
    assert trajopt("export", "problems/powerbot/experiment_1.toml", "--out", file).returncode == 0
    table = pd.read_csv(file)
    assert list(table.columns) == ["t", "v_left", "v_right", "vx", "vy", "wz"]
    assert (table.iloc[-1, 1:] == 0).all()


def test_schema_is_json():
    assert json.loads(trajopt("schema").stdout)["type"] == "object"


def test_plan_ranks_configurations_and_writes_run_folders(tmp_path):
    done = trajopt("plan", "problems/smdw/step_5cm.toml", "--out", tmp_path, "--no-pictures")
    assert done.returncode == 0, done.stderr
    folders = sorted(f.name for f in tmp_path.iterdir())
    assert len(folders) >= 3
    assert "lateral" in done.stdout
    for name in folders:
        assert json.loads((tmp_path / name / "summary.json").read_text())["holds"]
        problem = load_problem(tmp_path / name / "problem.toml")
        assert problem.robot.name == "loc8-smdw"
        assert problem.scene == load_problem(ROOT / "problems/smdw/step_5cm.toml").scene


@pytest.mark.parametrize("file", ["smdw/table_5_3", "smdw/table_5_3_1s", "powerbot/experiment_6"])
def test_every_command_takes_problem_and_folder_of_every_kind(file, tmp_path):
    """Searched, through drives, given with a profile: explain, export and compare, with a log of
    the plan itself."""
    path = f"problems/{file}.toml"
    known = load_problem(ROOT / path).infeasible is not None
    run = trajopt("solve", path, "--out", tmp_path / "run", "--no-pictures")
    assert run.returncode == int(known), run.stderr
    table = pd.read_csv(tmp_path / "run" / "trajectory.csv")
    table["v_m_s"] = np.hypot(table["vx_m_s"], table["vy_m_s"])
    columns = {"t_s": "t", "x_m": "x", "y_m": "y", "yaw_rad": "yaw", "v_m_s": "v"}
    table[list(columns)].rename(columns=columns).to_csv(tmp_path / "log.csv", index=False)
    told = {}
    for plan in (path, tmp_path / "run"):
        orders = tmp_path / "orders.csv"
        for arguments in (("explain", plan), ("export", plan, "--out", orders, "--force")):
            done = trajopt(*arguments)
            assert done.returncode == 0, done.stderr
        wheels = load_problem(ROOT / path).robot.wheel_names
        assert list(pd.read_csv(orders).columns) == [
            "t",
            *(f"v_{name}" for name in wheels),
            *("vx", "vy", "wz"),
        ]
        told[plan] = trajopt("compare", plan, tmp_path / "log.csv").stdout
        assert "speed error" in told[plan]
        assert "0.0000 m/s" in told[plan]
    assert len(set(told.values())) == 1


@pytest.mark.parametrize("group", ["sweep", "bench"])
def test_groups_are_mounted(group):
    assert trajopt(group, "--help").returncode == 0


@pytest.mark.parametrize("robot", ["asoc", "loc8"])
def test_two_robots_drive_the_same_field_with_the_same_commands(robot, tmp_path):
    """Castors and Mecanum wheels over one height map: solve, explain, export, compare."""
    path, out, orders = f"problems/{robot}/field.toml", tmp_path / "run", tmp_path / "orders.csv"
    problem = load_problem(ROOT / path)
    other = load_problem(ROOT / "problems/loc8/field.toml")
    np.testing.assert_array_equal(problem.scene.ground.heights, other.scene.ground.heights)
    done = trajopt("solve", path, "--out", out, "--no-pictures")
    assert done.returncode == 0, done.stderr
    table = pd.read_csv(out / "trajectory.csv")
    x, y, z = (table[f"{axis}_m"].to_numpy() for axis in "xyz")
    # the body stands on the mean of the heights under its wheels, less what tilt takes
    assert np.abs(z - problem.scene.ground.height(x, y)).max() < 0.02
    assert np.ptp(z) > 0.03  # it goes up and down
    told = trajopt("explain", out)
    assert told.returncode == 0, told.stderr
    assert "pitch" in told.stdout
    assert ("castor rate" in told.stdout) == (robot == "asoc")
    assert trajopt("export", out, "--out", orders).returncode == 0
    assert len(pd.read_csv(orders).columns) == 4 + len(problem.robot.wheel_names)


def test_explain_says_that_a_slow_steering_costs_time():
    car = "problems/car/lane_change.toml"
    slow = trajopt("explain", car)
    fast = trajopt("explain", car, "--set", "robot.steering.front.rate=4")
    seconds = [float(done.stdout.split(": ")[1].split(" s")[0]) for done in (slow, fast)]
    assert seconds[0] > seconds[1] + 1e-3
    bound = [line for line in slow.stdout.splitlines() if line.rstrip().endswith("steering_rate")]
    assert bound, slow.stdout
    assert not [
        line for line in fast.stdout.splitlines() if line.rstrip().endswith("steering_rate")
    ]
    assert "steering rate, front-" in slow.stdout
