"""Every key of a problem file acts: changing it changes what ``solve`` gives, or is refused by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import numpy as np
import pytest
from pydantic import BaseModel

from trajopt.errors import ProblemError
from trajopt.objectives.terminal import terminal_objective
from trajopt.optimize.given import Given
from trajopt.pipeline import Solution, solve
from trajopt.problem import Problem, load_problem
from trajopt.problem.extensions import SECTIONS, entry
from trajopt.simulate.scene import stage

ROOT = Path(__file__).parents[2] / "problems"
EXEMPT = {"title"}  # for people only
FILES = {
    "search": "smdw/scenario_1_lateral.toml",
    "climb": "smdw/step_5cm.toml",
    "thesis": "powerbot/experiment_3.toml",
    "profile": "powerbot/experiment_6.toml",
}
DRIVE = """
title = "Drive"
[robot]
name = "small-differential"
[path]
points = [[0.0, 0.0], [1.5, 0.4], [3.0, 0.0]]
[[obstacles]]
name = "thing"
kind = "wall"
start = [1.5, 2.0]
end = [1.5, 3.0]
thickness = 0.1
height = 1.0
[ground]
friction = 0.4
grade = 0.5
[[ground.ramps]]
foot = [0.8, 0.0]
direction = 0.0
length = 1.0
height = 0.05
rounding = 0.4
[limits]
speed = 0.8
acceleration = 0.6
deceleration = 0.9
slip = true
"""
STEP = {
    "name": "s", "kind": "step", "height": 0.1, "place": [3.1, 0.0], "direction": 0.0, "width": 2.0, "depth": 1.0
}
CIRCLE = {"name": "c", "kind": "circle", "height": 0.1, "centre": [3.4, 0.0], "radius": 0.3}
SQUARE = [[3.1, -0.5], [4.0, -0.5], [4.0, 0.5], [3.1, 0.5]]
POLYGON = {"name": "p", "kind": "polygon", "height": 0.1, "corners": SQUARE}
FLAT_OMNI = {"robot.name": "omni-3", "ground.ramps": None, "ground.grade": None}
PATH = "path.points", [[0.0, 0.0], [1.5, 0.4], [3.0, 0.0]]


def _at_default(problem: Problem) -> Solution:
    """The search's own default point, judged and timed."""
    start = terminal_objective(problem).default
    return solve(problem, optimizer=Given(), x0=start)


def _speeds(problem: Problem) -> list[float]:
    trajectory = solve(problem).trajectory
    assert trajectory is not None
    times = np.linspace(0, trajectory.duration, 7)
    return [trajectory.duration, *trajectory.at(times).twist[:, 0].tolist()]


def _places(problem: Problem) -> list[float]:
    path = problem.path
    return [float(v) for u in np.linspace(path.start, path.end, 9) for v in path.position([u])[0]]


def _wheels(problem: Problem) -> list[float]:
    trajectory = solve(problem).trajectory
    assert trajectory is not None
    return [float(v) for v in trajectory.at(trajectory.duration).wheel_angles[0]]


def _plans(problem: Problem) -> list[Any]:
    found = solve(problem)
    return [
        [s.problem.title, s.path.points.tolist()] for s in (found, *found.alternatives) if s.path
    ]


OUTPUTS: dict[str, Callable[[Problem], Any]] = {
    "speeds": _speeds,
    "faults": lambda p: solve(p).faults,
    "places": _places,
    "wheels": _wheels,
    "physics": lambda p: repr(stage(p.scene)),
    "cost": lambda p: _at_default(p).cost,
    "tolerated": lambda p: len(_at_default(p).faults),
    "found": lambda p: solve(p, optimizer="lattice").control_points.tolist(),
    "bounds": lambda p: terminal_objective(p).bounds.tolist(),
    "plans": _plans,
    "notes": lambda p: {k: repr(v) for k, v in (solve(p).details.notes or {}).items()},
}


@dataclass(frozen=True)
class Row:
    """``key`` of the schema; ``dotted`` is changed to each of ``values`` in the ``file`` after the
    changes of ``base``: the ``output`` differs, or the second is ``refused`` with these words."""

    key: str
    file: str
    values: tuple[Any, Any]
    output: str = ""
    dotted: str = ""
    base: dict[str, Any] = field(default_factory=dict)
    refused: str = ""


def drive(key: str, a: Any, b: Any, output: str = "speeds", **more: Any) -> Row:
    return Row(key, "drive", (a, b), output, **more)


def search(key: str, a: Any, b: Any, output: str, **more: Any) -> Row:
    return Row(key, "search", (a, b), output, **more)


def standing(kind: str, table: dict[str, Any], key: str, a: Any, b: Any, output: str) -> Row:
    return Row(
        f"obstacles.{kind}.{key}", "drive", (a, b), output, f"obstacles.0.{key}",
        {"obstacles": [table]},
    )  # fmt: skip


