"""Wheels that push a body: closed forms of the motor's lag, of sliding, of a corner, of slopes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trajopt.systems.asoc.grip import (
    PROPORTIONAL,
    SLIP_STIFFNESS,
    Footing,
    Motion,
    next_motion,
    wheel_lag,
)
from trajopt.systems.asoc.modules import TOTAL_MASS, AsocGeometry, link_velocities, steering_rates
from trajopt.systems.asoc.tracking import body_twist, wheel_commands

GEOMETRY = AsocGeometry(4)
G = 9.80665
FRICTION = 0.6
STEP = 1e-3
LEVEL = Footing(np.zeros((1, 4, 2)), np.zeros((1, 4)), np.ones((1, 4, 2)))
AHEAD = np.zeros((1, 4))


def moving(twist, alpha=AHEAD) -> Motion:
    """Rolling without slip at a body twist."""
    body = np.array([twist], dtype=float)
    turning = steering_rates(
        alpha, link_velocities(GEOMETRY.positions, body), GEOMETRY.offset, 0.0 * body[:, 2:]
    )
    return Motion(body, turning, commands(twist, alpha))


def commands(twist, alpha=AHEAD) -> np.ndarray:
    return wheel_commands(
        GEOMETRY, alpha, np.array([twist], dtype=float), np.zeros((1, 4)), np.zeros((1, 4, 2))
    )


def test_a_wheel_that_accelerates_the_robot_runs_late_by_the_loops_lag_and_by_creep() -> None:
    """v = a t - a (lag + v/(g stiffness)) once the transient is over."""
    push, motion = 1.2, Motion.rest(1, 4)
    for k in range(1, 1201):
        wanted = commands([push * k * STEP, 0, 0])
        motion = next_motion(GEOMETRY, AHEAD, motion, wanted, LEVEL, np.inf, STEP)
    speed = motion.twist[0, 0]
    late = push * (wheel_lag(GEOMETRY) + speed / (G * SLIP_STIFFNESS))
    assert push * 1.2 - speed == pytest.approx(late, rel=0.02)
    assert np.abs(motion.twist[0, 1:]).max() < 1e-12


def test_without_slip_the_body_takes_the_twist_that_fits_the_wheels() -> None:
    rng = np.random.default_rng(3)
    alpha = rng.uniform(-3, 3, (1, 4))
    for wanted in (
        commands([0.4, -0.3, 0.0], alpha),
        1e-3 * rng.uniform(-1, 1, (1, 4, 2)),
    ):  # agreeing or at odds
        motion = Motion.rest(1, 4)
        for _ in range(400):
            motion = next_motion(GEOMETRY, alpha, motion, wanted, LEVEL, np.inf, STEP)
        fit = body_twist(GEOMETRY, alpha, wanted, LEVEL.tilt, LEVEL.slope)
        np.testing.assert_allclose(
            motion.twist, fit, atol=0.01 * np.abs(fit).max()
        )  # stiffness across is finite
        links = link_velocities(GEOMETRY.positions, motion.twist)  # axles do not slide sideways
        np.testing.assert_allclose(
            motion.turning,
            steering_rates(alpha, links, GEOMETRY.offset, 0.0),
            atol=0.05 * np.abs(motion.turning).max(),
        )


def test_large_friction_tends_to_no_slip() -> None:
    rng = np.random.default_rng(4)
    alpha, wanted = rng.uniform(-3, 3, (1, 4)), rng.uniform(-1, 1, (1, 4, 2))
    found = [
        next_motion(GEOMETRY, alpha, Motion.rest(1, 4), wanted, LEVEL, friction, STEP).twist
        for friction in (0.6, 6.0, 60.0, 600.0, np.inf)
    ]
    gap = [np.abs(f - found[-1]).max() for f in found[:-1]]
    assert gap[0] > gap[1] > gap[2]
    assert gap[3] < 1e-12


def test_locked_wheels_brake_at_friction_along_and_across() -> None:
    for alpha in (AHEAD, AHEAD + np.pi / 2):
        motion = replace(moving([1.5, 0, 0]), turning=np.zeros((1, 4)), rims=np.zeros((1, 4, 2)))
        after = next_motion(GEOMETRY, alpha, motion, np.zeros((1, 4, 2)), LEVEL, FRICTION, STEP)
        if alpha[0, 0] == 0.0:
            np.testing.assert_allclose(after.twist, [[1.5 - FRICTION * G * STEP, 0, 0]], atol=2e-5)
        else:  # castors turn instead of sliding sideways, so the body brakes less
            assert 1.5 - FRICTION * G * STEP < after.twist[0, 0] < 1.5


def test_a_corner_at_full_speed_gets_friction_over_the_square_root_of_two() -> None:
    """From rolling ahead to a command to the left, one wheel of each module brakes at full friction
    and the other holds the axle: mu g / 2 backwards and mu g / 2 to the left."""
    alpha, motion, speeds = AHEAD, moving([1.5, 0, 0]), []
    for _ in range(100):
        motion = next_motion(
            GEOMETRY, alpha, motion, commands([0, 1.5, 0], alpha), LEVEL, FRICTION, STEP
        )
        alpha = alpha + STEP * motion.turning
        speeds.append(motion.twist[0])
    rate = (speeds[-1] - speeds[20]) / (79 * STEP)
    np.testing.assert_allclose(rate, [-FRICTION * G / 2, FRICTION * G / 2, 0], atol=0.03)


def test_on_a_slope_wheels_sag_hold_or_slide() -> None:
    """Commanded to stand: they run backwards by force over motor stiffness, or slide at g (tan
    gamma - mu)."""
    slope = 0.3
    incline = replace(LEVEL, slope=np.full((1, 4, 2), slope))
    motion = Motion.rest(1, 4)
    for _ in range(300):
        motion = next_motion(GEOMETRY, AHEAD, motion, np.zeros((1, 4, 2)), incline, FRICTION, STEP)
    sag = TOTAL_MASS * G * np.tan(slope) / 8 / (PROPORTIONAL / GEOMETRY.wheel_radius**2)
    np.testing.assert_allclose(motion.rims, -sag, rtol=0.02)
    assert motion.twist[0, 0] == pytest.approx(-sag * np.cos(slope), rel=0.1)  # and creeps a little
    low = 0.1
    for _ in range(50):
        motion = next_motion(GEOMETRY, AHEAD, motion, np.zeros((1, 4, 2)), incline, low, STEP)
    before = motion.twist[0, 0]
    after = next_motion(GEOMETRY, AHEAD, motion, np.zeros((1, 4, 2)), incline, low, STEP).twist[
        0, 0
    ]
    assert (before - after) / STEP == pytest.approx(G * (np.tan(slope) - low), rel=0.02)


def test_wheels_in_the_air_push_nothing() -> None:
    free = replace(LEVEL, touch=np.zeros((1, 4, 2)))
    start = moving([0.7, 0.2, 0.0])
    after = next_motion(GEOMETRY, AHEAD, start, commands([-1, 0, 1]), free, FRICTION, STEP)
    np.testing.assert_allclose(after.twist, start.twist, atol=1e-12)
    np.testing.assert_allclose(after.turning, start.turning, atol=1e-9)
    np.testing.assert_array_less(after.rims, start.rims + 1.0)  # but follow their command
    one = np.ones((1, 4, 2))
    one[0, 1] = 0.0
    spinning = commands([0.7, 0.0, 0.0])
    spinning[0, 1] = 99.0
    after = next_motion(
        GEOMETRY, AHEAD, moving([0.7, 0, 0]), spinning, replace(LEVEL, touch=one), FRICTION, STEP
    )
    np.testing.assert_allclose(after.twist, [[0.7, 0, 0]], atol=1e-9)


def test_a_free_body_keeps_its_velocity_in_the_world_while_it_turns() -> None:
    free = replace(LEVEL, touch=np.zeros((1, 4, 2)))
    motion, heading = replace(Motion.rest(1, 4), twist=np.array([[1.0, 0.0, 2.0]])), 0.0
    for _ in range(500):
        heading += 2.0 * STEP
        motion = next_motion(GEOMETRY, AHEAD, motion, np.zeros((1, 4, 2)), free, FRICTION, STEP)
    np.testing.assert_allclose(motion.twist[0], [np.cos(heading), -np.sin(heading), 2.0], atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), friction=st.floats(0.05, 2.0))
def test_level_ground_never_pushes_harder_than_friction(seed, friction) -> None:
    rng = np.random.default_rng(seed)
    alpha = rng.uniform(-3, 3, (3, 4))
    twist = rng.uniform(-1.5, 1.5, (3, 3)) * [1, 1, 0]
    start = Motion(twist, rng.uniform(-5, 5, (3, 4)), rng.uniform(-2, 2, (3, 4, 2)))
    touch = (rng.random((3, 4, 2)) > 0.2).astype(float)
    ground = Footing(np.zeros((3, 4, 2)), np.zeros((3, 4)), touch)
    after = next_motion(
        GEOMETRY, alpha, start, rng.uniform(-3, 3, (3, 4, 2)), ground, friction, 0.01
    )
    rate = (after.twist - start.twist) / 0.01
    assert (
        np.hypot(rate[:, 0], rate[:, 1]).max() <= friction * G * 1.02
    )  # the iteration ends within 2 %
    assert np.all(np.isfinite(after.rims))
