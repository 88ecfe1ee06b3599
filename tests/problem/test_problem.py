"""Problem files: what is read, what is rejected, and in which words."""

from __future__ import annotations

import json
import pickle
import tomllib

import jsonschema
import numpy as np
import pytest
from smdw_problems import ROOT, SMDW, smdw_problem

from trajopt.errors import (
    ArgumentError,
    InfeasibleError,
    MissingDependencyError,
    ProblemError,
    SimulationError,
)
from trajopt.pipeline import solve
from trajopt.problem import load_problem, problem_schema
from trajopt.systems.smdw.thesis import DRIVES

FILES = sorted(
    file for file in (ROOT / "problems").glob("*/*.toml") if file.parent.name != "sweeps"
)
POST = {"name": "post", "kind": "circle", "height": 1.0, "centre": [9.0, 9.0], "radius": 0.1}
_FORM = {"direction": 0.0, "length": 1.0, "height": 0.1, "rounding": 0.3}
RAMP = {"grade": 0.2, "ramps": [{"foot": [9.0, 9.0], **_FORM}]}


@pytest.mark.parametrize("name", SMDW)
def test_files_load_and_keep_their_numbers(name):
    raw = tomllib.loads((ROOT / f"problems/smdw/{name}.toml").read_text())
    problem = smdw_problem(name)
    assert list(problem.goal.pose) == raw["goal"]["pose"]
    assert list(problem.goal.critical) == raw["goal"]["critical"]
    assert problem.source.endswith(f"{name}.toml")


def test_there_are_eight():
    assert len(SMDW) == 8


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"goal.wheel": [0, 0, 0, 0]}, "goal.wheel", "nearest is 'wheels'"),
        ({"limit.speed": 1.0}, "limit", "nearest is 'limits'"),
        ({"limits.speed": -1.0}, "limits.speed", "greater than 0"),
        ({"limits.speed": float("nan")}, "limits.speed", "finite number"),
        ({"limits.speed": "fast"}, "limits.speed", "number"),
        ({"limits.speed": "1.0"}, "limits.speed", "number"),
        ({"limits.speed": True}, "limits.speed", "number"),
        ({"goal.pose": [9.0, 0.0, 0.0]}, "goal.pose", "inside space"),
        ({"goal.pose": [0.0, 0.0, 1.0]}, "goal.pose", "different from start"),
        ({"goal.pose": [1.0, 0.0]}, "goal.pose[2]", "this key"),
        ({"goal.critical": ["front-left", "rear-right"]}, "goal.critical", "diagonal"),
        ({"goal.critical": ["front-right", "rear-left"]}, "goal.critical", "diagonal"),
        ({"goal.critical": ["front-left", "front-left"]}, "goal.critical", "each wheel once"),
        ({"goal.critical": []}, "goal.critical", "at least 1"),
        (
            {"goal.critical": ["front-left", "front-right", "rear-left"]},
            "goal.critical",
            "at most two",
        ),
        (
            {"goal.critical": ["front-left", "front-right", "rear-left", "rear-right"]},
            "goal.critical",
            "turn independently",
        ),
        ({"goal.critical": "front-left"}, "goal.critical", "expected an array"),
        ({"goal.pose": 3}, "goal.pose", "expected an array"),
        ({"goal.pose": [1.0, 0.0, 0.0, 0.0]}, "goal.pose", "at most 3 values, not 4"),
        ({"goal": [1]}, "goal", "expected a table"),
        ({"goal.critical": ["wheel 1"]}, "goal.critical", "front-left"),
        ({"space.x": [2.0, 1.0]}, "space.x", "from < to"),
        ({"spline.free": ["p3"]}, "spline.free[0]", "'p1'"),
        ({"spline.free": ["duration"]}, "spline.free", "at least one of"),
        ({"spline.free": ["p2", "duration"]}, "spline.free", "[actuator]"),
        ({"limits": {}}, "limits", "at least one limit"),
        ({"actuator": {**DRIVES, "duration": 0.0}}, "actuator.duration", "greater than 0"),
        (
            {"actuator": {**DRIVES, "duration": 1.0, "dead_zone": 31.0}},
            "actuator.dead_zone",
            "below saturation",
        ),
        ({"goal.wheels": None}, "goal.wheels", "both given or both left out"),
        ({"goal.wheels": [0, 0]}, "goal.wheels", "4 angles, one a wheel that rolls (front-left"),
        ({"start.wheels": [0]}, "start.wheels", "4 angles"),
        ({"start.pose": None}, "start.pose", "x, y, yaw"),
        ({"goal.wheels": None, "goal.critical": None}, "objective.kind", "duration"),
        ({"limits.wheel_speed": [1.0, 2.0]}, "limits.wheel_speed", "or 4: one a wheel"),
        ({"limits.slip_share": 1.5}, "limits.slip_share", "less than or equal to 1"),
        ({"limits.variant": "thesis"}, "limits.variant", "given [path]"),
        ({"ground": {"friction": 0.8, **RAMP}}, "ground.ramps", "level ground"),
        ({"ground.friction": None}, "ground.friction", "this key"),
        ({"obstacles.step.widht": 1.0}, "obstacles[0].step.widht", "nearest is 'width'"),
        ({"obstacles": [{**POST, "lenght": 1.0}]}, "obstacles[0].circle.lenght", "is 'height'"),
        ({"obstacles": [POST, POST]}, "obstacles.name", "different names"),
        ({"obstacles.wall.height": 1.0}, "obstacles.wall.height", "one of all, step"),
        ({"robot.name": "powerbot"}, "start.wheels", "2 angles"),
        ({"robot.motors.all.torqe": 1.0}, "robot.motors[0].torqe", "'torque'"),
        ({"robot.motors.front.torque": 1.0}, "robot.motors.front.torque", "front-left"),
        ({"robot.wheels.front-left.radius": -1.0}, "robot.wheels[0].radius", "greater than 0"),
        ({"robot.file": "nowhere.toml"}, "robot.file", "existing file"),
        ({"path": {"points": [[0, 0], [1, 1]]}}, "path", "take out [path]"),
        ({"spline": None}, "goal.wheels", "add [spline]"),
        ({"climb": {"step": "step", "gap": 0.02}}, "climb", "take out [climb]"),
        ({"robot.name": "r2d2"}, "robot.name", "loc8"),
        ({"limits.speed.x": 1.0}, "limits.speed.x", "below a table"),
        ({"source": "x"}, "source", "no such key"),
    ],
)
def test_one_line_names_file_key_value_and_what_is_right(scenario, change, key, words):
    with pytest.raises(ProblemError) as caught:
        scenario.replace(change)
    message = str(caught.value)
    assert "\n" not in message
    assert caught.value.key == key
    assert words in message
    assert "scenario_1_forward35.toml" in message
    assert f"{key} = " in message