WALL = {"name": "w", "kind": "wall", "height": 1.0, "start": [3.1, -1.0], "end": [3.1, 1.0], "thickness": 0.1}
ACTUATED = {"actuator": {"duration": 5.0, "saturation": 30.0, "dead_zone": 2.3}}
UNMET = {"encounters": None}
TURNED = {**FLAT_OMNI, "path.heading": "free", "path.headings": [0.0, 0.5, 1.0]}
ROWS = (
    drive("infeasible", None, "it is said to be", "faults"),
    drive("robot.name", "small-differential", "powerbot", "wheels"),
    drive("robot.file", None, "nowhere.toml", refused="an existing file", base={"robot.name": None},
          dotted="robot.file"),
    drive("ground.friction", 0.4, 0.1),
    drive("ground.grade", 0.3, 0.01, "faults"),
    drive("ground.ramps.foot", [0.8, 0.0], [0.3, 0.0], dotted="ground.ramps.0.foot"),
    drive("ground.ramps.direction", 0.0, 0.7, dotted="ground.ramps.0.direction"),
    drive("ground.ramps.length", 1.0, 2.0, dotted="ground.ramps.0.length"),
    drive("ground.ramps.height", 0.05, 0.1, dotted="ground.ramps.0.height"),
    drive("ground.ramps.rounding", 0.4, 0.2, dotted="ground.ramps.0.rounding"),
    *(standing("step", STEP, *row) for row in (
        ("name", "s", "t", "faults"), ("kind", "step", "post", "refused"),
        ("height", 0.1, 0.2, "physics"), ("place", [3.1, 0.0], [3.6, 0.0], "faults"),
        ("direction", 0.0, 3.1, "faults"), ("width", 2.0, 0.1, "physics"),
        ("depth", 1.0, 0.5, "physics"))),
    *(standing("wall", WALL, *row) for row in (
        ("name", "w", "v", "faults"), ("kind", "wall", "post", "refused"),
        ("height", 1.0, 0.2, "physics"), ("start", [3.1, -1.0], [5.3, -1.0], "physics"),
        ("end", [3.1, 1.0], [5.3, 1.0], "physics"), ("thickness", 0.1, 0.5, "physics"))),
    *(standing("circle", CIRCLE, *row) for row in (
        ("name", "c", "d", "faults"), ("kind", "circle", "post", "refused"),
        ("height", 0.1, 0.2, "physics"), ("centre", [3.4, 0.0], [5.0, 0.0], "faults"),
        ("radius", 0.3, 0.1, "faults"))),
    *(standing("polygon", POLYGON, *row) for row in (
        ("name", "p", "q", "faults"), ("kind", "polygon", "post", "refused"),
        ("height", 0.1, 0.2, "physics"),
        ("corners", SQUARE, [[5, 0], [6, 0], [6, 1]], "faults"))),
    drive("limits.speed", 0.8, 0.4),
    drive("limits.safety_speed", None, 0.3),
    drive("limits.yaw_rate", None, 0.2),
    drive("limits.wheel_speed", 8.0, [8.0, 4.0]),
    drive("limits.wheel_acceleration", 5.0, [5.0, 2.0]),
    drive("limits.slip", True, False, base={"ground.friction": 0.05}),
    drive("limits.slip_share", None, 0.1),
    drive("limits.acceleration", 0.6, 0.3),
    drive("limits.deceleration", 0.9, 0.3),
    drive("limits.tip", False, True, base={"robot.body.cog": [-0.04, 0.0, 1.5], "limits.slip": False}),
    Row("limits.variant", "profile", (None, "thesis"), "notes", base={"profile": None}),
    drive("start.pose", None, [0.0, 0.0, 0.0], refused="pose", dotted="start.pose"),
    drive("start.wheels", [0.0, 0.0], [1.0, 0.0], "wheels"),
    search("goal.pose", [2.46, 0.76, -1.57], [2.4, 0.7, -1.5], "found"),
    search("goal.wheels", [0.0] * 4, [0.5, 0.0, 0.0, 0.0], "found"),
    search("goal.critical", ["front-left", "rear-left"], ["front-right", "rear-right"], "found"),
    search("space.x", [0.0, 3.0], [0.0, 2.6], "bounds"),
    search("space.y", [-1.5, 1.5], [-1.0, 1.5], "bounds"),
    search("spline.free", ["p2"], ["p1", "p2"], "bounds"),
    search("objective.kind", "terminal", "duration", "cost"),
    search("objective.pose_gains", [3.0, 0.1, 2.5], [1.0, 0.1, 1.0], "cost", base=ACTUATED),
    search("objective.wheel_gain", 12.5, 10.0, "cost"),
    search("objective.wheel_period", "2pi", "pi", "cost", base={"goal.wheels": [2.5, 0.0, 2.5, 0.0]}),
    search("objective.wheel_tolerance", 1e-3, 4.0, "tolerated"),
    search("objective.pose_tolerance", 1e-3, 4.0, "tolerated", base=ACTUATED),
    search("actuator.duration", 5.0, 2.0, "cost", base=ACTUATED),
    search("actuator.saturation", 30.0, 9.0, "cost", base=ACTUATED),
    search("actuator.dead_zone", 2.3, 0.0, "cost", base=ACTUATED),
    drive("path.points", PATH[1], [[0.0, 0.0], [1.0, 0.4], [3.0, 0.0]], "places"),
    drive("path.file", None, "nowhere.csv", refused="a CSV file", base={"path.points": None}),
    drive("path.heading", "along", "free", "refused", base=FLAT_OMNI, refused="headings"),
    drive("path.headings", [0.0, 0.5, 1.0], [0.0, 0.0, 1.0], base=TURNED),
    drive("path.spacing", "chord", "uniform", "places", base={
        "path.points": [[0.0, 0.0], [0.5, 0.4], [3.0, 0.0]]}),
    drive("path.start_heading", 0.0, 0.5, "places", base={"path.start_rate": 1.0}),
    drive("path.start_rate", 1.0, 2.0, "places", base={"path.start_heading": 0.3}),
    drive("path.goal_heading", 0.0, 0.5, "places", base={"path.goal_rate": 1.0}),
    drive("path.goal_rate", 1.0, 2.0, "places", base={"path.goal_heading": -0.3}),
    Row("profile.places", "profile", ([0.0, 13.0], [0.0, 6.0]), "speeds",
        base={"profile.speeds": [0.5, 1.0], "profile.places": [0.0, 13.0]}),
    Row("profile.speeds", "profile", ([0.5, 1.0], [0.2, 0.3]), "speeds",
        base={"profile.speeds": [0.5, 1.0], "profile.places": [0.0, 13.0]}),
    Row("profile.manner", "profile", ("below", "least_squares"), "speeds",
        base={"profile.speeds": [1.0, 1.0], "profile.places": [0.0, 13.0]}),
    Row("climb.step", "climb", ("step", "wall"), refused="step"),
    Row("climb.gap", "climb", (0.02, 0.05), "plans"),
    Row("climb.rank", "climb", ("duration", "margin"), "plans"),
    Row("climb.alphas", "climb", (None, [0.7]), "plans"),
    Row("encounters.appears", "thesis", (9.95, 12.0), "notes", "encounters.0.appears"),
    Row("encounters.clears_after", "thesis", (2.74, 6.0), "notes", "encounters.1.clears_after"),
    Row("encounters.distance", "thesis", (0.6, 0.3), "notes", "encounters.0.distance"),
    *(Row(f"printed.{key}", "thesis", (1.0, 2.0), "notes", base=UNMET) for key in (
        "length", "time", "unscaled_speed", "unscaled_acceleration", "unscaled_deceleration",
        "sliding_speed")),
    Row("printed.fitted", "thesis", (True, False), "notes", base=UNMET),
    Row("printed.residuals", "thesis", ({"length": 0.1}, {"length": 0.2}), "notes",
        base=UNMET),
)  # fmt: skip


