"""Robot files: what is refused and how, builders, changed keys, shipped files and their schema."""

from __future__ import annotations

import json
import math
import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from trajopt.errors import ArgumentError, ProblemError
from trajopt.robots import Robot, robot, robot_names
from trajopt.robots.description import RobotDescription
from trajopt.robots.robot import DATA
from trajopt.schema import json_schema

NEW_WHEEL = {"kind": "fixed", "position": [0.0, 0.0], "radius": 0.1, "width": 0.02, "mass": 0.5}

# robot, changed keys, key that the error names, words of what would be right
REFUSED: list[tuple[str, dict[str, Any], str, str]] = [
    ("loc8", {"body.mass": -1.0}, "body.mass", "greater than 0"),
    ("loc8", {"body.mass": "heavy"}, "body.mass", "number"),
    ("loc8", {"body.mass": math.inf}, "body.mass", "finite"),
    ("loc8", {"body.mass": 5.0}, "body.mass", "more than its parts weigh, 5.76 kg"),
    ("loc8", {"body.mass": None}, "body.mass", "to be given"),
    ("loc8", {"body.colour": "red"}, "body.colour", "the nearest is"),
    ("loc8", {"body.cog": [0.0, 0.0]}, "body.cog", ""),
    ("loc8", {"body.cog": [0.0, 0.0, 0.0]}, "body.cog", "a height of the centre of gravity > 0"),
    ("loc8", {"body.chassis": [0.6, 0.0, 0.1]}, "body.chassis", "three lengths > 0 m"),
    ("powerbot", {"body.footprint": [[0, 0], [0, 1], [1, 0]]}, "body.footprint", "counter-clock"),
    ("powerbot", {"body.footprint": [[0, 0], [1, 0]]}, "body.footprint", "at least 3"),
    ("loc8", {"wheels": []}, "wheels", "at least 1"),
    ("loc8", {"wheels.front-left.kind": "track"}, "wheels[0].kind", "'fixed'"),
    ("loc8", {"wheels.front-left.name": "rear-left"}, "wheels.name", "different names"),
    ("loc8", {"wheels.front-left.rollers": None}, "wheels[0].rollers", "rollers with a Swedish"),
    ("loc8", {"wheels.front-left.kind": "fixed"}, "wheels[0].rollers", "with no other kind"),
    ("loc8", {"wheels.all.rollers.count": 1}, "wheels[0].rollers.count", "greater than or equal"),
    ("loc8", {"wheels.all.rollers.angle": 1.5}, "wheels[0].rollers.angle", "less than or equal"),
    ("loc8", {"wheels.all.rollers.mass": 0.001}, "wheels[0].rollers.mass", "0.01"),
    ("loc8", {"wheels.all.trail": 0.1}, "wheels[0].trail", "a castor, and with no other"),
    ("loc8", {"wheels.all.lateral": 0.1}, "wheels[0].lateral", "only a castor"),
    ("powerbot", {"wheels.castor-left.trail": 0.0}, "wheels[2].trail", "a trail > 0 m"),
    ("loc8-smdw", {"wheels.all.double.minor_radius": 0.2}, "double.minor_radius", "up to the rad"),
    ("loc8-smdw", {"wheels.all.double.depth": 0.06}, "wheels[0].width", "twice double.depth"),
    ("loc8", {"wheels.nobody.radius": 0.1}, "wheels.nobody.radius", "one of all, front-left"),
    ("asoc-4", {"pivots.module-1.wheels": ["module-1-right"]}, "pivots[0].wheels", "at least 2"),
    (
        "asoc-4",
        {"pivots.module-1.wheels": ["module-1-right", "module-2-left"]},
        "pivots.wheels",
        "each once",
    ),
    (
        "asoc-4",
        {"wheels.module-1-right.position": [0.4, 0.0]},
        "pivots.wheels",
        "position is the same pivot",
    ),
    ("powerbot", {"motors.left.wheels": ["nobody"]}, "motors.wheels", "wheels among left"),
    ("powerbot", {"motors.left.wheels": ["right"]}, "motors.wheels", "each once"),
    ("powerbot", {"motors.left.torque": 0.0}, "motors[0].torque", "greater than 0"),
    ("car", {"steering": []}, "steering", "a [[steering]] that names 'front-left'"),
    ("car", {"steering.front.wheels": ["rear-left"]}, "steering.wheels", "among front-left"),
    ("car", {"steering.front.range": [0.1, 0.4]}, "steering[0].range", "from <= 0 <= to"),
    ("loc8", {"skid.effective_track": 0.5}, "skid", "only with fixed wheels"),
    ("loc8", {"source": "here"}, "source", "set by the loader"),
]


@pytest.mark.parametrize(
    ("name", "changes", "key", "words"),
    REFUSED,
    ids=[f"{r[0]}-{next(iter(r[1]))}" for r in REFUSED],
)
def test_wrong_keys_are_refused_by_name(
    name: str, changes: dict[str, Any], key: str, words: str
) -> None:
    with pytest.raises(ProblemError) as caught:
        robot(name, changes)
    assert key in caught.value.key
    assert words in caught.value.expected
    assert "\n" not in str(caught.value)
    assert f"{name}.toml" in str(caught.value)


