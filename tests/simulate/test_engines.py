"""Both engines behind one contract: accuracy of both wheels, step climbs, repetition, agreement."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

from trajopt.errors import ArgumentError, MissingDependencyError
from trajopt.robots.robot import robot as shipped
from trajopt.simulate.engine import ENGINES, Command, Recording, SimRobot, make_engine
from trajopt.simulate.mujoco import MuJoCo
from trajopt.simulate.scene import Ramp, Scene, Step
from trajopt.simulate.straight import DIRECTIONS, deviation, straight_command
from trajopt.systems.smdw.loc8_model import roller_robot

pytest.importorskip("pybullet")
pytest.importorskip("mujoco")
SPEED = 3.0 / 3.6  # m/s, the thesis's 3 km/h
SMDW_LIMIT = {"pybullet": 0.03, "mujoco": 0.015}


@pytest.fixture(scope="module")
def smdw_robot() -> SimRobot:
    return roller_robot(shipped("loc8-smdw"))


@pytest.mark.parametrize(("name", "direction"), DIRECTIONS)
def test_mecanum_in_mujoco_over_five_metres(
    mecanum_robot: SimRobot, name: str, direction: float
) -> None:
    run = MuJoCo().run(
        mecanum_robot, Scene(), straight_command(mecanum_robot, direction, 5.0, SPEED)
    )
    off = deviation(run, direction, 5.0)
    assert not run.exploded, run.reason
    assert max(abs(off.along), abs(off.across)) <= 0.02, name


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("name", "direction"), DIRECTIONS)
def test_smdw_over_five_metres(
    smdw_robot: SimRobot, engine: str, name: str, direction: float
) -> None:
    run = make_engine(engine).run(
        smdw_robot, Scene(), straight_command(smdw_robot, direction, 5.0, SPEED)
    )
    off = deviation(run, direction, 5.0)
    assert not run.exploded, run.reason
    assert max(abs(off.along), abs(off.across)) <= SMDW_LIMIT[engine], name


@pytest.mark.parametrize("shape", ["spheres", "ellipsoid"])
def test_lateral_motion_loses_what_the_tilting_roller_axis_costs(shape: str) -> None:
    # While a roller carries from phi = -pi/n to pi/n its axis dips: R w cos(phi) = vx cos(phi) + vy
    # tan(angle), so the lateral speed is R w times the mean of cos(phi) = sin(pi/n)/(pi/n)
    changes = {"shape": shape, "count": 12, "radius": 0.0125}
    keys = {f"wheels.all.rollers.{key}": value for key, value in changes.items()}
    robot = roller_robot(shipped("loc8", keys))
    run = MuJoCo().run(robot, Scene(), straight_command(robot, math.pi / 2, 3.0, 0.5))
    expected = math.sin(math.pi / 12) / (math.pi / 12) - 1.0
    assert deviation(run, math.pi / 2, 3.0).along == pytest.approx(expected, abs=3e-3)


def test_cylinders_are_worse_than_barrels_on_the_double_wheel() -> None:
    worst = {}
    for shape in ("ellipsoid", "cylinder", "cone"):
        robot = roller_robot(shipped("loc8-smdw", {"wheels.all.rollers.shape": shape}))
        run = MuJoCo().run(robot, Scene(), straight_command(robot, math.pi / 2, 5.0, SPEED))
        off = deviation(run, math.pi / 2, 5.0)
        worst[shape] = max(abs(off.along), abs(off.across))
    assert worst["ellipsoid"] <= 0.015
    assert worst["cylinder"] > 0.03
    assert worst["cone"] > 0.03


def lateral_climb(robot: SimRobot, engine: str, phase: float) -> Recording:
    """Two seconds sideways against a 3.5 cm step; ``phase`` is positive along the commanded
    rotation."""
    speeds = robot.wheel_speeds(0.0, SPEED, 0.0)
    edge = robot.wheel_positions[0][1] + robot.wheels[0].width / 2.0 + 0.01
    angles = tuple(float(value) for value in np.sign(speeds) * phase)
    command = Command(
        np.array([0.0, 0.05, 2.0]),
        np.outer([0.0, 1.0, 1.0], speeds),
        start_wheel_angles=angles,  # type: ignore[arg-type]
    )
    scene = Scene(0.8, Step(0.035, (0.0, edge), math.pi / 2, width=3.0))
    return make_engine(engine).run(robot, scene, command)


@pytest.mark.parametrize("engine", ENGINES)
def test_lateral_climb_depends_on_wheel_phase(smdw_robot: SimRobot, engine: str) -> None:
    good, bad = (lateral_climb(smdw_robot, engine, phase) for phase in (-0.1, 0.9))
    assert not good.exploded
    assert not bad.exploded
    risen = good.wheel_heights.max(axis=0) - 0.098
    assert np.sum(risen > 0.7 * 0.035) >= 2
    assert np.all(bad.wheel_heights.max(axis=0) - 0.098 < 0.7 * 0.035)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_ramp_lifts_and_pitches_the_robot(mecanum_robot: SimRobot, engine: str) -> None:
    slope = math.radians(5.0)
    scene = Scene(0.8, Ramp(slope, (0.6, 0.0)))
    run = make_engine(engine).run(
        mecanum_robot, scene, straight_command(mecanum_robot, 0.0, 2.0, 1.0, ramp=0.3)
    )
    # all four wheels stand on the plate at the end: pitch equals the slope (nose up is negative
    # about +y)
    assert run.pitch[-1] == pytest.approx(-slope, abs=math.radians(0.3))
    assert run.pose[-1, 0] < 2.0
    assert np.all(run.wheel_heights[-1] > 0.1)


def test_repetition_in_mujoco_is_bit_identical_and_starts_as_asked(smdw_robot: SimRobot) -> None:
    speeds = np.outer([0.0, 1.0, 1.0], [6.0, 2.0, 3.0, 5.0])
    command = Command(np.array([0.0, 0.2, 0.5]), speeds, (1.0, -2.0, 3.0), (9.0, -7.5, 0.3, 0.0))
    first, again = (MuJoCo().run(smdw_robot, Scene(0.6), command) for _ in range(2))
    for name in (
        "times",
        "pose",
        "height",
        "roll",
        "pitch",
        "wheel_angles",
        "wheel_speeds",
        "contacts",
    ):
        assert getattr(first, name).tobytes() == getattr(again, name).tobytes(), name
    np.testing.assert_allclose(first.pose[0], [1.0, -2.0, 3.0], atol=2e-3)
    np.testing.assert_allclose(first.wheel_angles[0], [9.0, -7.5, 0.3, 0.0], atol=2e-2)


def test_engines_agree_on_a_curved_drive(mecanum_robot: SimRobot) -> None:
    times = np.linspace(0.0, 2.0, 41)
    ramp = np.minimum(1.0, np.minimum(times, 2.0 - times) / 0.3)
    speeds = np.array(
        [
            s * mecanum_robot.wheel_speeds(0.5, 0.4 * math.sin(t), 0.6)
            for s, t in zip(ramp, times, strict=True)
        ]
    )
    ends = [
        make_engine(name).run(mecanum_robot, Scene(), Command(times, speeds)).pose[-1]
        for name in ENGINES
    ]
    assert np.hypot(*(ends[0] - ends[1])[:2]) < 0.02
    assert abs(ends[0][2] - ends[1][2]) < math.radians(1.5)


def test_an_explosion_is_reported_not_returned_as_motion(smdw_robot: SimRobot) -> None:
    # the robot starts inside a block: the engine throws it out or leaves it deep inside
    scene = Scene(0.8, Step(0.3, (-2.0, 0.0)))
    command = Command(np.array([0.0, 0.5]), np.zeros((2, 4)))
    for name in ENGINES:
        run = make_engine(name).run(smdw_robot, scene, command, settle=0.0)
        assert run.exploded, name
        assert run.reason


def test_missing_mujoco_says_how_to_get_it(
    mecanum_robot: SimRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    command = Command(np.array([0.0, 0.1]), np.zeros((2, 4)))
    with pytest.raises(MissingDependencyError, match=r"trajopt\[simulate\]"):
        MuJoCo().run(mecanum_robot, Scene(), command)


@pytest.mark.parametrize(
    "options", [{"contact_time": 0.001}, {"wheel_gain": -1.0}, {"iterations": 0}]
)
def test_bad_options_of_mujoco_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(ArgumentError, match=next(iter(options))):
        MuJoCo(**options)  # type: ignore[arg-type]
