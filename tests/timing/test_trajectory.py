"""Trajectory: states in time, wheel angles, active limits."""

from __future__ import annotations

import numpy as np
import pytest
from scaling_cases import HOLONOMIC_ONLY, PATHS, ROBOTS, limit

from trajopt.errors import ArgumentError
from trajopt.paths.path import Path
from trajopt.timing.scaling import time_scale

DRIVE = [limit("speed"), limit("acceleration"), limit("wheel_acceleration")]


@pytest.mark.parametrize("shape", PATHS)
def test_twist_is_the_derivative_of_the_pose(shape):
    robot = ROBOTS["loc8" if shape in HOLONOMIC_ONLY else "rear_cog"]
    result = time_scale(PATHS[shape], DRIVE, robot=robot)
    h = 1e-5
    t = np.linspace(2 * h, result.duration - 2 * h, 200)
    before, here, after = result.at(t - h), result.at(t), result.at(t + h)
    rate = (after.pose - before.pose) / (2 * h)
    s = result.along(t)[0]
    planar = np.hypot(rate[:, 0], rate[:, 1])
    yaw = here.pose[:, 2]
    lift = (
        np.gradient(PATHS[shape].position(PATHS[shape].locate(s))[:, 2], s)
        if shape == "ramp"
        else 0 * s
    )
    level = np.sqrt(1 - lift**2) if shape == "ramp" else 1.0
    forward = np.cos(yaw) * rate[:, 0] + np.sin(yaw) * rate[:, 1]
    left = -np.sin(yaw) * rate[:, 0] + np.cos(yaw) * rate[:, 1]
    tolerance = 2e-3 if shape == "ramp" else 1e-4
    np.testing.assert_allclose(here.twist[:, 0] * level, forward, atol=tolerance)
    np.testing.assert_allclose(here.twist[:, 1], left, atol=tolerance)
    np.testing.assert_allclose(here.twist[:, 2], rate[:, 2] * level, atol=5 * tolerance)
    assert planar.max() > 0.1
    turned = (after.wheel_angles - before.wheel_angles) / (2 * h)
    np.testing.assert_allclose(here.wheel_speeds, turned, atol=5e-3)


@pytest.mark.parametrize("shape", PATHS)
def test_final_wheel_angles_are_the_integral_of_geometry(shape):
    """Against 4000-point Gauss-Legendre cells of the inverse kinematics, written out here."""
    path = PATHS[shape]
    robot = ROBOTS["loc8" if shape in HOLONOMIC_ONLY else "rear_cog"]
    nodes, weights = np.polynomial.legendre.leggauss(12)
    expected = np.zeros(robot.inverse.shape[0])
    for a, b in zip(path.basis.knots[:-1], path.basis.knots[1:], strict=True):
        edges = np.linspace(a, b, 1001)
        half = np.diff(edges) / 2
        u = (edges[:-1, None] + half[:, None] * (1 + nodes)).ravel()
        d, yaw, turn = path.position(u, 1), path.yaw(u), path.yaw(u, 1)
        if path.heading is None:
            length = np.linalg.norm(d, axis=1)
            motion = np.column_stack([length, 0 * u, turn * np.hypot(d[:, 0], d[:, 1]) / length])
        else:
            motion = np.column_stack(
                [
                    np.cos(yaw) * d[:, 0] + np.sin(yaw) * d[:, 1],
                    -np.sin(yaw) * d[:, 0] + np.cos(yaw) * d[:, 1],
                    turn,
                ]
            )
        rates = (motion @ robot.inverse.T).reshape(len(half), len(nodes), -1)
        expected += np.einsum("cgw,g,c->w", rates, weights, half)
    for limits in (DRIVE, [limit("speed", largest=0.3), limit("wheel_acceleration", largest=2.0)]):
        result = time_scale(path, limits, robot=robot)
        np.testing.assert_allclose(result.at(result.duration).wheel_angles[0], expected, atol=1e-9)


