"""validate(trajectory, scene): that robot in that scene, from its own start, with what it
touches."""

from __future__ import annotations

import math

import numpy as np
import pytest

from trajopt.errors import ArgumentError, SimulationError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.speed import Speed
from trajopt.paths.path import Path
from trajopt.robots import Robot, robot
from trajopt.simulate.check import ValidationReport, validate
from trajopt.simulate.engine import ENGINES
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory
from trajopt.world.height_map import HeightMap
from trajopt.world.obstacles import Step, Wall
from trajopt.world.ramp import Ramp, Ramps, lay_over
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

pytest.importorskip("pybullet")
pytest.importorskip("mujoco")

FLAT = Scene(0.8, Flat())
LIMITS = (Speed(0.6), Acceleration(0.5, 0.5))


def eight_wheeled() -> Robot:
    """Four omni wheels along x, four across: every direction, eight wheels."""
    wheels = [
        {
            "name": f"{way}-{i}-{j}", "kind": "swedish", "position": [0.3 * i, 0.2 * j],
            "angle": turn, "radius": 0.05, "width": 0.03, "mass": 0.5,
            "rollers": {"count": 10, "angle": 0.0, "radius": 0.012},
        }
        for way, turn in (("along", 0.0), ("across", math.pi / 2))
        for i in (1, -1) for j in (1, -1)
    ]  # fmt: skip
    for k, wheel in enumerate(wheels):
        wheel["position"] = [p * (1.0 if k < 4 else 0.6) for p in wheel["position"]]  # type: ignore[attr-defined]
    names = [str(wheel["name"]) for wheel in wheels]
    return Robot.of({
        "name": "eight",
        "body": {
            "mass": 20.0, "cog": [0.0, 0.0, 0.1], "chassis": [0.7, 0.5, 0.1], "clearance": 0.06,
        },
        "wheels": wheels,
        "motors": [{"name": n, "wheels": [n], "torque": 3.0} for n in names],
    })  # fmt: skip


def straight(machine: Robot, length: float = 1.5) -> Trajectory:
    path = Path.through([[0.0, 0.0], [length, 0.0]])
    return time_scale(path, LIMITS, robot=machine)


def curved(machine: Robot) -> Trajectory:
    heading = [0.0, 0.5, 1.0] if machine.holonomic else None
    return time_scale(
        Path.through([[0.0, 0.0], [1.0, 0.2], [1.6, 1.0]], heading=heading), LIMITS, robot=machine
    )


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", ["loc8", "omni-3", "small-differential", "powerbot", "eight"])
def test_plans_are_driven_as_planned(name: str, engine: str) -> None:
    machine = eight_wheeled() if name == "eight" else robot(name)
    report = validate(curved(machine), FLAT, engine=engine)
    assert report.final_distance < 0.02 * report.length
    assert abs(report.yaw) < 0.03
    assert np.abs(report.wheel_deviation).max() < 0.05
    assert report.contacts == ()
    assert report.wheels == tuple(w.name for w in machine.description.wheels)
    assert report.slip.shape == (len(report.wheels),)
    assert report.slip.max() < 0.15
    assert report.engine == engine


def test_the_trajectorys_own_robot_drives() -> None:
    """A Mecanum robot of other sizes: LOC8's would end elsewhere."""
    machine = Robot.mecanum(
        name="mine", mass=15.0, cog=(0.0, 0.0, 0.1), chassis=(0.4, 0.3, 0.1), clearance=0.05,
        wheelbase=0.4, track=0.36, radius=0.06, width=0.04, wheel_mass=0.8, torque=4.0,
        rollers=14, roller_radius=0.008,
    )  # fmt: skip
    report = validate(curved(machine), FLAT, engine="mujoco")
    assert report.final_distance < 0.02 * report.length


def test_wheels_start_where_the_trajectory_says() -> None:
    path = Path.through([[0.0, 0.0], [1.5, 0.0]])
    start = np.array([0.5, -7.0, 1.0, 2.0])
    plan = time_scale(path, LIMITS, robot=robot("loc8"), start_wheels=start)
    report = validate(plan, FLAT, engine="mujoco")
    np.testing.assert_allclose(report.recording.wheel_angles[0], start, atol=0.02)
    assert np.abs(report.wheel_deviation).max() < 0.05


def test_start_places_the_robot() -> None:
    report = validate(straight(robot("loc8")), FLAT, engine="mujoco", start=(0.1, -0.2, 0.0))
    assert report.across == pytest.approx(-0.2, abs=0.02)
    assert report.along == pytest.approx(0.1, abs=0.02)


