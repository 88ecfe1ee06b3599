"""Scenes, commands, robots and the checks around a run; no engine needed."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from trajopt.errors import ArgumentError
from trajopt.robots.robot import robot as shipped
from trajopt.simulate.engine import ENGINES, Command, Observation, SimRobot, make_engine
from trajopt.simulate.scene import Flat, Ramp, Scene, Step, blocks
from trajopt.simulate.stepping import Pace, explosion
from trajopt.simulate.straight import straight_command


def corners(scene_terrain: Step | Ramp) -> np.ndarray:
    (block,) = blocks(scene_terrain)
    x, y, z, w = block.quaternion()
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    return np.array(block.centre) + (signs * np.array(block.size) / 2) @ rotation.T


def test_step_has_its_front_edge_where_asked() -> None:
    step = Step(0.05, (1.0, -0.5), direction=math.radians(30.0), width=2.0, depth=1.0)
    top = corners(step)[corners(step)[:, 2] > 0.0]
    np.testing.assert_allclose(top[:, 2], 0.05)
    front = np.array([math.cos(step.direction), math.sin(step.direction)])
    depth = (top[:, :2] - np.array(step.place)) @ front
    np.testing.assert_allclose(np.sort(depth), [0.0, 0.0, 1.0, 1.0], atol=1e-12)


def test_ramp_starts_on_the_ground_at_its_foot_and_rises() -> None:
    ramp = Ramp(math.radians(10.0), (2.0, 1.0), direction=math.radians(90.0), width=1.0, length=3.0)
    points = corners(ramp)
    foot = points[np.isclose(points[:, 2], 0.0, atol=1e-9)]
    np.testing.assert_allclose(foot[:, 1], 1.0, atol=1e-9)
    assert len(foot) == 2
    assert points[:, 2].max() == pytest.approx(3.0 * math.sin(math.radians(10.0)))
    assert not blocks(Flat())


def test_wheel_speeds_are_those_of_the_printed_matrix(mecanum_robot: SimRobot) -> None:
    # [guzman2015], section 1.4, in right-handed axes: FL = vx - vy - L wz, ... over R
    vx, vy, wz, arm, radius = 0.4, -0.7, 0.9, 0.376 + 0.316, 0.098
    expected = (
        np.array([vx - vy - arm * wz, vx + vy + arm * wz, vx + vy - arm * wz, vx - vy + arm * wz])
        / radius
    )
    np.testing.assert_allclose(mecanum_robot.wheel_speeds(vx, vy, wz), expected, rtol=1e-12)


def test_straight_command_turns_the_wheels_by_the_distance(mecanum_robot: SimRobot) -> None:
    command = straight_command(mecanum_robot, 0.0, 2.0, 0.8)
    grid = np.linspace(0.0, command.duration, 20001)
    speeds = np.array([command.at(t) for t in grid])
    turned = np.sum((speeds[1:] + speeds[:-1]) / 2 * np.diff(grid)[:, None], axis=0)
    np.testing.assert_allclose(turned, 2.0 / 0.098, rtol=1e-6)
    assert not np.any(command.at(command.duration + 1.0))
    with pytest.raises(ArgumentError, match="distance"):
        straight_command(mecanum_robot, 0.0, 0.1, 0.8)


@pytest.mark.parametrize(
    ("times", "speeds", "named"),
    [
        (np.array([0.0]), np.zeros((1, 4)), "times"),
        (np.array([0.5, 1.0]), np.zeros((2, 4)), "times"),
        (np.array([0.0, 1.0, 1.0]), np.zeros((3, 4)), "times"),
        (np.array([0.0, 1.0]), np.zeros((2, 3)), "wheel_speeds"),
        (np.array([0.0, 1.0]), np.full((2, 4), np.nan), "wheel_speeds"),
    ],
)
def test_bad_commands_name_the_argument(times: np.ndarray, speeds: np.ndarray, named: str) -> None:
    with pytest.raises(ArgumentError) as caught:
        Command(times, speeds)
    assert caught.value.argument == named


def test_bad_scenes_robots_and_paces_are_refused(mecanum_robot: SimRobot) -> None:
    for friction in (0.0, -1.0, math.nan):
        with pytest.raises(ArgumentError, match="friction"):
            Scene(friction)
    with pytest.raises(ArgumentError, match="height"):
        Step(0.0, (1.0, 0.0))
    with pytest.raises(ArgumentError, match="slope"):
        Ramp(2.0, (1.0, 0.0))
    with pytest.raises(ArgumentError, match="torque_limit"):
        dataclasses.replace(mecanum_robot, torque_limit=0.0)
    with pytest.raises(ArgumentError, match="wheels"):
        dataclasses.replace(mecanum_robot, wheels=mecanum_robot.wheels[:3])
    with pytest.raises(ArgumentError, match="step"):
        Pace(0.1, 1)


def test_unknown_engine_names_the_known_ones() -> None:
    with pytest.raises(ArgumentError, match="pybullet, mujoco"):
        make_engine("havok")
    assert {make_engine(name).name for name in ENGINES} == set(ENGINES)


def seen(**changes: object) -> Observation:
    calm = Observation(
        position=np.zeros(3),
        rotation=np.eye(3),
        velocity=np.zeros(3),
        wheel_angles=np.zeros(4),
        wheel_speeds=np.zeros(4),
        wheel_torques=np.zeros(4),
        contacts=4,
        penetration=1e-4,
    )
    return dataclasses.replace(calm, **changes)  # type: ignore[arg-type]


def test_explosions_are_told_from_calm_states() -> None:
    assert explosion(seen()) == ""
    assert "finite" in explosion(seen(position=np.array([np.nan, 0.0, 0.0])))
    assert "m/s" in explosion(seen(velocity=np.array([0.0, 0.0, 50.0])))
    assert "above" in explosion(seen(position=np.array([0.0, 0.0, 3.0])))
    assert "deep" in explosion(seen(penetration=0.05))
    assert "rad/s" in explosion(seen(wheel_speeds=np.array([0.0, 0.0, 1e4, 0.0])))


def test_a_simulated_robot_weighs_what_the_planner_says(mecanum_robot: SimRobot) -> None:
    """Chassis and wheels have the described mass and height of the centre of gravity."""
    body, wheels = shipped("loc8").body, mecanum_robot.wheels
    masses = np.array([mecanum_robot.chassis_mass, *(wheel.mass for wheel in wheels)])
    heights = np.array([mecanum_robot.cog_height, *(wheel.radius for wheel in wheels)])
    assert masses.sum() == pytest.approx(body.mass) == pytest.approx(14.5 + 4 * 1.44)
    assert masses @ heights / masses.sum() == pytest.approx(body.cog[2])
    assert mecanum_robot.wheel_positions == body.contacts
