"""Every number and array that public functions and constructors take, with values that are none:
one line that names the argument; texts and masks are never numbers."""

from __future__ import annotations

import datetime
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from trajopt import Budget, Path, Robot, limit_jerk, minimize, robot, time_scale
from trajopt.control.commands import commands
from trajopt.errors import ArgumentError, TrajoptError
from trajopt.limits.friction import FrictionAlong, FrictionMap
from trajopt.limits.limit import Limit
from trajopt.limits.registry import LIMITS
from trajopt.limits.speed import Speed
from trajopt.timing.many import time_scale_many
from trajopt.timing.nominal import nominal_timing
from trajopt.timing.sensitivity import sensitivities
from trajopt.world.height_map import HeightMap
from trajopt.world.mesh import Mesh
from trajopt.world.obstacles import OBSTACLES
from trajopt.world.plane import Plane
from trajopt.world.ramp import Ramp
from trajopt.world.rough import rough_ground
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

PATH = Path.through([[0.0, 0.0], [1.0, 0.3], [2.0, 0.0]])
SPEED: list[Limit] = [Speed(1.0)]
TIMED = time_scale(PATH, [Speed(1.0), LIMITS["acceleration"](1.0, 1.0)], robot=robot("car"))
SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
BODY = {"name": "r", "mass": 20.0, "cog": (0.0, 0.0, 0.1), "chassis": (0.5, 0.4, 0.1)}
WHEELS = {"radius": 0.1, "width": 0.03, "wheel_mass": 0.5, "torque": 3.0, "clearance": 0.05}


def scaled(**given: Any) -> Any:
    return time_scale(PATH, SPEED, robot=robot("car"), **given)


def square(z: Any) -> float:
    return float(np.sum(np.square(z)))


def rough(**given: Any) -> Any:
    return rough_ground(rng=np.random.default_rng(0), **given)


def obstacle(kind: str) -> Callable[..., Any]:
    return lambda **given: OBSTACLES[kind](name="thing", **given)


# what is called, with arguments that are right, all of them numbers or arrays of numbers
CALLS: Mapping[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "Path.through": (
        Path.through,
        {
            "points": [[0.0, 0.0], [1.0, 0.0]],
            "heading": [0.0, 0.1],
            "knots": [0.0, 1.0],
            "start_direction": [1.0, 0.0],
            "end_direction": [1.0, 0.0],
            "turning_length": 1.0,
        },
    ),
    "acceleration": (LIMITS["acceleration"], {"forward": 1.0, "braking": 1.0}),
    "contact": (LIMITS["contact"], {"share": 0.1}),
    "power": (LIMITS["power"], {"largest": 50.0}),
    "wheel_torque": (LIMITS["wheel_torque"], {"largest": 3.0}),
    "slip": (LIMITS["slip"], {"friction": 0.5, "sides": 8}),
    "speed": (LIMITS["speed"], {"largest": 1.0}),
    "speed_profile": (LIMITS["speed_profile"], {"places": (0.0, 1.0), "speeds": (1.0, 1.0)}),
    "speed_zones": (LIMITS["speed_zones"], {"zones": ((0.0, 1.0, 1.0),)}),
    "steering_acceleration": (LIMITS["steering_acceleration"], {"largest": 1.0}),
    "steering_rate": (LIMITS["steering_rate"], {"largest": 1.0}),
    "tip": (LIMITS["tip"], {"reserve": 0.0}),
    "wheel_acceleration": (LIMITS["wheel_acceleration"], {"largest": 1.0}),
    "wheel_speed": (LIMITS["wheel_speed"], {"largest": 1.0}),
    "yaw_rate": (LIMITS["yaw_rate"], {"largest": 1.0}),
    "friction along": (FrictionAlong, {"places": (0.0, 1.0), "values": (0.5, 0.5)}),
    "friction map": (
        FrictionMap,
        {"values": [[0.5, 0.5], [0.5, 0.5]], "spacing": 1.0, "origin": (0.0, 0.0)},
    ),
    "budget": (Budget, {"evaluations": 10, "seconds": 1.0, "target": 0.0}),
    "plane": (Plane, {"slope": 0.1, "direction": 0.0}),
    "ramp": (
        Ramp,
        {"place": (0.0, 0.0), "direction": 0.0, "run": 1.0, "height": 0.1, "rounding": 0.1},
    ),
    "height map": (
        HeightMap,
        {"heights": np.zeros((3, 3)), "spacing": 1.0, "origin": (0.0, 0.0), "grade": 0.5},
    ),
    "mesh": (
        Mesh,
        {
            "vertices": np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
            "faces": np.array([[0, 1, 2]]),
            "spacing": 0.5,
            "grade": 0.5,
        },
    ),
    "circle": (obstacle("circle"), {"height": 1.0, "centre": (0.0, 0.0), "radius": 1.0}),
    "polygon": (obstacle("polygon"), {"height": 1.0, "corners": SQUARE}),
    "step": (
        obstacle("step"),
        {"height": 1.0, "place": (0.0, 0.0), "direction": 0.0, "width": 1.0, "depth": 1.0},
    ),
    "wall": (
        obstacle("wall"),
        {"height": 1.0, "start": (0.0, 0.0), "end": (1.0, 0.0), "thickness": 0.1},
    ),
    "scene": (lambda friction: Scene(friction, Flat()), {"friction": 0.5}),
    "time_scale": (
        scaled,
        {
            "start_speed": 0.0,
            "end_speed": 0.0,
            "stops": [1.0],
            "gridpoints": 20,
            "start_wheels": [0.0] * 4,
            "gap": 0.01,
        },
    ),
    "nominal_timing": (
        lambda **k: nominal_timing(PATH, limits=SPEED, **k),
        {"duration": 3.0, "start_wheels": []},
    ),
    "sensitivities": (lambda **k: sensitivities(TIMED, **k), {"change": 0.01}),
    "trajectory.at": (TIMED.at, {"t": [0.0, 0.5]}),
    "path.position": (PATH.position, {"u": [0.0, 0.5], "derivative": 0}),
    "path.locate": (PATH.locate, {"s": [0.0, 0.5]}),
    "commands": (lambda **k: commands(TIMED, **k), {"sample_time": 0.1}),
    "limit_jerk": (lambda **k: limit_jerk(TIMED, **k), {"jerk": 10.0, "nodes": 20}),
    "minimize": (
        lambda **k: minimize(square, optimizer="nelder-mead", **k),
        {"bounds": [[-1.0, 1.0]], "x0": [0.5], "seed": 0},
    ),
    "rough_ground": (rough, {"sigma": 0.1, "size": 2.0, "correlation": 0.2, "spacing": 0.5}),
    "differential": (
        Robot.differential,
        {
            **{k: v for k, v in {**BODY, **WHEELS}.items() if k != "name"},
            "track": 0.4,
            "castor": (-0.2, 0.0),
            "castor_radius": 0.04,
            "castor_trail": 0.03,
            "castor_mass": 0.2,
        },
    ),
}
WRONG: Mapping[str, Any] = {
    "text": "1",
    "mask": True,
    "masks": np.array([True, False]),
    "texts": ["1", "2"],
    "ragged": [[0.0, 1.0], [2.0]],
    "complex": 1j,
    "nan": float("nan"),
    "object": object(),
    "date": datetime.datetime(2026, 1, 1),
    "dates": np.array(["2026-01-01"], dtype="datetime64[D]"),
    "hidden": np.ma.array([1.0], mask=[True]),
    "fraction": Fraction(1, 2),
    "nothing": [None],
    "mapping": {"a": 1},
    "huge": 10**400,
    "deep": [[[[[[1.0]]]]]],
}
EACH = [(name, argument) for name, (_, given) in CALLS.items() for argument in given]


