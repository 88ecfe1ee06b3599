"""Both engines behind one contract: step climbs, steering, repetition, agreement, controllers."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

from trajopt.control.measured import Measured, Targets
from trajopt.errors import ArgumentError, MissingDependencyError
from trajopt.robots import Robot, robot
from trajopt.simulate.engine import ENGINES, Command, Recording
from trajopt.simulate.stepping import drive
from trajopt.simulate.straight import deviation, straight_command
from trajopt.world.obstacles import Step
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

pytest.importorskip("pybullet")
pytest.importorskip("mujoco")
SPEED = 3.0 / 3.6  # m/s, the thesis's 3 km/h
FLAT = Scene(0.8, Flat())
LOC8, SMDW = robot("loc8"), robot("loc8-smdw")


@pytest.mark.parametrize("shape", ["spheres", "ellipsoid"])
def test_lateral_motion_loses_what_the_tilting_roller_axis_costs(shape: str) -> None:
    # While a roller carries from phi = -pi/n to pi/n its axis dips: R w cos(phi) = vx cos(phi) + vy
    # tan(angle), so the lateral speed is R w times the mean of cos(phi) = sin(pi/n)/(pi/n)
    rollers = {"shape": shape, "count": 12, "radius": 0.0125}
    machine = robot("loc8", {f"wheels.all.rollers.{key}": v for key, v in rollers.items()})
    run = drive(machine, FLAT, straight_command(machine, math.pi / 2, 3.0, 0.5), engine="mujoco")
    expected = math.sin(math.pi / 12) / (math.pi / 12) - 1.0
    assert deviation(run, math.pi / 2, 3.0).along == pytest.approx(expected, abs=3e-3)


def test_cylinders_are_worse_than_barrels_on_the_double_wheel() -> None:
    worst = {}
    for shape in ("ellipsoid", "cylinder", "cone"):
        machine = robot("loc8-smdw", {"wheels.all.rollers.shape": shape})
        command = straight_command(machine, math.pi / 2, 5.0, SPEED)
        off = deviation(drive(machine, FLAT, command, engine="mujoco"), math.pi / 2, 5.0)
        worst[shape] = max(abs(off.along), abs(off.across))
    assert worst["ellipsoid"] <= 0.015
    assert worst["cylinder"] > 0.03
    assert worst["cone"] > 0.03


def lateral_climb(machine: Robot, engine: str, phase: float) -> Recording:
    """Two seconds sideways against a 3.5 cm step; ``phase`` is positive along the commanded
    rotation."""
    speeds = machine.inverse @ np.array([0.0, SPEED, 0.0])
    edge = 0.316 + 0.065 + 0.01
    command = Command(
        np.array([0.0, 0.05, 2.0]),
        np.outer([0.0, 1.0, 1.0], speeds),
        start_wheel_angles=np.sign(speeds) * phase,
    )
    step = Step("step", 0.035, (0.0, edge), math.pi / 2, width=3.0, depth=4.0)
    return drive(machine, Scene(0.8, Flat(), (step,)), command, engine=engine)


@pytest.mark.parametrize("engine", ENGINES)
def test_lateral_climb_depends_on_wheel_phase(engine: str) -> None:
    good, bad = (lateral_climb(SMDW, engine, phase) for phase in (-0.1, 0.9))
    assert not good.exploded
    assert not bad.exploded
    assert good.hits[0].name == "step"
    risen = good.wheel_heights.max(axis=0) - 0.098
    assert np.sum(risen > 0.7 * 0.035) >= 2
    assert np.all(bad.wheel_heights.max(axis=0) - 0.098 < 0.7 * 0.035)


@pytest.mark.parametrize(("engine", "machine"), [("mujoco", SMDW), ("pybullet", LOC8)])
def test_repetition_is_bit_identical_and_starts_as_asked(engine: str, machine: Robot) -> None:
    speeds = np.outer([0.0, 1.0, 1.0], [6.0, 2.0, 3.0, 5.0])
    angles = np.array([9.0, -7.5, 0.3, 0.0])
    command = Command(np.array([0.0, 0.2, 0.5]), speeds, None, (1.0, -2.0, 3.0), angles)
    first, again = (drive(machine, Scene(0.6, Flat()), command, engine=engine) for _ in range(2))
    for name in ("times", "pose", "height", "roll", "pitch", "wheel_angles", "slip", "loads"):
        assert getattr(first, name).tobytes() == getattr(again, name).tobytes(), name
    np.testing.assert_allclose(first.pose[0], [1.0, -2.0, 3.0], atol=2e-3)
    np.testing.assert_allclose(first.wheel_angles[0], angles, atol=2e-2)
    assert first.times[-1] == pytest.approx(0.5)


def test_engines_agree_on_a_curved_drive() -> None:
    times = np.linspace(0.0, 2.0, 41)
    ramp = np.minimum(1.0, np.minimum(times, 2.0 - times) / 0.3)
    twists = np.column_stack([np.full(41, 0.5), 0.4 * np.sin(times), np.full(41, 0.6)])
    command = Command(times, ramp[:, None] * twists @ LOC8.inverse.T)
    ends = [drive(LOC8, FLAT, command, engine=name).pose[-1] for name in ENGINES]
    assert np.hypot(*(ends[0] - ends[1])[:2]) < 0.02
    assert abs(ends[0][2] - ends[1][2]) < math.radians(1.5)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_car_turns_on_the_circle_that_its_steering_sets(engine: str) -> None:
    """Ackermann angles for a radius of 1.2 m about the middle of the rear axle."""
    car, radius, speed = robot("car"), 1.2, 0.6
    wheels = car.description.wheels
    places = np.array([wheel.position for wheel in wheels])
    arms = np.column_stack([radius - places[:, 1], places[:, 0]])
    spins = speed / radius * np.hypot(*arms.T) / 0.05
    angles = np.arctan2(arms[:2, 1], arms[:2, 0])
    times = np.array([0.0, 0.5, 3.0, 3.5])
    share = np.array([0.0, 1.0, 1.0, 0.0])
    command = Command(times, np.outer(share, spins), np.tile(angles, (4, 1)))
    run = drive(car, FLAT, command, engine=engine)
    np.testing.assert_allclose(run.angles[-1], angles, atol=math.radians(0.5))
    assert run.pose[-1, 2] == pytest.approx(3.0 * speed / radius, rel=0.02)
    x, y, yaw = run.pose[-1]
    assert (x, y) == pytest.approx((radius * math.sin(yaw), radius * (1 - math.cos(yaw))), abs=0.02)
    assert run.slip[20:].max() < 0.02
    far = Command(times, np.outer(share, spins), np.tile([1.2, 1.2], (4, 1)))
    beyond = drive(car, FLAT, far, engine=engine)
    assert np.abs(beyond.angles[-1]).max() < 0.4189 + 0.02  # the description's range


@pytest.mark.parametrize("engine", ENGINES)
def test_a_swerve_drives_sideways_with_its_wheels_turned(engine: str) -> None:
    swerve = robot("swerve")
    times, share = np.array([0.0, 0.5, 2.0, 2.5]), np.array([0.0, 1.0, 1.0, 0.0])
    radius = swerve.wheels[0].radius
    angles = np.full((4, 4), math.pi / 2)
    command = Command(times, np.outer(share, np.full(4, 0.5 / radius)), angles)
    run = drive(swerve, FLAT, command, engine=engine)
    assert run.pose[-1] == pytest.approx([0.0, 1.0, 0.0], abs=0.02)


@pytest.mark.parametrize("engine", ENGINES)
def test_castors_swing_behind(engine: str) -> None:
    small = robot("small-differential")
    back = straight_command(small, math.pi, 2.0, 0.4)
    run = drive(small, FLAT, back, engine=engine)
    assert abs(math.remainder(run.swivels[-1, 0] - math.pi, 2 * math.pi)) < 0.1
    asked = Command(back.times, back.wheel_speeds, start_swivels=np.array([math.pi]))
    calm = drive(small, FLAT, asked, engine=engine)
    assert abs(calm.swivels[:, 0] - math.pi).max() < 0.1
    assert calm.pose[-1] == pytest.approx([-2.0, 0.0, 0.0], abs=0.02)


@pytest.mark.parametrize("engine", ENGINES)
def test_motors_turn_no_faster_than_they_can(engine: str) -> None:
    small = robot("small-differential", {"motors.all.speed": 3.0})
    run = drive(small, FLAT, straight_command(small, 0.0, 1.0, 0.5), engine=engine)
    assert np.abs(run.wheel_speeds).max() < 3.1


@pytest.mark.parametrize("engine", ENGINES)
def test_controller_takes_over_the_wheels(engine: str) -> None:
    class Back:
        told: Measured

        def step(self, t: float, measured: Measured) -> Targets:  # noqa: ARG002
            self.told = measured
            return Targets(np.full(4, -2.0))

    back = Back()
    command = Command(np.array([0.0, 0.5]), np.full((2, 4), 5.0))
    run = drive(LOC8, FLAT, command, engine=engine, controller=back)
    # the first period ramps up from rest
    np.testing.assert_allclose(run.wheel_angles[-1], -1.0 + 0.01, atol=0.02)
    np.testing.assert_array_equal(back.told.wheel_angles, run.wheel_angles[-2])
    np.testing.assert_allclose(back.told.pose, run.pose[-2], atol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
def test_an_explosion_is_reported_not_returned_as_motion(engine: str) -> None:
    # the robot starts inside a block: the engine throws it out or leaves it deep inside
    block = Step("block", 0.3, (-2.0, 0.0), 0.0, width=4.0, depth=4.0)
    command = Command(np.array([0.0, 0.5]), np.zeros((2, 4)))
    run = drive(SMDW, Scene(0.8, Flat(), (block,)), command, engine=engine, settle=0.0)
    assert run.exploded
    assert run.reason


def test_wrong_sizes_and_too_many_joints_are_refused() -> None:
    command = Command(np.array([0.0, 0.1]), np.zeros((2, 4)))
    with pytest.raises(ArgumentError, match="wheel_speeds"):
        drive(LOC8, FLAT, Command(np.array([0.0, 0.1]), np.zeros((2, 3))))
    with pytest.raises(ArgumentError, match="start_wheel_angles"):
        drive(
            LOC8, FLAT, Command(command.times, command.wheel_speeds, None, (0, 0, 0), np.zeros(2))
        )
    with pytest.raises(ArgumentError, match="angles"):
        drive(LOC8, FLAT, Command(command.times, command.wheel_speeds, np.zeros((2, 1))))
    with pytest.raises(ArgumentError, match="settle"):
        drive(LOC8, FLAT, command, settle=-1.0)
    many = robot("loc8", {"wheels.all.rollers.count": 30})
    with pytest.raises(ArgumentError, match=r"124 joints.*at most 121"):
        drive(many, FLAT, command, engine="pybullet")
    round_ones = robot("loc8", {"wheels.all.rollers.shape": "ellipsoid"})
    with pytest.raises(ArgumentError, match="ellipsoid"):
        drive(round_ones, FLAT, command, engine="pybullet")


@pytest.mark.parametrize("engine", ENGINES)
def test_missing_package_says_how_to_get_it(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, engine, None)
    command = Command(np.array([0.0, 0.1]), np.zeros((2, 4)))
    with pytest.raises(MissingDependencyError, match=r"trajopt\[simulate\]"):
        drive(LOC8, FLAT, command, engine=engine)
