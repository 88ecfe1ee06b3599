"""Wheel commands of any robot: rolling rows by hand, and back to the twist."""

from __future__ import annotations

import math

import numpy as np
import pytest

from trajopt.control.wheels import SLOW, WheelCommands
from trajopt.robots import robot

TWISTS = np.random.default_rng(5).uniform(-1.0, 1.0, (20, 3)) * [1.0, 0.5, 1.0]


@pytest.mark.parametrize(
    "name", ["loc8", "omni-3", "powerbot", "swerve", "asoc-4", "asoc-3", "car"]
)
def test_what_wheels_are_told_is_the_twist_that_they_measure(name: str) -> None:
    machine = robot(name)
    wheels, rng = WheelCommands(machine), np.random.default_rng(1)
    count = len(wheels.steering.names)
    for twist in TWISTS:
        given = machine.drivable @ machine.drivable.T @ twist
        if name == "car":  # as sharp as it steers, and faster than wheels that keep their angle
            given[0] += math.copysign(0.1, given[0])
            given[2] *= 0.05
        castors = np.zeros(count)
        swivels = rng.uniform(-3.0, 3.0, len(wheels._swivels))
        castors = wheels.measured(castors, swivels)
        speeds, steering = wheels.at(given, castors)
        np.testing.assert_allclose(wheels.twist(speeds, steering), given, atol=1e-9)


def test_a_swerve_wheel_turns_the_shorter_way_and_rolls_backwards() -> None:
    machine = robot("swerve")
    wheels = WheelCommands(machine)
    speeds, steering = wheels.at(np.array([-1.0, -0.1, 0.0]), np.zeros(4))
    np.testing.assert_allclose(steering, math.atan(0.1))
    np.testing.assert_allclose(speeds, -math.hypot(1.0, 0.1) / 0.05)
    speeds, steering = wheels.at(np.array([0.0, 1.0, 0.0]), np.full(4, 5.0))
    np.testing.assert_allclose(steering, 1.5 * math.pi)
    np.testing.assert_allclose(speeds, -20.0)


def test_slow_wheels_keep_their_angles_and_roll_what_lies_along_them() -> None:
    wheels = WheelCommands(robot("swerve"))
    held = np.array([0.3, 0.3, 0.3, 0.3])
    speeds, steering = wheels.at(np.array([0.0, 0.9 * SLOW, 0.0]), held)
    np.testing.assert_array_equal(steering, held)
    np.testing.assert_allclose(speeds, 0.9 * SLOW * math.sin(0.3) / 0.05)


def test_a_car_turns_as_sharply_as_it_can() -> None:
    """Its middle front wheel at the end of the range, forwards and backwards, to either side."""
    machine = robot("car")
    wheels, most, base = WheelCommands(machine), 0.4189, 0.3302
    for speed, turn in ((1.0, 9.0), (1.0, -9.0), (-1.0, 9.0), (-1.0, -9.0)):
        speeds, steering = wheels.at(np.array([speed, 0.0, turn]), np.zeros(4))
        found = wheels.twist(speeds, steering)
        allowed = math.copysign(math.tan(most) / base, turn)
        np.testing.assert_allclose(found, [speed, 0.0, allowed], atol=1e-5)
        rear = (speed - allowed * np.array([0.114, -0.114])) / 0.05
        np.testing.assert_allclose(speeds[2:], rear, rtol=1e-5)


def test_castors_with_motors_drive_at_the_angles_at_which_they_are_measured() -> None:
    """One module of ASOC at 0.5 rad, by the velocities of its two wheels' contacts."""
    machine = robot("asoc-4")
    wheels = WheelCommands(machine)
    swivels = np.array([0.5, 0.0, -2.0, 0.0])
    steering = wheels.measured(np.zeros(8), swivels)
    np.testing.assert_array_equal(steering, np.repeat(swivels, 2))
    twist = np.array([0.4, -0.2, 0.3])
    speeds, _ = wheels.at(twist, steering)
    v = np.array([0.4, -0.2 + 0.3 * 0.5])  # of the pivot at (0.5, 0)
    along = v @ [math.cos(0.5), math.sin(0.5)]
    across = v @ [-math.sin(0.5), math.cos(0.5)]
    turning = across / 0.1  # of the module in the world: its axle, 0.1 behind, does not slide
    np.testing.assert_allclose(speeds[:2], (along - np.array([-0.1, 0.1]) * turning) / 0.1)
