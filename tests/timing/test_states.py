"""States at times: the compiled pass against the readable one, and both against themselves."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from scaling_cases import HOLONOMIC_ONLY, PATHS, limit

from trajopt.limits.acceleration import Acceleration
from trajopt.limits.speed import Speed
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.paths.path import Path
from trajopt.robots.robot import robot
from trajopt.timing.nominal import nominal_timing
from trajopt.timing.scaling import time_scale
from trajopt.timing.states import readable_states

PLAIN = [name for name, path in PATHS.items() if path.coordinates.shape[1] == 2]
CUSPS = {
    "lane": [[0, 0], [1, 0], [2, 0.01], [1, 0.02], [0, 0.02]],
    "needle": [[0, 0], [1, 0], [0, 1e-3]],
}


def agree(trajectory, t, scale=1.0):
    ours, readable = trajectory.at(t), readable_states(trajectory, t)
    assert trajectory.course.level
    for field in fields(ours):
        mine, other = getattr(ours, field.name), getattr(readable, field.name)
        size = max(1.0, np.abs(other).max(initial=0.0))
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-12 * size * scale)


@pytest.mark.parametrize("shape", PLAIN)
@pytest.mark.parametrize("name", ["loc8", "powerbot"])
def test_compiled_states_are_the_readable_ones(shape, name):
    if name == "powerbot" and shape in HOLONOMIC_ONLY:
        pytest.skip("its wheels forbid the path")
    limits = [limit("speed"), limit("acceleration")]
    trajectory = time_scale(
        PATHS[shape], limits, robot=robot(name), start_wheels=(0.3,) * _rolling(name)
    )
    t = np.linspace(0.0, trajectory.duration, 501)
    agree(trajectory, t)
    agree(trajectory, np.random.default_rng(3).permutation(t))
    agree(trajectory, trajectory.duration)
    agree(trajectory, trajectory.times)


@pytest.mark.parametrize("name", CUSPS)
def test_near_cusps_too(name):
    """Positions are as exact as the path's own coordinates; rates change fast there."""
    path = Path.through(CUSPS[name])
    limits = [Speed(1.0), Acceleration(1.0, 1.0), WheelSpeed(12.0)]
    trajectory = time_scale(path, limits, robot=robot("powerbot"))
    t = np.linspace(0.0, trajectory.duration, 4001)
    ours, readable = trajectory.at(t), readable_states(trajectory, t)
    np.testing.assert_allclose(ours.pose[:, :2], readable.pose[:, :2], rtol=0, atol=1e-12)
    np.testing.assert_allclose(ours.pose[:, 2], readable.pose[:, 2], rtol=0, atol=1e-6)
    np.testing.assert_allclose(ours.spin_angles, readable.spin_angles, rtol=0, atol=1e-6)


def test_motions_without_a_profile():
    trajectory = nominal_timing(PATHS["slalom"], 7.0, [Speed(1.0)], robot=robot("loc8"))
    agree(trajectory, np.linspace(0.0, 7.0, 301))
    bare = time_scale(PATHS["slalom"], [Speed(1.0), Acceleration(1.0, 1.0)], engine="toppra")
    agree(bare, np.linspace(0.0, bare.duration, 301))


def test_castors_spin_by_the_integral_of_their_rate():
    """Simpson's rule on rates at 40,001 times: no polynomial of the table enters the rates."""
    trajectory = time_scale(
        PATHS["slalom"], [Speed(1.0), Acceleration(1.0, 1.0)], robot=robot("powerbot")
    )
    t = np.linspace(0.0, trajectory.duration, 40_001)
    state = trajectory.at(t)
    for angle, rate in (
        (state.spin_angles, state.spin_rates),
        (state.steering_angles, state.steering_rates),
    ):
        pairs = (rate[:-2:2] + 4 * rate[1:-1:2] + rate[2::2]) * (t[1] / 3)
        np.testing.assert_allclose(
            angle[2::2] - angle[0], np.cumsum(pairs, axis=0), rtol=0, atol=2e-6
        )


def _rolling(name):
    return len(robot(name).wheels)
