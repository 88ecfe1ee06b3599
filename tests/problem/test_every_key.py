"""Every key of every section acts: another value changes what a user gets, or is refused by name.

A key of the schema without a row here fails; only titles and sentences for people are exempt.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, get_args

import numpy as np
import pytest
from PIL import Image
from pydantic import BaseModel
from smdw_problems import ROOT

from trajopt.errors import ArgumentError, ProblemError
from trajopt.optimize.base import Budget
from trajopt.paths.path import Path as Curve
from trajopt.paths.segments import Arc, Clothoid, Straight
from trajopt.pipeline import solve
from trajopt.problem import Problem, load_problem
from trajopt.problem.extensions import SECTIONS, entry
from trajopt.report.path_picture import path_figure
from trajopt.robots.robot import DATA
from trajopt.schema import _models, validated
from trajopt.solution import Solution

EXEMPT = {"title", "robot.about"}  # for people
PROBLEMS = ROOT / "problems"
STRAIGHT: dict[str, Any] = {
    "title": "straight on",
    "robot": {"name": "powerbot"},
    "path": {"points": [[0.0, 0.0], [1.0, 0.1], [2.0, 0.0]]},
    "limits": {"speed": 1.0, "acceleration": 0.5, "deceleration": 0.8, "slip": True, "tip": True},
    "ground": {"friction": 0.3},
    "obstacles": [
        {"name": "block", "kind": "step", "height": 0.1, "place": [2.0, 0.3], "direction": 1.57,
         "width": 0.5, "depth": 0.3},
        {"name": "wall", "kind": "wall", "height": 1.0, "start": [1.0, 0.3], "end": [1.5, 1.0],
         "thickness": 0.1},
        {"name": "post", "kind": "circle", "height": 1.0, "centre": [0.5, -0.3], "radius": 0.1},
        {"name": "leaf", "kind": "door", "height": 1.0, "hinge": [0.5, 1.0], "direction": -1.6,
         "angle": 0.1, "width": 0.8, "thickness": 0.05},
        {"name": "box", "kind": "polygon", "height": 1.0,
         "corners": [[2.2, -0.5], [2.6, -0.5], [2.6, -0.2], [2.2, -0.2]]},
    ],
}  # fmt: skip
DRIVES = {"actuator": {"duration": 2.5, "saturation": 20.0, "dead_zone": 1.0}}
FREE = {"path.heading": "free", "path.headings": [0.0, 0.2, 0.0], "robot": {"name": "loc8"}}
CAR = {
    "robot": {"name": "car"},
    "path.points": [[0.0, 0.0], [1.5, 0.0], [3.0, 0.4], [4.5, 0.4]],
    "limits.speed_zones": [{"start": 1.0, "end": 2.0, "speed": 0.5}],
    "obstacles": None,
}
SEGMENTS: list[dict[str, Any]] = [
    {"kind": "straight", "length": 0.3},
    {"kind": "clothoid", "length": 0.3, "start": 0.0, "end": 0.4},
    {"kind": "arc", "radius": 2.5, "angle": 0.1},
    {"kind": "clothoid", "length": 0.3, "start": 0.4, "end": 0.0},
]
PIECES: list[dict[str, Any]] = [
    {"points": [[0.0, 0.0], [0.6, 0.1], [1.0, 0.1]], "start_heading": 0.0, "start_rate": 1.0,
     "goal_heading": 0.0, "goal_rate": 1.0},
    {"drive": "backward", "start": [1.0, 0.1, np.pi], "segments": SEGMENTS},
]  # fmt: skip
PROFILE = {"profile": {"places": [0.0, 1.5], "speeds": [0.3, 0.4]}}


@cache
def bases() -> dict[str, Problem]:
    """Problems in which keys bind."""
    straight = Problem.model_validate({**STRAIGHT})
    lateral = load_problem(PROBLEMS / "smdw" / "scenario_1_lateral.toml")
    return {
        "search": lateral,
        "drives": lateral.replace({**DRIVES, "obstacles": None}),
        "path": straight,
        "free": straight.replace(FREE),
        "profile": straight.replace(PROFILE),
        "segments": straight.replace({"path": {"start": [0.0, 0.0, 0.1], "segments": SEGMENTS}}),
        "pieces": straight.replace({"path": {"pieces": PIECES}}),
        "climb": load_problem(PROBLEMS / "smdw" / "step_5cm.toml"),
        "car": straight.replace(CAR),
        "icy": on_ground(straight, friction_along={"places": [0.0, 1.5], "values": [0.3, 0.02]}),
        "spots": on_ground(
            straight, friction_map={"file": "spots.npy", "spacing": 1.0, "origin": [-2.0, -2.0]}
        ),
        "plane": on_ground(straight, plane={"slope": 0.05, "direction": 0.3}, friction=0.3),
        "map": on_ground(
            straight,
            height_map={"file": "heights.npy", "spacing": 1.0, "origin": [-2.0, -2.0]},
            **HILLY,
        ),
        "mesh": on_ground(straight, mesh={"file": "heights.stl", "spacing": 0.5}, **HILLY),
        "rough": on_ground(
            straight,
            rough={"sigma": 0.02, "correlation": 1.0, "size": 8.0, "spacing": 0.2, "seed": 5},
            **HILLY,
        ),
        "ramp": load_problem(PROBLEMS / "powerbot" / "experiment_4.toml"),
        "encounters": load_problem(PROBLEMS / "powerbot" / "experiment_3.toml"),
        "cells": on_ground(straight, friction=0.3).replace({"map.file": "free.yaml"}),
        "yard": on_ground(straight, friction=0.3).replace({"space": YARD}),
        "grey": on_ground(straight, friction=0.3).replace({"map.file": "grey.yaml"}),
        "ring": on_ground(straight, friction=0.3).replace({"obstacles": [RING]}),
        "shapes": on_ground(straight, friction=0.3).replace({"obstacles": [SHAPES]}),
    }


YARD = {
    "corners": [[-2.0, -2.0], [4.0, -2.0], [4.0, 2.0], [-2.0, 2.0]],
    "holes": [[[0.5, 1.0], [1.0, 1.0], [1.0, 1.5]]],
}
RING = {
    "name": "ring", "kind": "polygon", "height": 1.0,
    "corners": [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]],
    "holes": [[[-3.0, -3.0], [4.0, -3.0], [4.0, 3.0], [-3.0, 3.0]]],
}  # fmt: skip
SHAPES = {"name": "shelves", "kind": "polygon", "height": 1.0, "file": "far.csv"}
HILLY = {"friction": 0.3, "grade": 1.0}


@cache
def folder() -> Path:
    """A folder with files of heights and frictions."""
    place = Path(mkdtemp())
    y, x = np.mgrid[-2.0:4.0, -2.0:4.0]
    for name, height in (("heights", 0.05 * np.sin(x) + 0.03 * y), ("other", 0.2 + 0.02 * y * x)):
        np.save(place / f"{name}.npy", height)
        lines = ["solid"]
        for i, j in np.ndindex(5, 5):
            for corners in (((0, 0), (0, 1), (1, 1)), ((0, 0), (1, 1), (1, 0))):
                at = [(i + a, j + b) for a, b in corners]
                lines += [f"vertex {x[c]} {y[c]} {height[c]}" for c in at]
        (place / f"{name}.stl").write_text("\n".join(lines), encoding="utf-8")
    for name, grey in (("free", 254), ("grey", 205)):
        Image.fromarray(np.full((40, 60), grey, dtype=np.uint8)).save(place / f"{name}.pgm")
        keys = f"image: {name}.pgm\nresolution: 0.1\norigin: [-2.0, -2.0, 0.0]\nnegate: 0\n"
        keys += "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
        (place / f"{name}.yaml").write_text(keys, encoding="utf-8")
    for name, x in (("far", 9), ("near", 1)):
        rows = [f"1,{x + i},{j}" for i, j in ((0, 0), (1, 0), (1, 1))]
        (place / f"{name}.csv").write_text("\n".join(["polygon,x,y", *rows]), encoding="utf-8")
    np.save(place / "spots.npy", 0.02 + 0.02 * np.abs(np.cos(x)) + 0.01 * (y + 2))
    return place


def on_ground(problem: Problem, **ground: Any) -> Problem:
    """The problem on another ground, as of a file in the folder."""
    tables = problem.replace({"obstacles": None}).tables()
    return validated(Problem, {**tables, "ground": ground}, str(folder() / "p.toml"))


def motion(s: Solution) -> Any:
    """When the robot is where, and how its wheels stand."""
    if s.trajectory is None:
        return s.faults
    state = s.trajectory.at(np.linspace(0.0, s.trajectory.duration, 9))
    return s.duration, state.pose.tolist(), state.spin_angles.tolist()


def told(s: Solution) -> Any:
    """What is said of it."""
    return s.status


def margins(s: Solution) -> Any:
    return s.margins


def cost(s: Solution) -> Any:
    return s.cost


def notes(s: Solution) -> Any:
    """What the system of a section adds."""
    return None if s.details is None else s.details.notes


def picture(s: Solution) -> Any:
    """What the legend of the picture says."""
    assert s.path is not None
    return path_figure(s, s.path).axes[0].get_legend_handles_labels()[1]


@dataclass(frozen=True)
class Row:
    """Another ``value`` in the problem ``base`` changes ``output``, or is refused with words;
    ``key`` where one other than the row's is set."""

    base: str
    value: Any
    output: Callable[[Solution], Any] | str
    key: str | None = None


