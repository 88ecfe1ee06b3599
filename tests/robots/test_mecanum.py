"""The Mecanum platform from Swedish rows against [guzman2015]'s printed matrices."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trajopt.errors import ArgumentError
from trajopt.robots.actuator import Actuator
from trajopt.robots.robot import robot
from trajopt.robots.wheel import Wheel, WheelKind

L, WHEEL_RADIUS = 0.376 + 0.316, 0.098  # m
# [guzman2015], inverse kinematics as printed: y points right there, yaw is counter-clockwise.
PRINTED = np.array([[1, 1, -L], [1, -1, L], [1, -1, -L], [1, 1, L]]) / WHEEL_RADIUS
MIRROR = np.diag([1.0, -1.0, 1.0])  # y right <-> y left


def test_printed_inverse_is_ours_with_y_mirrored():
    np.testing.assert_allclose(robot("loc8").inverse @ MIRROR, PRINTED, atol=1e-12)


def test_printed_forward_is_ours_with_y_mirrored():
    # R/4 [[1,1,1,1],[1,-1,-1,1],[-1/L,1/L,-1/L,1/L]]; the print garbles it.
    printed = (
        WHEEL_RADIUS / 4 * np.array([[1, 1, 1, 1], [1, -1, -1, 1], [-1 / L, 1 / L, -1 / L, 1 / L]])
    )
    np.testing.assert_allclose(MIRROR @ robot("loc8").forward, printed, atol=1e-12)


def test_forward_inverts_inverse():
    np.testing.assert_allclose(robot("loc8").forward @ robot("loc8").inverse, np.eye(3), atol=1e-12)


def test_heading_identity_of_table_5_5():
    # -theta1 + theta2 - theta3 + theta4 = 4 (l1 + l2)/R dpsi
    wheels = robot("loc8").inverse @ np.array([0.3, -0.2, 0.7])
    assert np.dot([-1, 1, -1, 1], wheels) == pytest.approx(4 * 7.060 * 0.7, rel=1e-3)


@given(
    st.floats(0.01, 1), st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3), st.floats(-1.2, 1.2)
)
def test_swedish_rows_hold_for_a_rolling_wheel(radius, vx, vy, wz, gamma):
    """Contact point velocity along the roller axis is zero; across it the roller turns."""
    wheel = Wheel(WheelKind.SWEDISH, 0.5, 0.6, 0.3, radius, gamma=gamma)
    x, y = wheel.position
    direction = np.array([np.sin(wheel.alpha + wheel.beta), -np.cos(wheel.alpha + wheel.beta)])
    centre = np.array([vx - wz * y, vy + wz * x])
    row, side = wheel.rolling(), wheel.sliding()
    spin = (row.x * vx + row.y * vy + row.yaw * wz) / row.spin
    slip = centre - radius * spin * direction
    turn = wheel.alpha + wheel.beta + gamma
    assert slip @ [np.sin(turn), -np.cos(turn)] == pytest.approx(0, abs=1e-9)
    free = side.x * vx + side.y * vy + side.yaw * wz - side.spin * spin
    assert slip @ [np.cos(turn), np.sin(turn)] == pytest.approx(free, abs=1e-9)


@pytest.mark.parametrize(
    "arguments",
    [
        {"radius": 0.0},
        {"radius": float("nan")},
        {"l": -1.0},
        {"gamma": np.pi / 2},
    ],
)
def test_impossible_wheels_are_rejected(arguments):
    good = {"kind": WheelKind.SWEDISH, "l": 0.5, "alpha": 0.0, "beta": 0.0, "radius": 0.1}
    with pytest.raises(ArgumentError, match=next(iter(arguments))):
        Wheel(**{**good, **arguments})


def _integral(w, sat, dz):
    """The antiderivative of the actuator's output."""
    return max(min(abs(w), sat) ** 2 - dz**2, 0) / 2 + sat * max(abs(w) - sat, 0)


@given(st.floats(-80, 80), st.floats(-80, 80), st.floats(0, 5), st.floats(6, 60))
def test_step_mean_is_the_exact_integral(w0, w1, dz, sat):
    if abs(w1 - w0) < 1e-3:
        w1 = w0 + 1e-3
    expected = (_integral(w1, sat, dz) - _integral(w0, sat, dz)) / (w1 - w0)
    got = Actuator(sat, dz).step_mean((w0 + w1) / 2, (w1 - w0) / 2)
    assert got == pytest.approx(expected, abs=2e-8)


def test_step_mean_of_a_constant_speed_is_the_output():
    drive = Actuator(30.0, 2.3)
    for w in (-50.0, -10.0, -1.0, 0.0, 2.0, 29.0, 31.0):
        assert float(drive.step_mean(np.array(w), np.array(0.0))) == float(drive.output(w))


def test_ideal_actuator_changes_nothing():
    assert Actuator().is_ideal
    assert Actuator().step_mean(3.3, 1.0) == 3.3


@pytest.mark.parametrize(
    ("saturation", "dead_zone"), [(1.0, 2.0), (10.0, -1.0), (float("nan"), 0.0)]
)
def test_bad_actuators(saturation, dead_zone):
    with pytest.raises(ArgumentError, match="actuator"):
        Actuator(saturation, dead_zone)
