"""Slip of roller wheels against statics by hand and against the motion of a body in the plane."""

from __future__ import annotations

import numpy as np
import pytest

from trajopt.limits.slip import Slip
from trajopt.paths.path import Path
from trajopt.paths.samples import sample_path
from trajopt.robots.robot import STANDARD_GRAVITY, Robot
from trajopt.robots.robot import robot as shipped

G, MU = STANDARD_GRAVITY, 0.4
TURNING = Path.through(
    [[0, 0], [1, 0.4], [2, -0.2], [3, 0.5]], heading=[0.2, 1.0, 0.1, -0.7], turning_length=0.5
)


@pytest.mark.parametrize(
    ("heading", "arm"), [(0.0, 0.376), (-np.pi / 2, 0.316)], ids=["ahead", "sideways"]
)
def test_pushing_and_braking_slip_at_the_same_force(heading: float, arm: float) -> None:
    """From rest on level ground, a roller robot slips alike ahead, back, left and right.

    Every roller passes m |a| / (4 cos 45), and the pair that loses load keeps m (g - h |a| / arm) /
    4: so |a| = mu g / (sqrt(2) + mu h / arm).
    """
    robot = shipped("loc8")
    straight = Path.through([[0, 0], [2, 0]], heading=[heading, heading], turning_length=0.5)
    rows = Slip(MU, rule="least_norm").rows(sample_path(straight, np.array([1.0])), robot)
    pushing, slowing = rows.a > 1e-9, rows.a < -1e-9
    expected = MU * G / (np.sqrt(2) + MU * robot.body.cog[2] / arm)
    assert np.min(rows.c[pushing] / rows.a[pushing]) == pytest.approx(expected, rel=1e-9)
    assert np.max(rows.c[slowing] / rows.a[slowing]) == pytest.approx(-expected, rel=1e-9)


def driven(path: Path, robot: Robot, s0: float, u: float, x: float) -> tuple[np.ndarray, float]:
    """Acceleration (2,) of the body's origin, in its own axes, and yaw acceleration: central
    differences of the poses of the motion with s'^2 = x and s'' = u at s0."""
    assert robot.body.cog[:2] == (0.0, 0.0)
    h = 2e-3
    t = h * np.arange(-2, 3)
    samples = sample_path(path, s0 + np.sqrt(x) * t + u * t**2 / 2)
    poses = np.column_stack([samples.position[:, :2], samples.yaw])
    second = np.array([-1, 16, -30, 16, -1]) @ poses / (12 * h**2)
    cos, sin = np.cos(poses[2, 2]), np.sin(poses[2, 2])
    return np.array([[cos, sin], [-sin, cos]]) @ second[:2], float(second[2])


@pytest.mark.parametrize(
    ("s0", "u", "x"), [(0.8, 0.7, 0.4), (1.9, -0.5, 1.1), (1.3, 0.0, 1.5), (2.7, -0.9, 0.6)]
)
def test_roller_forces_move_the_body_as_it_moves(s0: float, u: float, x: float) -> None:
    """The least forces along the rollers that give the motion its force *and* its yaw moment,
    against the loads of four springs of the same stiffness under a rigid body."""
    robot = shipped("loc8")
    body = robot.body
    (ax, ay), turning = driven(TURNING, robot, s0, u, x)
    axes = np.array([[np.cos(g), np.sin(g)] for g in body.roller_axis])
    arms, h = np.array(body.contacts), body.cog[2]
    moments = arms[:, 0] * axes[:, 1] - arms[:, 1] * axes[:, 0]
    force = np.linalg.lstsq(
        np.vstack([axes.T, moments]), [ax, ay, turning * body.yaw_inertia / body.mass]
    )[0]
    loads = G / 4 - h * ax * arms[:, 0] / np.sum(arms[:, 0] ** 2)
    loads -= h * ay * arms[:, 1] / np.sum(arms[:, 1] ** 2)
    rows = Slip(MU, rule="least_norm").rows(sample_path(TURNING, np.array([s0])), robot)
    used = (rows.a * u + rows.b * x - rows.c)[0]
    expected = np.concatenate([force - MU * loads, -force - MU * loads])
    np.testing.assert_allclose(np.sort(used), np.sort(expected), atol=1e-6)
    # a state in which the yaw moment of a changing yaw rate is not lost in the tolerance
    rate = sample_path(TURNING, np.array([s0])).twist_rate[0, 2]
    assert abs(rate) * x * body.yaw_inertia / body.mass > 0.01
