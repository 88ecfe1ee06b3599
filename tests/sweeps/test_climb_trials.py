"""Climb trials: what each number draws, how controls differ, and what the command line says of
it."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.sweeps.crashes import ROOT
from trajopt.cli import app
from trajopt.errors import ArgumentError
from trajopt.problem import Problem, load_problem
from trajopt.simulate.sensors import Sensors
from trajopt.systems.smdw.approach_run import Ending
from trajopt.systems.smdw.configurations import configurations_of, travel_to_step
from trajopt.systems.smdw.entry import step_of
from trajopt.systems.smdw.planner import Plan, plan_configuration
from trajopt.systems.smdw.trials import (
    NEAREST,
    Scatter,
    approach_command,
    before_step,
    climb_trials,
)

pytest.importorskip("mujoco")
FILE = ROOT / "problems" / "smdw" / "step_3_5cm.toml"


@pytest.fixture(scope="module")
def problem() -> Problem:
    return load_problem(FILE)


@pytest.fixture(scope="module")
def plan(problem: Problem) -> Plan:
    found = next(c for c in configurations_of(problem) if c.name == "forward -35 deg")
    made = plan_configuration(problem, found)
    assert isinstance(made, Plan)
    return made


def test_feedback_ends_nearer_than_planned_speeds_and_numbers_repeat(
    problem: Problem, plan: Plan
) -> None:
    loose = climb_trials(problem, plan, (3,))[0]
    seen: list[int] = []  # how many are done
    steered = climb_trials(
        problem,
        plan,
        (3, 4),
        control="pose and phase",
        progress=lambda done: seen.append(len(done)),
    )
    assert seen == [1, 2]
    assert steered[0].friction == loose.friction
    assert steered[0].ending.position < loose.ending.position
    for tight in steered:
        assert tight.ending.within(0.01, math.radians(1.0), 0.1)
        assert tight.outcome is not None
        assert tight.climb is not None
    again = climb_trials(problem, plan, (3, 4), control="pose and phase", workers=2)
    for first, second in zip(steered, again, strict=True):
        assert first.ending == second.ending
        assert first.outcome == second.outcome
        assert np.array_equal(first.approach.pose, second.approach.pose)


def test_starts_scatter_as_stated(problem: Problem, plan: Plan) -> None:
    rng = np.random.default_rng(5)
    commands = [approach_command(problem, plan, rng) for _ in range(60)]
    poses = np.array([c.start_pose for c in commands]) - problem.start.pose
    wheels = np.array([c.start_wheel_angles for c in commands]) - problem.start.wheels
    scatter = Scatter()
    assert poses.std(axis=0) == pytest.approx(
        [scatter.position, scatter.position, scatter.yaw], rel=0.3
    )
    assert wheels.std() == pytest.approx(scatter.wheels, rel=0.2)


@pytest.mark.parametrize("direction", [0.0, 0.7, -2.0])
def test_a_climb_starts_before_the_step_whatever_its_direction(
    problem: Problem, direction: float
) -> None:
    step = replace(step_of(problem), direction=direction)
    scene = replace(problem.scene, obstacles=(step,))
    turned = cast(Problem, SimpleNamespace(scene=scene, climb=problem.climb, robot=problem.robot))
    normal, place = np.array(step.normal), np.array(step.place)
    for yaw in (0.0, 1.1):
        inside = np.array([*(place + 0.1 * normal), yaw])
        x, y, kept = before_step(turned, inside)
        corner = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        reach = (np.array(turned.robot.footprint) @ corner.T + [x, y]) @ normal
        assert kept == yaw
        assert normal @ place - reach.max() == pytest.approx(NEAREST, abs=1e-12)
        assert np.array([-normal[1], normal[0]]) @ (np.array([x, y]) - inside[:2]) == pytest.approx(
            0.0, abs=1e-12
        )
        away = inside - [*(2.0 * normal), 0.0]
        assert before_step(turned, away) == pytest.approx(tuple(away))


def test_travel_to_the_step_is_the_target_s_there_and_shrinks_on_the_way(
    problem: Problem, plan: Plan
) -> None:
    there = travel_to_step(problem, plan.configuration, plan.target.pose)
    assert there == pytest.approx(plan.target.travel, abs=1e-12)
    x, y, yaw = plan.target.pose
    c, s = math.cos(yaw), math.sin(yaw)
    back = np.array([[c, -s], [s, c]]) @ plan.configuration.direction * 0.1
    farther = travel_to_step(problem, plan.configuration, (x - back[0], y - back[1], yaw))
    assert np.subtract(farther, there) == pytest.approx([0.1, 0.1], abs=1e-12)


def test_an_exploded_run_is_within_no_bounds() -> None:
    assert Ending(0.0, 0.0, 0.0, exploded=False).within(0.0, 0.0, 0.0)
    assert not Ending(0.0, 0.0, 0.0, exploded=True).within(1.0, 1.0, 1.0)
    assert not Ending(0.0, 0.1, 0.0, exploded=False).within(1.0, 0.05, 1.0)


def test_errors_of_worker_processes_arrive_as_they_are(problem: Problem, plan: Plan) -> None:
    with pytest.raises(ArgumentError, match="pybullet"):
        climb_trials(problem, plan, (0, 1), engine="magic", workers=2)


@pytest.mark.parametrize("wrong", [{"position": -1.0}, {"yaw": math.nan}, {"friction": 3.0}])
def test_a_scatter_that_is_none_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ArgumentError, match=next(iter(wrong))):
        Scatter(**wrong)


def test_no_trials_or_workers_are_refused(problem: Problem, plan: Plan) -> None:
    with pytest.raises(ArgumentError, match="at least one trial"):
        climb_trials(problem, plan, ())
    with pytest.raises(ArgumentError, match="workers"):
        climb_trials(problem, plan, (0,), workers=0)
    with pytest.raises(ArgumentError, match="number"):
        climb_trials(problem, plan, (-1,))
    with pytest.raises(ArgumentError, match="sensors"):
        climb_trials(problem, plan, (0,), sensors=Sensors())
    with pytest.raises(ArgumentError, match="wheel servo"):
        climb_trials(problem, plan, (0,), control="magic")  # type: ignore[arg-type]  # what a caller may misspell


def test_the_command_writes_a_row_a_trial(tmp_path: Path) -> None:
    done = CliRunner().invoke(
        app,
        [
            "climb",
            str(FILE),
            "--trials",
            "2",
            "--first",
            "7",
            "--control",
            "pose",
            "--configuration",
            "lateral left",
            "--out",
            str(tmp_path),
        ],
    )
    assert done.exit_code == 0, done.output
    assert "critical wheels up" in done.stdout
    with (tmp_path / "trials.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["number"] for row in rows] == ["7", "8"]
    facts = json.loads((tmp_path / "trials.json").read_text())
    assert (facts["control"], facts["configuration"], facts["engine"]) == (
        "pose",
        "lateral left",
        "mujoco",
    )
    assert (tmp_path / "trials.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--control", "magic"), "one of none, servo"),
        (("--trials", "0"), ">= 1"),
        (("--configuration", "on its head"), "lateral left"),
        (("--engine", "magic"), "pybullet"),
        (("--workers", "0"), ">= 1"),
    ],
)
def test_what_the_command_refuses(arguments: tuple[str, str], words: str) -> None:
    done = CliRunner().invoke(app, ["climb", str(FILE), *arguments])
    assert isinstance(done.exception, ArgumentError)
    assert words in str(done.exception)
