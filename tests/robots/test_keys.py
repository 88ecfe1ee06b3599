"""Every key of a robot file acts: changing it changes an output, or is refused by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import numpy as np
import pytest
from pydantic import BaseModel

from trajopt.errors import ProblemError
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.steering_acceleration import SteeringAcceleration
from trajopt.limits.steering_rate import SteeringRate
from trajopt.limits.tip import Tip
from trajopt.limits.wheel_torque import WheelTorque
from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples, sample_path
from trajopt.problem.limits import LimitsSection
from trajopt.robots import Robot, robot
from trajopt.robots.checks import findings
from trajopt.robots.description import RobotDescription
from trajopt.timing.scaling import time_scale
from trajopt.timing.track import track

EXEMPT = {"name", "about", "source"}  # title and comments of the whole robot; set by the loader
CURVE = Path.through([[0, 0], [1, 0.4], [2, -0.2], [3, 0.5]])
TURNING = Path.through(
    [[0, 0], [1, 0.4], [2, -0.2], [3, 0.5]], heading=[0.2, 1.0, 0.1, -0.7], turning_length=0.5
)


def _rows(limit: Slip | Tip, one: Robot) -> list[list[float]]:
    samples = sample_path(TURNING if one.holonomic else CURVE, np.array([0.8, 1.9]))
    found = limit.rows(samples, one)
    return [found.a.tolist(), found.b.tolist(), found.c.tolist()]


SLOW = {"steering.0.rate": 3.0, "steering.0.acceleration": 3.0}
CURVED = {"motors.0.curve": [[0, 8], [9, 0]]}
STEERING = (SteeringRate(), SteeringAcceleration())


def _steered(one: Robot) -> PathSamples:
    places = np.array([0.8, 1.9])
    gentle = Path.through([[0, 0], [2, 0.2], [4, 0]])
    return track(gentle, one).samples(places, gentle.locate(places))


def _steering_rows(limit: SteeringRate | SteeringAcceleration, one: Robot) -> list[list[float]]:
    found = limit.rows(_steered(one), one)
    return [found.a.tolist(), found.c.tolist(), found.sd2_max.tolist()]


def _torque_rows(one: Robot) -> list[Any]:
    found = []
    for limit in LimitsSection(speed=1.0).limits(one, 0.5)[1:]:
        rows = limit.rows(_steered(one), one)
        found += [rows.a.tolist(), rows.b.tolist(), (rows.c / rows.scale).tolist()]
        found.append(rows.sd2_max.tolist())
    return found


OUTPUTS: dict[str, Callable[[Robot], Any]] = {
    "slip": lambda one: _rows(Slip(0.4), one),
    "tip": lambda one: _rows(Tip(), one),
    "motor limits": lambda one: LimitsSection(speed=1.0).limits(one, 0.5),
    "rates": lambda one: one.inverse.tolist(),
    "torque": _torque_rows,
    "energy": lambda one: time_scale(CURVE, [WheelTorque(), Speed(0.5)], robot=one).energy,
    "outline": lambda one: one.footprint,
    "yaw inertia": lambda one: one.body.yaw_inertia,
    "mass": lambda one: one.body.mass,
    "wheel names": lambda one: one.wheel_names,
    "driven": lambda one: one.driven,
    "findings": findings,
    "steering limits": lambda one: [_steering_rows(limit, one) for limit in STEERING],
    "steering angles": lambda one: _steered(one).wheels.steering.tolist(),
}


@dataclass(frozen=True)
class Row:
    """``dotted`` of a shipped robot at two values, and the outputs that must differ; ``base`` are
    changes before. ``refused``: words of the error that the second value gives."""

    name: str
    dotted: str
    values: tuple[Any, Any]
    output: str = ""
    base: dict[str, Any] = field(default_factory=dict)
    refused: str = ""


SKID = {
    "wheels": [
        {
            "name": f"w{i}",
            "kind": "fixed",
            "position": [x, y],
            "radius": 0.1,
            "width": 0.05,
            "mass": 1.0,
        }
        for i, (x, y) in enumerate(((0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2)))
    ],
    "motors": [{"name": "all", "wheels": ["w0", "w1", "w2", "w3"], "torque": 5.0}],
}
GIVEN = {"body.yaw_inertia": None}  # derived instead

ROWS: dict[str, Row] = {
    "body.mass": Row("loc8", "body.mass", (20.0, 25.0), "slip"),
    "body.cog": Row("loc8", "body.cog", ([0.0, 0.0, 0.1], [0.05, 0.02, 0.2]), "tip"),
    "body.yaw_inertia": Row("loc8", "body.yaw_inertia", (2.0, 3.0), "slip"),
    "body.chassis": Row("loc8", "body.chassis", ([0.6, 0.4, 0.1], [1.2, 0.4, 0.1]), "outline"),
    "body.chassis_place": Row("loc8", "body.chassis_place", ([0, 0], [0.1, 0]), "yaw inertia"),
    "body.footprint": Row(
        "powerbot", "body.footprint", (None, [[1, 1], [-1, 1], [-1, -1]]), "outline"
    ),
    "wheels.name": Row("loc8", "wheels.0.name", ("a", "b"), "wheel names", {"motors": []}),
    "wheels.kind": Row("tricycle", "wheels.rear-left.kind", ("fixed", "spherical"), "rates"),
    "wheels.position": Row("loc8", "wheels.0.position", ([0.3, 0.3], [0.4, 0.3]), "rates"),
    "wheels.angle": Row("omni-3", "wheels.0.angle", (2.6, 2.2), "rates"),
    "wheels.radius": Row("loc8", "wheels.0.radius", (0.098, 0.1), "rates"),
    "wheels.width": Row("loc8", "wheels.0.width", (0.043, 0.06), "outline"),
    "wheels.mass": Row("loc8", "wheels.0.mass", (1.44, 2.0), "yaw inertia"),
    "wheels.trail": Row("powerbot", "wheels.castor-left.trail", (0.04, 0.1), "tip"),
    "wheels.lateral": Row("asoc-4", "wheels.module-1-left.lateral", (0.1, 0.15), "rates"),
    "wheels.rollers.count": Row("loc8", "wheels.0.rollers.count", (18, 8), "findings"),
    "wheels.rollers.angle": Row("loc8", "wheels.0.rollers.angle", (-0.785, -0.5), "rates"),
    "pivots.name": Row(
        "asoc-4", "pivots.module-1.name", ("one", "module-2"), refused="different names"
    ),
    "pivots.wheels": Row(
        "asoc-4",
        "pivots.module-1.wheels",
        (["module-1-left", "module-1-right"], ["module-1-left", "module-2-right"]),
        refused="each once",
    ),
    "pivots.mass": Row("asoc-4", "pivots.module-1.mass", (3.25, 5.0), "yaw inertia", GIVEN),
    "motors.name": Row("loc8", "motors.0.name", ("a", "rear-left"), refused="different names"),
    "motors.wheels": Row("tricycle", "motors.0.wheels", (["front"], ["rear-left"]), "driven"),
    "motors.speed": Row("loc8", "motors.0.speed", (10.0, 12.0), "motor limits"),
    "motors.acceleration": Row("loc8", "motors.0.acceleration", (10.0, 12.0), "motor limits"),
    "motors.curve": Row("loc8", "motors.0.curve", ([[0, 8], [9, 0]], [[0, 8], [8, 0]]), "torque"),
    "motors.gear": Row("loc8", "motors.0.gear", (2.0, 3.0), "torque", CURVED),
    "motors.braking": Row("loc8", "motors.0.braking", ("full", "curve"), "torque", CURVED),
    "motors.regeneration": Row("loc8", "motors.all.regeneration", (None, 0.5), "energy"),
    "steering.name": Row("swerve", "steering.0.name", ("a", "rear-left"), refused="different"),
    "steering.wheels": Row(
        "swerve", "steering.0.wheels", (["front-left"], ["rear-left"]), refused="each once"
    ),
    "steering.rate": Row("car", "steering.0.rate", (1.0, 2.0), "steering limits", SLOW),
    "steering.acceleration": Row(
        "car", "steering.0.acceleration", (1.0, 2.0), "steering limits", SLOW
    ),
    "steering.rule": Row("car", "steering.0.rule", ("ackermann", "parallel"), "steering angles"),
    "steering.range": Row("car", "steering.0.range", ([-0.4, 0.4], [-0.3, 0.3]), "findings"),
    "sharing": Row("loc8", "sharing", ("least_norm", "capacity"), "slip"),
    "skid.effective_track": Row("powerbot", "skid.effective_track", (0.5, 0.8), "rates", SKID),
}

# Keys that act in physics alone: what engines build must differ.
PHYSICS_KEYS: dict[str, Row] = {
    "body.clearance": Row("loc8", "body.clearance", (0.085, 0.05)),
    "wheels.rollers.radius": Row("loc8", "wheels.0.rollers.radius", (0.0095, 0.012)),
    "wheels.rollers.shape": Row("loc8", "wheels.0.rollers.shape", ("spheres", "barrel")),
    "wheels.rollers.spheres": Row("loc8", "wheels.0.rollers.spheres", (5, 7)),
    "wheels.rollers.mass": Row("loc8", "wheels.0.rollers.mass", (0.02, 0.03)),
    "wheels.double.minor_radius": Row("loc8-smdw", "wheels.0.double.minor_radius", (0.047, 0.06)),
    "wheels.double.depth": Row("loc8-smdw", "wheels.0.double.depth", (0.045, 0.04)),
    "wheels.double.gap": Row("loc8-smdw", "wheels.0.double.gap", (0.03, 0.02)),
    "wheels.double.outer": Row("loc8-smdw", "wheels.0.double.outer", ("left", "right")),
    "wheels.double.rollers": Row("loc8-smdw", "wheels.0.double.rollers", (6, 7)),
    "wheels.double.roller_radius": Row(
        "loc8-smdw", "wheels.0.double.roller_radius", (0.0125, 0.0115)
    ),
    "pivots.sag": Row("asoc-4", "pivots.all.sag", (0.03, 0.05)),
    "pivots.damping_ratio": Row("asoc-4", "pivots.all.damping_ratio", (0.7, 0.4)),
    "pivots.travel": Row("asoc-4", "pivots.all.travel", (0.15, 0.1)),
    "pivots.tilt": Row("asoc-4", "pivots.all.tilt", ("passive", "rigid")),
    "pivots.tilt_range": Row("asoc-4", "pivots.all.tilt_range", (1.3, 0.9)),
    "motors.torque": Row("loc8", "motors.all.torque", (8.0, 4.0)),
}


def keys(model: type[BaseModel], before: str = "") -> Iterator[str]:
    """Dotted keys of the leaves of a model; arrays of tables count as one table."""
    for name, about in model.model_fields.items():
        below = sections(about.annotation)
        if not below:
            yield before + name
        for section in below:
            yield from keys(section, f"{before}{name}.")


def sections(annotation: Any) -> list[type[BaseModel]]:
    """Models that an annotation holds."""
    if get_origin(annotation) in (tuple, Union, UnionType, Annotated):
        return [found for part in get_args(annotation) for found in sections(part)]
    is_model = isinstance(annotation, type) and issubclass(annotation, BaseModel)
    return [annotation] if is_model and annotation is not NoneType else []


def test_every_key_has_a_row() -> None:
    every = set(keys(RobotDescription)) - EXEMPT
    rows = [*ROWS, *PHYSICS_KEYS]
    assert not every - set(rows), "keys without a row"
    assert not set(rows) - every, "rows of keys that are gone"
    assert len(set(rows)) == len(rows), "a key with two rows"


def at(row: Row, value: Any) -> Robot:
    """The row's robot with its key at ``value``."""
    return robot(row.name, {**row.base, row.dotted: value})


@pytest.mark.parametrize("key", ROWS)
def test_a_key_changes_an_output_or_is_refused(key: str) -> None:
    row = ROWS[key]
    first, second = row.values
    if row.refused:
        at(row, first)
        with pytest.raises(ProblemError, match=row.refused) as caught:
            at(row, second)
        assert caught.value.key == key
        return
    compute = OUTPUTS[row.output]
    assert compute(at(row, first)) != compute(at(row, second))


@pytest.mark.parametrize("key", PHYSICS_KEYS)
def test_a_key_of_physics_changes_what_engines_build(key: str) -> None:
    build = pytest.importorskip("trajopt.simulate.build").build
    row = PHYSICS_KEYS[key]
    first, second = (repr(build(at(row, value))) for value in row.values)
    assert first != second