def test_two_fixed_wheels_close_the_form():
    """r phi = s -+ b turn on level ground."""
    path = PATHS["slalom"]
    result = time_scale(path, DRIVE, robot=ROBOTS["rear_cog"])
    t = np.linspace(0, result.duration, 50)
    state, s = result.at(t), result.along(t)[0]
    turn = state.pose[:, 2] - state.pose[0, 2]
    np.testing.assert_allclose(
        state.wheel_angles * 0.12, np.column_stack([s - 0.2 * turn, s + 0.2 * turn]), atol=1e-9
    )


def test_yaw_is_continuous_over_more_than_a_turn():
    angles = np.linspace(0, 5 * np.pi, 41)
    radius = 1 + angles / 5
    spiral = Path.through(np.column_stack([np.sin(angles) * radius, 1 - np.cos(angles) * radius]))
    result = time_scale(spiral, [limit("speed"), limit("acceleration")])
    t = np.linspace(0, result.duration, 400)
    together = result.at(t).pose[:, 2]
    alone = np.array([result.at(x).pose[0, 2] for x in t[::40]])
    assert np.abs(np.diff(together)).max() < 0.3
    np.testing.assert_allclose(together[::40], alone, atol=1e-12)
    assert together[-1] - together[0] > 4.5 * np.pi


def test_ends_are_the_path_ends_and_times_outside_are_refused():
    result = time_scale(PATHS["turning"], DRIVE, robot=ROBOTS["loc8"])
    ends = result.at([0.0, result.duration])
    np.testing.assert_allclose(ends.pose[:, :2], PATHS["turning"].points[[0, -1]], atol=1e-12)
    np.testing.assert_allclose(ends.pose[:, 2], [0.0, 0.5], atol=1e-12)
    np.testing.assert_allclose(ends.twist, 0.0, atol=1e-9)
    assert result.at(0.1).wheel_angles.shape == (1, 4)
    for t in (-1e-3, result.duration + 1e-3, float("nan")):
        with pytest.raises(ArgumentError):
            result.at(t)


def test_wheel_angles_start_where_they_are_said_to():
    start = [0.1, -0.2, 0.3, 0.4]
    shifted = time_scale(PATHS["turning"], DRIVE, robot=ROBOTS["loc8"], start_wheels=start)
    result = time_scale(PATHS["turning"], DRIVE, robot=ROBOTS["loc8"])
    times = np.linspace(0.0, result.duration, 7)
    np.testing.assert_allclose(
        shifted.at(times).wheel_angles, result.at(times).wheel_angles + start, atol=1e-12
    )
    for wrong in ([0.1], [0.1, 0.2, 0.3, np.nan]):
        with pytest.raises(ArgumentError, match="start_wheels"):
            time_scale(PATHS["turning"], DRIVE, robot=ROBOTS["loc8"], start_wheels=wrong)


def test_without_a_robot_there_are_no_wheels():
    result = time_scale(PATHS["slalom"], [limit("speed"), limit("acceleration")])
    assert result.at([0.0, 0.1]).wheel_speeds.shape == (2, 0)


def test_active_tells_what_binds_on_a_trapezoid():
    result = time_scale(
        PATHS["straight"],
        [limit("speed", largest=1.0), limit("acceleration", forward=1.0, braking=2.0)],
    )
    assert [stretch.limit for stretch in result.active] == ["acceleration", "speed", "acceleration"]
    assert result.active[0].end == pytest.approx(0.5, abs=0.02)
    assert result.active[1].end == pytest.approx(1.75, abs=0.02)
    assert len(result.binding) == len(result.sdd)


def test_speed_zone_edges_are_gridpoints_and_kept():
    zones = limit("speed_zones", zones=((0.333, 0.777, 0.4),))
    result = time_scale(
        PATHS["straight"], [limit("speed"), limit("acceleration"), zones], gridpoints=40
    )
    assert np.abs(result.s[:, None] - [0.333, 0.777]).min(axis=0).max() < 1e-9
    inside = (result.s > 0.333) & (result.s < 0.777)
    assert result.sd[inside].max() <= 0.4 + 1e-12
    assert result.slowdown < 1 + 1e-6