@pytest.mark.parametrize("engine", ENGINES)
def test_what_stands_in_the_way_is_named_with_time_and_place(engine: str) -> None:
    small = robot("small-differential")
    wall = Wall("cupboard", 1.0, (1.2, -1.0), (1.2, 1.0), 0.1)
    report = validate(straight(small), Scene(0.8, Flat(), (wall,)), engine=engine)
    (hit,) = report.contacts
    assert hit.name == "cupboard"
    assert hit.place[0] == pytest.approx(1.15, abs=0.01)
    planned = straight(small).at(hit.time).pose[0, 0]
    assert planned + 0.21 == pytest.approx(1.15, abs=0.03)
    assert report.along < -0.3


@pytest.mark.parametrize("engine", ENGINES)
def test_a_step_counts_by_its_face(engine: str) -> None:
    """Stopping before it is no contact; what the old check left out, driving into it, is."""
    machine = robot("loc8")
    front = 0.376 + 0.098
    for room, touched in ((0.05, ()), (-0.05, ("kerb",))):
        step = Step("kerb", 0.12, (1.0 + front + room, 0.0), 0.0, width=3.0, depth=1.0)
        report = validate(straight(machine, 1.0), Scene(0.8, Flat(), (step,)), engine=engine)
        assert tuple(hit.name for hit in report.contacts) == touched


@pytest.mark.parametrize("engine", ENGINES)
def test_ramps_are_driven_where_the_plan_has_them(engine: str) -> None:
    ramp = Ramp((1.0, 0.0), 0.0, 2.0, 0.2, 0.35)
    ground = Ramps((ramp,), grade=0.2)
    level = Path.through([[0.0, 0.0], [4.0, 0.0]], start_direction=[1, 0], end_direction=[1, 0])
    machine = robot("powerbot")
    plan = time_scale(lay_over(level, [ramp]), LIMITS, robot=machine, ground=ground)
    report = validate(plan, Scene(0.8, ground), engine=engine)
    assert report.final_distance < 0.03
    assert np.degrees(-report.recording.pitch).max() == pytest.approx(5.7, abs=0.5)
    assert report.recording.height[-1] == pytest.approx(0.2, abs=5e-3)
    with pytest.raises(ArgumentError, match=r"scene\.ground"):
        validate(plan, FLAT, engine=engine)


@pytest.mark.parametrize("engine", ENGINES)
def test_feedback_removes_what_a_wrong_start_leaves(engine: str) -> None:
    small, off = robot("small-differential"), (-0.05, 0.08, 0.1)
    plan = curved(small)
    loose = validate(plan, FLAT, engine=engine, start=off)
    tight = validate(plan, FLAT, engine=engine, start=off, control="pose", seed=1)
    assert loose.final_distance > 0.15
    assert tight.final_distance < 0.05
    assert (tight.control, tight.seed) == ("pose", 1)
    again = validate(plan, FLAT, engine=engine, start=off, control="pose", seed=1)
    assert again.final_distance == tight.final_distance
    other = validate(plan, FLAT, engine=engine, start=off, control="pose", seed=2)
    assert other.final_distance != tight.final_distance


def test_a_servo_holds_the_wheels_of_any_robot() -> None:
    for name in ("small-differential", "omni-3"):
        report = validate(straight(robot(name)), FLAT, engine="mujoco", control="wheel servo")
        assert np.abs(report.wheel_deviation).max() < 5e-3


def test_what_cannot_be_checked_is_refused_by_name() -> None:
    plan = straight(robot("small-differential"))
    with pytest.raises(ArgumentError, match=r"control.*wheel servo or pose"):
        validate(plan, FLAT, control="pose and phase")
    with pytest.raises(ArgumentError, match="critical"):
        validate(straight(robot("loc8")), FLAT, control="pose and phase")
    with pytest.raises(ArgumentError, match="seed"):
        validate(plan, FLAT, seed=-1)
    with pytest.raises(ArgumentError, match=r"trajectory\.robot"):
        validate(time_scale(Path.through([[0, 0], [1, 0]]), LIMITS), FLAT)
    with pytest.raises(ArgumentError, match="engine"):
        validate(plan, FLAT, engine="bullet")
    small = Scene(0.8, HeightMap(np.zeros((9, 9)), 0.25, (-1.0, -1.0)))
    with pytest.raises(SimulationError, match="take a larger map"):
        validate(plan, small)


def test_reports_say_what_they_are() -> None:
    report = validate(straight(robot("loc8")), FLAT, engine="mujoco")
    assert isinstance(report, ValidationReport)
    assert report.length == pytest.approx(1.5, abs=0.01)
    assert report.recording.real_time_factor > 0.2