def test_missing_section_is_named(tmp_path):
    text = (ROOT / "problems/smdw/table_5_3.toml").read_text().replace("[goal]", "[gaol]")
    file = tmp_path / "p.toml"
    file.write_text(text)
    with pytest.raises(ProblemError, match="goal"):
        load_problem(file)


@pytest.mark.parametrize(
    ("content", "words"), [(None, "existing"), (b"title = ", "valid TOML"), (b"\xff\xfe", "UTF-8")]
)
def test_unreadable_files(tmp_path, content, words):
    file = tmp_path / "p.toml"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(ProblemError, match=words):
        load_problem(file)


def test_replace_takes_sections_and_dotted_keys(scenario):
    changed = scenario.replace({"goal.wheels": [0, 0, 0, 1]}, limits={"speed": 0.5})
    assert changed.goal.wheels == (0, 0, 0, 1)
    assert changed.limits_section.speed == 0.5
    assert changed.limits_section.tip == scenario.limits_section.tip
    assert scenario.limits_section.speed == 1.0
    assert scenario.replace(**{"goal.wheels": [0, 0, 0, 1]}).goal == changed.goal


def test_replace_takes_arrays_and_sections(scenario):
    changed = scenario.replace(
        {"goal.wheels": np.ones(4), "limits.speed": np.int64(2)}, space=scenario.space
    )
    assert changed.goal.wheels == (1, 1, 1, 1)
    assert changed.limits_section.speed == 2
    assert changed.space == scenario.space


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_files_name_the_schema_and_pass_it(file):
    text = file.read_text()
    first = text.splitlines()[0]
    assert first.startswith("#:schema ")
    schema = file.parent / first.removeprefix("#:schema ")
    assert schema.read_text() == problem_schema(), "run: make schema"
    jsonschema.validate(tomllib.loads(text), json.loads(schema.read_text()))


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_every_file_solves_or_declares_that_it_is_infeasible(file):
    solution = solve(load_problem(file))
    assert solution.holds == (solution.problem.infeasible is None), solution.status
    if solution.problem.infeasible:
        assert solution.problem.infeasible in solution.status


@pytest.mark.parametrize(
    "error",
    [
        ArgumentError("speed", -1, "a speed > 0"),
        ProblemError("a.toml", "limits.speed", -1, "a speed > 0"),
        InfeasibleError("slip", 1.5, "it is ice"),
        MissingDependencyError("mujoco", "simulate", "climbing"),
        SimulationError("mujoco: it left physics"),
    ],
    ids=lambda e: type(e).__name__,
)
def test_errors_come_back_from_worker_processes(error):
    back = pickle.loads(pickle.dumps(error))
    assert type(back) is type(error)
    assert str(back) == str(error)
    assert back.__dict__ == error.__dict__


def test_replace_leaves_the_callers_tables_alone(scenario):
    table = {"name": "post", "kind": "circle", "height": 1.0, "centre": [9.0, 0.0], "radius": 0.1}
    moved = scenario.replace({"obstacles": [table], "obstacles.0.radius": 0.2})
    assert moved.obstacles[0].radius == 0.2
    assert table["radius"] == 0.1