ROWS = {
    "infeasible": Row("search", "it is not", told),
    "robot.name": Row("free", "loc8-smdw", told),
    "robot.file": Row("path", str(DATA / "small-differential.toml"), motion),
    "robot.body": Row("search", [0.0, 0.0, 0.4], margins, "robot.body.cog"),
    "robot.wheels": Row("search", 0.12, motion, "robot.wheels.all.radius"),
    "robot.motors": Row("search", 6.0, motion, "robot.motors.all.speed"),
    "robot.pivots": Row("search", 1.0, "robot.pivots", "robot.pivots.none.mass"),
    "robot.steering": Row("search", [0.0, 1.0], "robot.steering", "robot.steering.none.range"),
    "robot.skid": Row("search", 0.5, "only with fixed wheels", "robot.skid.effective_track"),
    "ground.friction": Row("path", 0.03, motion),
    "ground.friction_along.places": Row("icy", [0.0, 1.0], motion),
    "ground.friction_along.values": Row("icy", [0.3, 0.04], motion),
    "ground.friction_map.file": Row("spots", "other.npy", motion),
    "ground.friction_map.spacing": Row("spots", 1.5, motion),
    "ground.friction_map.origin": Row("spots", [-2.0, -2.5], motion),
    "ground.friction_map.white": Row("spots", 1.0, "none: spots.npy holds"),
    "ground.plane.slope": Row("plane", 0.1, motion),
    "ground.plane.direction": Row("plane", 1.0, motion),
    "ground.height_map.file": Row("map", "other.npy", motion),
    "ground.height_map.spacing": Row("map", 1.2, motion),
    "ground.height_map.origin": Row("map", [-2.3, -2.0], motion),
    "ground.height_map.relief": Row("map", 1.0, "none: heights.npy holds"),
    "ground.mesh.file": Row("mesh", "other.stl", motion),
    "ground.mesh.spacing": Row("mesh", 0.4, motion),
    "ground.rough.sigma": Row("rough", 0.01, motion),
    "ground.rough.correlation": Row("rough", 1.5, motion),
    "ground.rough.size": Row("rough", 9.0, motion),
    "ground.rough.spacing": Row("rough", 0.25, motion),
    "ground.rough.flat_radius": Row("rough", 1.5, motion),
    "ground.rough.seed": Row("rough", 6, motion),
    "ground.ramps.foot": Row("ramp", [-44.63, -31.0], motion, "ground.ramps.0.foot"),
    "ground.ramps.direction": Row("ramp", -1.5, motion, "ground.ramps.0.direction"),
    "ground.ramps.length": Row("ramp", 4.0, motion, "ground.ramps.0.length"),
    "ground.ramps.height": Row("ramp", 0.3, motion, "ground.ramps.0.height"),
    "ground.ramps.rounding": Row("ramp", 0.6, motion, "ground.ramps.0.rounding"),
    "ground.ramps.edge": Row("ramp", "smooth", motion, "ground.ramps.0.edge"),
    "ground.grade": Row("ramp", 0.05, told),
    "obstacles.step.name": Row("path", "kerb", told, "obstacles.block.name"),
    "obstacles.step.kind": Row("path", "hole", "obstacles", "obstacles.block.kind"),
    "obstacles.step.height": Row("climb", 0.04, motion, "obstacles.step.height"),
    "obstacles.step.place": Row("path", [2.0, 0.2], told, "obstacles.block.place"),
    "obstacles.step.direction": Row("path", 1.2, told, "obstacles.block.direction"),
    "obstacles.step.width": Row("path", 1.5, told, "obstacles.block.width"),
    "obstacles.step.depth": Row("path", 0.01, told, "obstacles.block.depth"),
    "obstacles.wall.name": Row("path", "door", told, "obstacles.wall.name"),
    "obstacles.wall.kind": Row("path", "post", "obstacles", "obstacles.wall.kind"),
    "obstacles.wall.height": Row("path", 2.0, picture),
    "obstacles.wall.start": Row("path", [1.0, 0.2], told),
    "obstacles.wall.end": Row("path", [1.2, 1.0], told),
    "obstacles.wall.thickness": Row("path", 0.2, told),
    "obstacles.door.name": Row("path", "gate", picture, "obstacles.leaf.name"),
    "obstacles.door.kind": Row("path", "gap", "obstacles", "obstacles.leaf.kind"),
    "obstacles.door.height": Row("path", 2.0, picture, "obstacles.leaf.height"),
    "obstacles.door.hinge": Row("path", [0.6, 1.0], told, "obstacles.leaf.hinge"),
    "obstacles.door.direction": Row("path", -1.3, told, "obstacles.leaf.direction"),
    "obstacles.door.angle": Row("path", -0.3, told, "obstacles.leaf.angle"),
    "obstacles.door.width": Row("path", 0.7, told, "obstacles.leaf.width"),
    "obstacles.door.thickness": Row("path", 0.2, told, "obstacles.leaf.thickness"),
    "obstacles.circle.name": Row("path", "tree", told, "obstacles.post.name"),
    "obstacles.circle.kind": Row("path", "ball", "obstacles", "obstacles.post.kind"),
    "obstacles.circle.height": Row("path", 2.0, picture, "obstacles.post.height"),
    "obstacles.circle.centre": Row("path", [0.6, -0.3], told, "obstacles.post.centre"),
    "obstacles.circle.radius": Row("path", 0.2, told, "obstacles.post.radius"),
    "obstacles.polygon.name": Row("path", "crate", told, "obstacles.box.name"),
    "obstacles.polygon.kind": Row("path", "ball", "obstacles", "obstacles.box.kind"),
    "obstacles.polygon.height": Row("path", 2.0, picture, "obstacles.box.height"),
    "obstacles.polygon.corners": Row(
        "path", [[2.1, -0.5], [2.6, -0.5], [2.6, -0.2]], told, "obstacles.box.corners"
    ),
    "obstacles.polygon.holes": Row("ring", [], told, "obstacles.ring.holes"),
    "obstacles.polygon.file": Row("shapes", "near.csv", told, "obstacles.shelves.file"),
    "map.file": Row("cells", "grey.yaml", told),
    "map.unknown": Row("grey", "free", told),
    "limits.clearance": Row("yard", 2.0, told),
    "limits.speed": Row("path", 0.5, motion),
    "limits.safety_speed": Row("path", 0.5, motion),
    "limits.yaw_rate": Row("path", 0.05, motion),
    "limits.wheel_speed": Row("search", [9.0, 9.0, 5.0, 9.0], motion),
    "limits.wheel_acceleration": Row("search", [9.0, 9.0, 5.0, 9.0], motion),
    "limits.steering_rate": Row("car", 0.02, motion),
    "limits.steering_acceleration": Row("car", 0.02, motion),
    "limits.speed_zones.start": Row("car", 0.5, motion, "limits.speed_zones.0.start"),
    "limits.speed_zones.end": Row("car", 2.5, motion, "limits.speed_zones.0.end"),
    "limits.speed_zones.speed": Row("car", 0.4, motion, "limits.speed_zones.0.speed"),
    "limits.power": Row("path", 20.0, motion),
    "limits.slip": Row("path", False, margins),
    "limits.slip_share": Row("path", 0.1, motion),
    "limits.slip_rule": Row("icy", "load", motion),
    "limits.acceleration": Row("path", 0.3, motion),
    "limits.deceleration": Row("path", 0.3, motion),
    "limits.tip": Row("path", False, margins),
    "limits.contact": Row("path", 0.1, margins),
    "limits.variant": Row("path", "thesis", margins),
    "start.pose": Row("search", [0.1, 0.0, 0.0], motion),
    "start.wheels": Row("search", [0.1, 0.2, 0.3, 0.4], motion),
    "start.steering": Row("path", {"castor-left": 1.0}, motion),
    "goal.pose": Row("search", [2.4, 0.76, -1.5], motion),
    "goal.wheels": Row("search", [0.5, 0.0, 0.0, 0.0], motion),
    "goal.critical": Row("search", ["front-right"], motion),
    "space.x": Row("search", [0.0, 2.5], told),
    "space.y": Row("search", [-0.5, 1.0], told),
    "space.corners": Row("yard", [[-2.0, -2.0], [4.0, -2.0], [1.0, 2.0]], told),
    "space.holes": Row("yard", [[[0.5, -1.0], [1.0, -1.0], [1.0, 1.5]]], told),
    "spline.free": Row("search", ["p1", "p2"], motion),
    "objective.kind": Row("search", "energy", cost),
    "objective.pose_gains": Row("drives", [1.0, 1.0, 1.0], cost),
    "objective.wheel_gain": Row("drives", 3.0, cost),
    "objective.wheel_period": Row("search", "pi", told),
    "objective.wheel_tolerance": Row("drives", 0.01, told),
    "objective.pose_tolerance": Row("drives", 0.01, told),
    "actuator.duration": Row("drives", 3.0, motion),
    "actuator.saturation": Row("drives", 10.0, cost),
    "actuator.dead_zone": Row("drives", 3.0, cost),
    "path.points": Row("path", [[0.0, 0.0], [1.0, 0.2], [2.0, 0.0]], motion),
    "path.file": Row("path", "way.csv", "points, file, segments or pieces"),
    "path.heading": Row("free", "along", 'none, or heading = "free"'),
    "path.headings": Row("free", [0.0, 0.3, 0.1], motion),
    "path.spacing": Row("path", "uniform", motion),
    "path.stops": Row("path", [0.7], motion),
    "path.start": Row("segments", [0.0, 0.1, 0.1], motion),
    "path.drive": Row("segments", "backward", motion),
    "path.start_heading": Row("ramp", -3.1, motion),
    "path.start_rate": Row("ramp", 1.0, motion),
    "path.goal_heading": Row("ramp", -3.1, motion),
    "path.goal_rate": Row("ramp", 1.0, motion),
    "profile.places": Row("profile", [0.0, 1.0], motion),
    "profile.speeds": Row("profile", [0.3, 0.5], motion),
    "profile.manner": Row("profile", "least_squares", motion),
    "climb.step": Row("climb", "kerb", "of kind step: step"),
    "climb.gap": Row("climb", 0.03, motion),
    "climb.rank": Row("climb", "margin", motion),
    "climb.alphas": Row("climb", [0.7], notes),
    "encounters.appears": Row("encounters", 12.0, notes, "encounters.0.appears"),
    "encounters.clears_after": Row("encounters", 4.0, notes, "encounters.1.clears_after"),
    "encounters.distance": Row("encounters", 0.3, notes, "encounters.0.distance"),
    "printed.length": Row("encounters", 16.0, notes),
    "printed.time": Row("encounters", 50.0, notes),
    "printed.unscaled_speed": Row("encounters", 6.0, notes),
    "printed.unscaled_acceleration": Row("encounters", 21.0, notes),
    "printed.unscaled_deceleration": Row("encounters", 13.0, notes),
    "printed.sliding_speed": Row("encounters", 2.0, notes),
    "printed.fitted": Row("encounters", False, notes),
    "printed.residuals": Row("encounters", {"length": 0.1}, notes),
}