def _models(annotation: Any) -> list[type[BaseModel]]:
    """Sections in an annotation: itself, what it holds, or all of a union."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if get_origin(annotation) in (tuple, Union, UnionType, Annotated):
        parts = [a for a in get_args(annotation) if a is not NoneType and a is not Ellipsis]
        return [model for part in parts for model in _models(part)]
    return []


def _keys(model: type[BaseModel], before: str = "") -> Iterator[str]:
    for name, info in model.model_fields.items():
        key = before + (info.alias or name)
        section = key if key in SECTIONS else ""
        models = [entry(section).SCHEMAS[section]] if section else _models(info.annotation)
        if name == "source":
            continue
        if not models:
            yield key
        for inner in models:
            kind = (
                get_args(inner.model_fields["kind"].annotation)
                if "kind" in inner.model_fields
                else ()
            )
            one_of_many = kind and len(models) > 1
            yield from _keys(inner, f"{key}.{kind[0]}." if one_of_many else f"{key}.")


@pytest.fixture(scope="module")
def problems(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Problem]:
    file = tmp_path_factory.mktemp("drive") / "drive.toml"
    file.write_text(DRIVE, encoding="utf-8")
    return lambda name: load_problem(file if name == "drive" else ROOT / FILES[name])


def test_every_key_has_a_row() -> None:
    keys, rows = set(_keys(Problem)) - EXEMPT, {row.key for row in ROWS}
    # what a robot file holds may stand below [robot]: tests/robots/test_keys.py has its rows
    keys = {key for key in keys if not key.startswith("robot.") or key in rows}
    assert keys - rows == set(), "no row shows what these keys do"
    assert rows - keys == set(), "rows of keys that do not exist"


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.key)
def test_it_acts_or_is_refused(row: Row, problems: Callable[[str], Problem]) -> None:
    first, second = ({**row.base, row.dotted or row.key: value} for value in row.values)
    whole = problems(row.file)
    if row.refused or row.output == "refused":
        with pytest.raises(ProblemError, match=row.refused or "post"):
            whole.replace(second)
        return
    shown = OUTPUTS[row.output]
    assert shown(whole.replace(first)) != shown(whole.replace(second))
