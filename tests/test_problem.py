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
from trajopt.problem import load_problem, problem_schema


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
            "one or two wheels",
        ),
        (
            {"goal.critical": ["front-left", "front-right", "rear-left", "rear-right"]},
            "goal.critical",
            "fix the other",
        ),
        ({"goal.critical": "front-left"}, "goal.critical", "expected an array"),
        ({"goal.pose": 3}, "goal.pose", "expected an array"),
        ({"goal.pose": [1.0, 0.0, 0.0, 0.0]}, "goal.pose", "at most 3 values, not 4"),
        ({"goal": [1]}, "goal", "expected a table"),
        ({"goal.critical": ["wheel 1"]}, "goal.critical[0]", "front-left"),
        ({"space.x": [2.0, 1.0]}, "space.x", "from < to"),
        ({"spline.free": ["p3"]}, "spline.free[0]", "'p1'"),
        ({"spline.free": ["duration"]}, "spline.free", "at least one of"),
        ({"spline.free": ["p2", "duration"]}, "spline.free", "actuator.enabled"),
        ({"limits": {}}, "limits", "at least one limit"),
        ({"spline.duration": 0.0}, "spline.duration", "greater than 0"),
        ({"actuator.dead_zone": 31.0}, "actuator.dead_zone", "below saturation"),
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
    changed = scenario.replace({"goal.wheels": [0, 0, 0, 1]}, actuator={"enabled": True})
    assert changed.goal.wheels == (0, 0, 0, 1)
    assert changed.actuator.enabled
    assert changed.actuator.saturation == scenario.actuator.saturation
    assert not scenario.actuator.enabled
    assert scenario.replace(**{"goal.wheels": [0, 0, 0, 1]}).goal == changed.goal


def test_replace_takes_arrays_and_sections(scenario):
    changed = scenario.replace(
        {"goal.wheels": np.ones(4), "limits.speed": np.int64(2)}, scene=scenario.scene
    )
    assert changed.goal.wheels == (1, 1, 1, 1)
    assert changed.limits.speed == 2
    assert changed.scene == scenario.scene


def test_schema_file_is_current_and_accepts_the_problems():
    text = (ROOT / "problems/problem.schema.json").read_text()
    assert text == problem_schema(), "run: make schema"
    schema = json.loads(text)
    for name in SMDW:
        jsonschema.validate(
            tomllib.loads((ROOT / f"problems/smdw/{name}.toml").read_text()), schema
        )


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