for where, base in (("path", "segments"), ("path.pieces", "pieces")):
    inside = "path.pieces.1" if base == "pieces" else "path"
    for part, key, new in (
        ("straight", "length", 0.2), ("clothoid", "length", 0.2), ("clothoid", "start", 0.1),
        ("clothoid", "end", 0.3), ("arc", "radius", 2.0), ("arc", "angle", -0.1),
    ):  # fmt: skip
        at = [one["kind"] for one in SEGMENTS].index(part)
        row = Row(base, new, motion, f"{inside}.segments.{at}.{key}")
        ROWS[f"{where}.segments.{part}.{key}"] = row
        row = Row(base, "curl", "segments", f"{inside}.segments.{at}.kind")
        ROWS[f"{where}.segments.{part}.kind"] = row
for key, new, output in (
    ("points", [[0.0, 0.0], [0.6, 0.2], [1.0, 0.1]], motion),
    ("file", "way.csv", "points, file or segments"),
    ("heading", "free", "one yaw a point"),
    ("headings", [0.0, 0.0, 0.0], 'none, or heading = "free"'),
    ("spacing", "uniform", motion),
    ("start_heading", 0.1, motion),
    ("start_rate", 0.5, motion),
    ("goal_heading", 0.1, "faces"),
    ("goal_rate", 0.5, motion),
):
    ROWS[f"path.pieces.{key}"] = Row("pieces", new, output, f"path.pieces.0.{key}")