def test_unknown_names_and_missing_files(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match="asoc-3, asoc-4, car"):
        robot("tank")
    with pytest.raises(ProblemError, match="an existing file"):
        Robot.load(tmp_path / "mine.toml")
    (tmp_path / "mine.toml").write_text("name = [", encoding="utf-8")
    with pytest.raises(ProblemError, match="valid TOML"):
        Robot.load(tmp_path / "mine.toml")


@pytest.mark.parametrize("name", robot_names())
def test_shipped_files_are_right_and_name_their_schema(name: str) -> None:
    text = (DATA / f"{name}.toml").read_text(encoding="utf-8")
    first = text.splitlines()[0]
    assert first.startswith("#:schema ")
    schema = json.loads((DATA / first.removeprefix("#:schema ")).read_text(encoding="utf-8"))
    jsonschema.validate(tomllib.loads(text), schema)
    found = robot(name)
    assert found.name == name
    assert found.description.about
    assert Robot.load(DATA / f"{name}.toml") == found


def test_the_schema_is_that_of_the_code_and_refuses_what_the_loader_refuses() -> None:
    kept = (DATA.parent / "robot.schema.json").read_text(encoding="utf-8")
    assert kept == json_schema(RobotDescription)
    tables = tomllib.loads((DATA / "loc8.toml").read_text(encoding="utf-8"))
    for wrong in ({"colour": "red"}, {"body": {**tables["body"], "mass": -1.0}}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({**tables, **wrong}, json.loads(kept))


def test_every_number_of_a_shipped_file_says_where_it_is_from() -> None:
    """The first time that a key of numbers stands in a file, its line or the one above explains
    it."""
    for name in robot_names():
        lines = (DATA / f"{name}.toml").read_text(encoding="utf-8").splitlines()
        seen: set[str] = set()
        general = any("sizes are chosen" in line.lower() for line in lines[:4])
        for before, line in pairwise(lines):
            key, sign, value = line.partition(" = ")
            if not sign or key in seen or not any(c.isdigit() for c in value.split("#")[0]):
                continue
            if value.startswith('"') or key == "wheels":
                continue
            seen.add(key)
            assert general or "#" in line or before.startswith("#"), f"{name}: {line}"


def test_replace_changes_elements_by_name_or_all_and_leaves_the_original() -> None:
    plain = robot("powerbot")
    changed = plain.replace({"wheels.left.radius": 0.2, "motors.all.torque": 5.0})
    assert [w.radius for w in changed.description.wheels] == [0.2, 0.13, 0.07, 0.07]
    assert changed.motor_array("torque").tolist() == [5.0, 5.0]
    assert plain == robot("powerbot") != changed
    assert changed == robot("powerbot", {"wheels.0.radius": 0.2, "motors.all.torque": 5.0})
    assert plain.replace({"body.yaw_inertia": None}).body.yaw_inertia != plain.body.yaw_inertia
    with pytest.raises(ProblemError, match=r"wheels\.left"):
        plain.replace({"wheels.left": 3.0})


COMMON = {
    "name": "mine",
    "mass": 20.0,
    "cog": (0.0, 0.0, 0.1),
    "chassis": (0.4, 0.3, 0.1),
    "clearance": 0.05,
    "radius": 0.1,
    "width": 0.04,
    "wheel_mass": 0.8,
    "torque": 4.0,
}
ROLLERS = {"rollers": 12, "roller_radius": 0.012}


def test_builders_give_what_a_file_would() -> None:
    castor = {"castor": (-0.2, 0.0), "castor_radius": 0.04, "castor_trail": 0.03}
    sides = {"wheelbase": 0.4, "track": 0.3}
    made = {
        "differential": Robot.differential(**COMMON, track=0.34, **castor, castor_mass=0.2),
        "car": Robot.car(**COMMON, **sides, steering_range=0.4),
        "mecanum": Robot.mecanum(**COMMON, **sides, **ROLLERS),
        "omni": Robot.omni(**COMMON, count=3, distance=0.2, **ROLLERS),
        "swerve": Robot.swerve(**COMMON, **sides),
    }
    kinds = {name: [w.kind for w in one.description.wheels] for name, one in made.items()}
    assert kinds["differential"] == ["fixed", "fixed", "castor"]
    assert kinds["car"] == ["steered", "steered", "fixed", "fixed"]
    assert kinds["mecanum"] == ["swedish"] * 4
    assert kinds["omni"] == ["swedish"] * 3
    assert kinds["swerve"] == ["steered"] * 4
    assert made["differential"].driven == ("left", "right")
    assert made["car"].driven == ("rear-left", "rear-right")
    assert made["car"].description.steering[0].range == (-0.4, 0.4)
    assert all(len(made[n].driven) == len(made[n].wheels) for n in ("mecanum", "omni", "swerve"))
    for one in made.values():
        assert one.motor_array("torque").min() == 4.0
        assert Robot.of(one.description.model_dump(mode="json", exclude_none=True)) == one
    with pytest.raises(ProblemError, match="greater than 0"):
        Robot.swerve(**{**COMMON, "radius": 0.0}, **sides)
