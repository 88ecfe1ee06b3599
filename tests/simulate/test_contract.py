"""Commands, the registry, sensors and the checks around a run; no engine needed."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from trajopt.errors import ArgumentError
from trajopt.robots import robot
from trajopt.simulate.engine import ENGINES, Command, Observation, make_engine
from trajopt.simulate.mujoco import MuJoCo
from trajopt.simulate.pybullet import PyBullet
from trajopt.simulate.scene import stage
from trajopt.simulate.sensors import Sensors, exact
from trajopt.simulate.stepping import Pace, explosion
from trajopt.simulate.straight import straight_command
from trajopt.world.height_map import HeightMap
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

FLAT = stage(Scene(0.8, Flat()))


def test_straight_command_turns_the_wheels_by_the_distance() -> None:
    command = straight_command(robot("loc8"), 0.0, 2.0, 0.8)
    grid = np.linspace(0.0, command.duration, 20001)
    speeds, angles = command.at(grid, 3)
    turned = np.sum((speeds[1:] + speeds[:-1]) / 2 * np.diff(grid)[:, None], axis=0)
    np.testing.assert_allclose(turned, 2.0 / 0.098, rtol=1e-6)
    assert not np.any(command.at(np.array([-1.0, command.duration + 1.0]), 0)[0])
    assert angles.shape == (20001, 3)
    assert not angles.any()
    with pytest.raises(ArgumentError, match="distance"):
        straight_command(robot("loc8"), 0.0, 0.1, 0.8)
    with pytest.raises(ArgumentError, match="direction"):
        straight_command(robot("car"), 0.5, 2.0, 0.8)


def test_angles_are_held_after_the_end_and_speeds_are_not() -> None:
    command = Command(
        np.array([0.0, 1.0]), np.array([[1.0], [3.0]]), np.array([[0.0, 0.2], [0.4, 0.2]])
    )
    speeds, angles = command.at(np.array([0.25, 2.0]), 2)
    np.testing.assert_allclose(speeds, [[1.5], [0.0]])
    np.testing.assert_allclose(angles, [[0.1, 0.2], [0.4, 0.2]])


@pytest.mark.parametrize(
    ("times", "speeds", "named"),
    [
        (np.array([0.0]), np.zeros((1, 4)), "times"),
        (np.array([0.5, 1.0]), np.zeros((2, 4)), "times"),
        (np.array([0.0, 1.0, 1.0]), np.zeros((3, 4)), "times"),
        (np.array([0.0, 1.0]), np.zeros((3, 4)), "wheel_speeds"),
        (np.array([0.0, 1.0]), np.full((2, 4), np.nan), "wheel_speeds"),
    ],
)
def test_bad_commands_name_the_argument(times: np.ndarray, speeds: np.ndarray, named: str) -> None:
    with pytest.raises(ArgumentError) as caught:
        Command(times, speeds)
    assert caught.value.argument == named


def test_bad_paces_are_refused_and_unknown_engines_name_the_known_ones() -> None:
    with pytest.raises(ArgumentError, match="step"):
        Pace(0.1, 1)
    with pytest.raises(ArgumentError, match="auto, mujoco, pybullet"):
        make_engine("havok")
    assert {make_engine(name).name for name in ENGINES} == set(ENGINES)
    assert make_engine("auto").name == "mujoco"
    assert make_engine("auto", picture=True).name == "pybullet"


def test_auto_takes_what_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "importlib.util.find_spec", lambda name: None if name == "mujoco" else object()
    )
    assert make_engine("auto").name == "pybullet"


@pytest.mark.parametrize(
    ("engine", "options"),
    [
        (MuJoCo, {"contact_time": 0.001}),
        (MuJoCo, {"motor_impedance": 1.0}),
        (MuJoCo, {"iterations": 0}),
        (PyBullet, {"step": 0.5}),
        (PyBullet, {"solver_iterations": 0}),
        (PyBullet, {"wheel_gain": 0.0}),
    ],
)
def test_bad_options_are_refused(engine, options: dict[str, float]) -> None:
    with pytest.raises(ArgumentError, match=next(iter(options))):
        engine(**options)


def seen(**changes: object) -> Observation:
    calm = Observation(
        position=np.zeros(3),
        rotation=np.eye(3),
        velocity=np.zeros(3),
        spin=np.zeros(3),
        wheel_angles=np.zeros(4),
        wheel_speeds=np.zeros(4),
        wheel_torques=np.zeros(4),
        wheel_places=np.zeros((4, 3)),
        angles=np.zeros(0),
        swivels=np.zeros(0),
        loads=np.zeros(4),
        slip=np.zeros(4),
        sliding=np.zeros((4, 2)),
        suspension=np.zeros(0),
        spin_angles=np.zeros(4),
        contacts=4,
        penetration=1e-4,
        hits=(),
    )
    return dataclasses.replace(calm, **changes)  # type: ignore[arg-type]


def test_explosions_are_told_from_calm_states() -> None:
    assert explosion(seen(), FLAT) == ""
    assert "finite" in explosion(seen(position=np.array([np.nan, 0.0, 0.0])), FLAT)
    assert "m/s" in explosion(seen(velocity=np.array([0.0, 0.0, 50.0])), FLAT)
    assert "above" in explosion(seen(position=np.array([0.0, 0.0, 3.0])), FLAT)
    assert "deep" in explosion(seen(penetration=0.05), FLAT)
    assert "rad/s" in explosion(seen(wheel_speeds=np.array([0.0, 0.0, 1e4, 0.0])), FLAT)
    assert "tipped" in explosion(seen(rotation=np.diag([1.0, -1.0, -1.0])), FLAT)
    high = stage(Scene(0.8, HeightMap(np.full((9, 9), 3.0), 0.5, (-2.0, -2.0))))
    assert explosion(seen(position=np.array([0.0, 0.0, 3.0])), high) == ""
    away = seen(position=np.array([0.0, 0.0, 3.0]), wheel_places=np.full((4, 3), 2.5))
    assert "left the height map" in explosion(away, high)


def test_sensors_measure_when_they_are_due_with_their_deviations() -> None:
    sense = Sensors(0.05, 0.01, 0.02).sense(np.random.default_rng(5))
    again = np.random.default_rng(5)
    row = seen(position=np.array([1.0, 2.0, 0.0]), wheel_angles=np.arange(4.0))
    times = 0.01 * np.arange(11)
    told = [sense(float(t), row) for t in times]
    assert [t for t, m in zip(times, told, strict=True) if m.pose is not None] == pytest.approx(
        [0.0, 0.05, 0.1]
    )
    expected = np.array([1.0, 2.0, 0.0]) + again.normal(0.0, 1.0, 3) * [0.01, 0.01, 0.02]
    np.testing.assert_array_equal(told[0].pose, expected)
    np.testing.assert_array_equal(told[3].wheel_angles, np.arange(4.0))
    assert Sensors(math.inf).sense(again)(0.0, row).pose is not None
    never = Sensors(math.inf).sense(again)
    never(0.0, row)
    assert never(100.0, row).pose is None
    np.testing.assert_array_equal(exact(0.0, row).pose, [1.0, 2.0, 0.0])
    with pytest.raises(ArgumentError, match="sensors"):
        Sensors(period=-1.0)