ROWS["path.pieces.start"] = Row("pieces", [1.0, 0.2, np.pi], "0.1 m away", "path.pieces.1.start")
ROWS["path.pieces.drive"] = Row("pieces", "forward", "faces", "path.pieces.1.drive")


def keys(model: type[BaseModel], before: str = "") -> Iterator[str]:
    """Dotted keys of a kind of file; elements of a union of models are named by their kind."""
    for name, field in model.model_fields.items():
        key = before + (field.alias or name)
        if key == "source":
            continue
        section = key if key in SECTIONS else None
        models = [entry(section).SCHEMAS[section]] if section else list(_models(field.annotation))
        if not models:
            yield key
        for one in models:
            kind = one.model_fields.get("kind")
            tag = f"{get_args(kind.annotation)[0]}." if kind and len(models) > 1 else ""
            yield from keys(one, f"{key}.{tag}")


def solved(problem: Problem) -> Solution:
    """Short searches where a swarm is needed; everything is the same at every call."""
    if problem.actuator is None:
        return solve(problem)
    return solve(problem, optimizer="pso", budget=Budget(evaluations=60))


@cache
def before(base: str) -> Solution:
    return solved(bases()[base])


def test_every_key_has_a_row() -> None:
    known = set(keys(Problem))
    assert known - EXEMPT == set(ROWS)
    assert known >= EXEMPT


