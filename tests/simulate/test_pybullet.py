"""LOC8 on Mecanum wheels in Bullet: accuracy over 5 m, repetition, errors."""

from __future__ import annotations

import dataclasses
import math
import sys

import numpy as np
import pytest

from trajopt.errors import ArgumentError, MissingDependencyError
from trajopt.robots.robot import robot
from trajopt.simulate.engine import Camera, Command, Observation, SimRobot
from trajopt.simulate.pybullet import PyBullet
from trajopt.simulate.scene import Scene, Step
from trajopt.simulate.straight import DIRECTIONS, deviation, straight_command
from trajopt.systems.smdw.loc8_model import roller_robot

pytest.importorskip("pybullet")
SPEED = 3.0 / 3.6  # m/s, the thesis's 3 km/h


@pytest.mark.parametrize(("name", "direction"), DIRECTIONS)
def test_five_metres_within_two_percent(
    mecanum_robot: SimRobot, name: str, direction: float
) -> None:
    command = straight_command(mecanum_robot, direction, 5.0, SPEED)
    run = PyBullet().run(mecanum_robot, Scene(), command)
    off = deviation(run, direction, 5.0)
    assert not run.exploded, run.reason
    assert abs(off.along) <= 0.02, name
    assert abs(off.across) <= 0.02, name
    assert abs(off.yaw) <= math.radians(2.0), name
    # wheels follow the commanded angle, counted over many turns
    turned = 5.0 / SPEED * command.wheel_speeds[1]
    np.testing.assert_allclose(run.wheel_angles[-1], turned, atol=0.01)
    np.testing.assert_allclose(run.wheel_heights, 0.098, atol=1e-3)


def test_repetition_is_bit_identical_and_starts_as_asked(mecanum_robot: SimRobot) -> None:
    times = np.array([0.0, 0.2, 0.5])
    command = Command(
        times,
        np.array([[0, 0, 0, 0], [6.0, 2.0, 3.0, 5.0], [6.0, 2.0, 3.0, 5.0]]),
        (1.0, -2.0, 3.0),
        (9.0, -7.5, 0.3, 0.0),
    )
    first, again = (PyBullet().run(mecanum_robot, Scene(0.6), command) for _ in range(2))
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
    np.testing.assert_allclose(first.wheel_angles[0], [9.0, -7.5, 0.3, 0.0], atol=1e-3)
    assert first.times[-1] == pytest.approx(0.5)


def test_a_turn_on_the_spot_turns_by_what_was_asked(mecanum_robot: SimRobot) -> None:
    speeds = mecanum_robot.wheel_speeds(0.0, 0.0, 1.0)
    command = Command(np.array([0.0, 0.3, 1.3, 1.6]), np.outer([0.0, 1.0, 1.0, 0.0], speeds))
    run = PyBullet().run(mecanum_robot, Scene(), command)
    assert run.pose[-1, 2] == pytest.approx(1.3, rel=0.03)
    assert np.hypot(*run.pose[-1, :2]) < 0.02


def test_controller_takes_over_the_wheels(mecanum_robot: SimRobot) -> None:
    def back(time: float, seen: Observation) -> np.ndarray:
        return np.full(4, -2.0) - 0.0 * time * seen.wheel_angles

    command = Command(np.array([0.0, 0.5]), np.full((2, 4), 5.0))
    run = PyBullet().run(mecanum_robot, Scene(), command, controller=back)
    np.testing.assert_allclose(run.wheel_angles[-1], -1.0, atol=0.05)


def test_a_wall_stops_the_robot_and_a_picture_shows_it(mecanum_robot: SimRobot) -> None:
    scene = Scene(0.6, Step(0.3, (0.6, 0.0)))
    command = straight_command(mecanum_robot, 0.0, 0.6, 0.6, ramp=0.2)
    run = PyBullet().run(mecanum_robot, scene, command, picture=Camera(width=160, height=120))
    assert run.pose[-1, 0] < 0.6 - 0.376 - 0.098 + 0.03
    assert run.picture is not None
    assert run.picture.shape == (120, 160, 3)
    assert run.picture.dtype == np.uint8
    assert len(np.unique(run.picture.reshape(-1, 3), axis=0)) > 40


def test_too_many_joints_and_unknown_shapes_are_refused_before_bullet_reads_zeros() -> None:
    command = Command(np.array([0.0, 0.1]), np.zeros((2, 4)))

    def changed(key: str, value: object) -> SimRobot:
        return roller_robot(robot("loc8", {f"wheels.all.rollers.{key}": value}))

    with pytest.raises(ArgumentError, match=r"124 joints.*at most 121"):
        PyBullet().run(changed("count", 30), Scene(), command)
    with pytest.raises(ArgumentError, match="ellipsoid"):
        PyBullet().run(changed("shape", "ellipsoid"), Scene(), command)


@pytest.mark.parametrize("options", [{"step": 0.5}, {"solver_iterations": 0}, {"wheel_gain": 0.0}])
def test_bad_options_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(ArgumentError, match=next(iter(options))):
        dataclasses.replace(PyBullet(), **options)  # type: ignore[arg-type]


def test_bad_settle_is_refused(mecanum_robot: SimRobot) -> None:
    command = Command(np.array([0.0, 0.1]), np.zeros((2, 4)))
    with pytest.raises(ArgumentError, match="settle"):
        PyBullet().run(mecanum_robot, Scene(), command, settle=-1.0)


def test_missing_package_says_how_to_get_it(
    mecanum_robot: SimRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", None)
    command = Command(np.array([0.0, 0.1]), np.zeros((2, 4)))
    with pytest.raises(MissingDependencyError, match=r"trajopt\[simulate\]"):
        PyBullet().run(mecanum_robot, Scene(), command)