def call(name: str, **changed: Any) -> Any:
    function, given = CALLS[name]
    named = {"name": "r"} if name == "differential" else {}
    return function(**{**named, **given, **changed})


@pytest.mark.parametrize("name", CALLS)
def test_the_arguments_of_this_table_are_right(name: str) -> None:
    call(name)


@pytest.mark.parametrize(("name", "argument"), EACH)
def test_what_is_no_number_is_refused_by_name(name: str, argument: str) -> None:
    for kind, wrong in WRONG.items():
        try:
            call(name, **{argument: wrong})
        except TrajoptError as error:
            told = str(error)
        else:
            pytest.fail(f"{kind} is taken")
        assert "\n" not in told
        assert len(told) < 1000


@pytest.mark.parametrize(("name", "argument"), EACH)
def test_numbers_of_numpy_are_numbers(name: str, argument: str) -> None:
    right = CALLS[name][1][argument]
    kind = np.int64 if isinstance(right, int) else np.float64
    call(name, **{argument: kind(right) if np.ndim(right) == 0 else np.array(right)})


def test_arguments_that_are_no_objects_of_ours_are_refused() -> None:
    for wrong in (3, "a", None, [1], object()):
        for refused in (
            lambda w=wrong: time_scale(w, SPEED),
            lambda w=wrong: time_scale(PATH, w),
            lambda w=wrong: time_scale(PATH, [w]),
            lambda w=wrong: nominal_timing(w, 1.0, SPEED),
            lambda w=wrong: nominal_timing(PATH, 1.0, [w]),
            lambda w=wrong: sensitivities(w),
            lambda w=wrong: Robot.load(w),
            lambda w=wrong: robot(w),
        ):
            with pytest.raises(TrajoptError):
                refused()
    with pytest.raises(ArgumentError, match="robot"):
        time_scale(PATH, SPEED, robot=3)  # type: ignore[arg-type]


@pytest.mark.parametrize("wrong", [None, 3, "none", ["auto"], np.array(["auto", "auto"])])
def test_choices_are_texts_of_a_list(wrong: Any) -> None:
    for refused in (
        lambda: time_scale(PATH, SPEED, engine=wrong),
        lambda: time_scale(PATH, SPEED, too_fast=wrong),
        lambda: LIMITS["slip"](0.5, rule=0 if wrong is None else wrong),
        lambda: Path.through([[0, 0], [1, 0], [1, 1]], closed=wrong),
        lambda: time_scale(PATH, [Speed(1.0, name=[wrong])]),  # type: ignore[arg-type]
        lambda: time_scale_many(PATH, SPEED, executor=[wrong]),
    ):
        with pytest.raises(ArgumentError):
            refused()