@pytest.mark.parametrize("key", ROWS)
def test_another_value_changes_the_output_or_is_refused(key: str) -> None:
    row = ROWS[key]
    changes = {row.key or key: row.value}
    if key == "robot.file":
        changes["robot.name"] = None
    if isinstance(row.output, str):
        with pytest.raises((ProblemError, ArgumentError)) as caught:
            bases()[row.base].replace(changes)
        assert row.output in str(caught.value)
    else:
        changed = bases()[row.base].replace(changes)
        assert row.output(solved(changed)) != row.output(before(row.base))


def test_points_of_a_file_are_the_points(tmp_path: Any) -> None:
    file = tmp_path / "way.csv"
    file.write_text("x,y,yaw\n0,0,0\n1,0.1,0.2\n2,0,0\n")
    changes = {"path.points": None, "path.file": str(file)}
    assert motion(solve(bases()["path"].replace(changes))) == motion(before("path"))
    changes["path.headings"] = None
    assert motion(solve(bases()["free"].replace(changes))) == motion(before("free"))
    with pytest.raises(ProblemError, match="columns x, y"):
        bases()["path"].replace({"path.points": None, "path.file": str(tmp_path / "none.csv")})


def test_pieces_are_those_of_python(tmp_path: Any) -> None:
    """The same motion; a piece goes on where the one before ends; files of pieces stand alone."""
    first, second = PIECES
    ahead = Curve.through(first["points"], start_direction=[1, 0], end_direction=[1, 0])
    parts = [Straight(0.3), Clothoid(0.3, 0.0, 0.4), Arc(2.5, 0.1), Clothoid(0.3, 0.4, 0.0)]
    back = Curve.segments(parts, start=second["start"]).backward()
    whole = Curve.join([ahead, back])
    problem = bases()["pieces"]
    found = problem.flat_path
    u = np.linspace(0.0, whole.end, 20)
    np.testing.assert_array_equal(found.position(u), whole.position(u))
    np.testing.assert_array_equal(found.yaw(u), whole.yaw(u))
    goes_on = problem.replace({"path.pieces.1.start": None}).flat_path
    np.testing.assert_allclose(goes_on.position(u), whole.position(u), atol=1e-12)
    with pytest.raises(ProblemError, match=r"path.pieces\[0\].start"):
        problem.replace({"path": {"pieces": [{"segments": SEGMENTS}]}})
    with pytest.raises(ProblemError, match=r"path.pieces\[1\].*0.2 m away"):
        problem.replace({"path.pieces.1.start": [1.2, 0.1, np.pi]})
    with pytest.raises(ProblemError, match="none with segments"):
        bases()["segments"].replace({"path.spacing": "uniform"})
    with pytest.raises(ProblemError, match=r"path\.start.*none with points"):
        bases()["path"].replace({"path.start": [0.0, 0.0, 0.0]})
    with pytest.raises(ProblemError, match=r"path\.drive.*headings say"):
        bases()["free"].replace({"path.drive": "backward"})
    file = tmp_path / "way.csv"
    file.write_text("x,y\n" + "\n".join(f"{x},{y}" for x, y in first["points"]))
    named = problem.replace({"path.pieces.0.points": None, "path.pieces.0.file": str(file)})
    tables = named.standalone()
    assert tables["path"]["pieces"][0]["points"] == first["points"]
    assert motion(solve(validated(Problem, tables, "alone.toml"))) == motion(before("pieces"))
