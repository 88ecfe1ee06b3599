"""Straight lines, arcs and clothoids against closed forms, and what is driven along them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.special import fresnel

from trajopt import (
    Acceleration,
    Arc,
    ArgumentError,
    Clothoid,
    InfeasibleError,
    Path,
    Speed,
    Straight,
    WheelAcceleration,
    WheelSpeed,
    YawRate,
    robot,
    time_scale,
)
from trajopt.limits.steering_rate import SteeringRate

START = (500_000.25, 5_400_000.5, 0.7)  # UTM
SPEEDS = [Speed(1.0), Acceleration(0.8, 0.8)]
LENGTH = 0.3302  # m, wheelbase of the car


def through(*segments, start=(0.0, 0.0, 0.0)):
    return Path.segments(list(segments), start=start)


@pytest.mark.parametrize("angle", [0.3, -2.0, 9.0])
def test_an_arc_is_a_circle(angle):
    path = through(Arc(1.7, angle), start=START)
    s = np.linspace(0.0, path.length, 41)
    assert path.length == pytest.approx(1.7 * abs(angle), rel=1e-15)
    np.testing.assert_allclose(path.locate(s), s)
    side = np.sign(angle)
    turned = 0.7 + side * s / 1.7
    centre = np.array([-np.sin(0.7), np.cos(0.7)]) * side * 1.7
    circle = centre + side * 1.7 * np.column_stack([np.sin(turned), -np.cos(turned)])
    places = path.position(s)[:, :2] - START[:2]
    np.testing.assert_allclose(places, circle, atol=2e-9)  # what doubles hold so far out
    np.testing.assert_allclose(path.yaw(s), turned, atol=1e-12)
    at_home = through(Arc(1.7, angle), start=(0.0, 0.0, 0.7)).position(s)[:, :2]
    np.testing.assert_allclose(at_home, circle, atol=1e-14)


def test_a_clothoid_is_fresnels():
    path = through(Clothoid(6.0, 0.0, 2.4))
    s = np.linspace(0.0, 6.0, 31)
    sine, cosine = fresnel(s * np.sqrt(0.4 / np.pi))
    expected = np.column_stack([cosine, sine]) * np.sqrt(np.pi / 0.4)
    np.testing.assert_allclose(path.position(s)[:, :2], expected, atol=1e-14)


def test_a_clothoid_between_two_curvatures_by_quadrature():
    path = through(Straight(0.5), Clothoid(2.0, -1.5, 0.8))
    s = np.array([0.3, 1.1, 2.0])

    def phase(v):
        return -1.5 * v + 2.3 / 4 * v**2

    for t, place in zip(s, path.position(0.5 + s), strict=True):
        x = quad(lambda v: np.cos(phase(v)), 0.0, t, epsabs=1e-14)[0]
        y = quad(lambda v: np.sin(phase(v)), 0.0, t, epsabs=1e-14)[0]
        np.testing.assert_allclose(place[:2], [0.5 + x, y], atol=1e-13)
    np.testing.assert_allclose(path.yaw(0.5 + s), phase(s), atol=1e-13)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5])
def test_derivatives_by_finite_differences(order):
    path, h = through(Clothoid(2.0, -0.5, 1.3), Arc(0.8, 1.0)), 1e-5
    u = np.array([0.31, 0.97, 1.6, 2.33])
    before, after = (path.position(u + k * h, order - 1) for k in (-1, 1))
    np.testing.assert_allclose(path.position(u, order), (after - before) / (2 * h), atol=1e-8)


def test_curvature_is_that_of_the_segment_to_the_right():
    path = through(Straight(1.0), Arc(2.0, -0.4), Arc(2.0, -0.4), Clothoid(1.0, -0.5, 0.0))
    np.testing.assert_allclose(path.jumps, [1.0])
    u = np.array([0.99, np.nextafter(1.0, 0.0), 1.0, 1.8, 2.6, 3.1])
    np.testing.assert_allclose(path.yaw(u, 1), [0.0, 0.0, -0.5, -0.5, -0.5, -0.25], atol=1e-12)


def test_length_of_what_points_sweep_is_never_short():
    path = through(Clothoid(2.0, -0.5, 1.3), Arc(0.8, 1.0), Straight(0.5))
    u = np.union1d(np.linspace(0.0, path.length, 60), path.basis.knots)
    bound = path.swept(u[:-1], u[1:], 0.4)
    for left, right, most in zip(u[:-1], u[1:], bound, strict=True):
        fine = np.linspace(left, right, 20)
        turned = np.abs(np.diff(path.yaw(fine))).sum()
        assert right - left + 0.4 * turned <= most * (1 + 1e-9)


@pytest.mark.parametrize(
    ("segments", "start", "words"),
    [
        ([], (0, 0, 0), "segments"),
        ([1.0], (0, 0, 0), r"segments\[0\]"),
        ([Straight(1.0)], (0, 0), "start"),
        ([Straight(1.0)], (0, np.nan, 0), "start"),
        ([Arc(1.0, 1e9)], (0, 0, 0), "turn by at most"),
        ([Straight(2e7)], (0, 0, 0), "coordinates"),
    ],
)
def test_refuses(segments, start, words):
    with pytest.raises(ArgumentError, match=words):
        Path.segments(segments, start=start)


@pytest.mark.parametrize(
    "made", [lambda: Straight(0.0), lambda: Arc(-1.0, 1.0), lambda: Arc(1.0, 0.0),
             lambda: Clothoid(1.0, np.inf, 0.0), lambda: Clothoid("1", 0.0, 0.0)],
)  # fmt: skip
def test_refuses_segments(made):
    with pytest.raises(ArgumentError):
        made()


def test_time_on_a_circle_is_the_closed_form():
    path = through(Arc(0.5, 3 * np.pi))
    limits = [Speed(2.0), Acceleration(1.0, 0.5), YawRate(1.6)]
    trajectory = time_scale(path, limits)
    speed = 0.8  # yaw rate times radius
    distance, ramps = path.length, speed**2 / 2 * (1 / 1.0 + 1 / 0.5)
    expected = (distance - ramps) / speed + speed * (1 / 1.0 + 1 / 0.5)
    assert trajectory.duration == pytest.approx(expected, rel=1e-5)
    assert trajectory.gap < 1e-3


def test_a_jump_of_curvature_is_refused_only_where_it_breaks_a_limit():
    path, powerbot = through(Straight(2.0), Arc(1.0, -1.0)), robot("powerbot")
    speeds = [*SPEEDS, WheelSpeed(9.0)]
    driven = time_scale(path, speeds, robot=powerbot)
    assert driven.sd[np.searchsorted(driven.u, 2.0)] > 0.5
    bound = [*speeds, WheelAcceleration(20.0)]
    with pytest.raises(InfeasibleError, match=r"from 0 to -1 1/m.*'wheel_acceleration'.*stops = "):
        time_scale(path, bound, robot=powerbot)
    stopped = time_scale(path, bound, robot=powerbot, stops=[2.0])
    assert stopped.sd[np.searchsorted(stopped.u, 2.0)] == 0.0
    assert min(stopped.margins().values()) > -1e-9
    with pytest.raises(InfeasibleError, match=r"steering angles.*clothoid"):
        time_scale(path, speeds, robot=robot("car"))
    smooth = through(Straight(1.5), Clothoid(0.5, 0.0, -1.0), Arc(1.0, -1.0))
    assert time_scale(smooth, bound, robot=powerbot).gap < 1e-3


@pytest.mark.parametrize("backward", [False, True])
def test_steering_follows_the_curvature(backward):
    """atan(wheelbase times curvature), of opposite sign where the car reverses; its rate binds."""
    path, car = through(Clothoid(3.0, -0.2, 1.2)), robot("car")
    driven = path.backward() if backward else path
    trajectory = time_scale(driven, [Speed(3.0), SteeringRate(0.3)], robot=car)
    t = np.linspace(0.1, trajectory.duration - 0.1, 50)
    state, (s, speed, _) = trajectory.at(t), trajectory.along(t)
    sign = -1.0 if backward else 1.0
    curvature = -0.2 + 1.4 / 3 * s
    x, y = np.array([LENGTH, LENGTH]), np.array([0.114, -0.114])
    across = sign * curvature[:, None]
    expected = np.arctan(x * across / (1 - y * across))
    np.testing.assert_allclose(state.steering_angles[:, :2], expected, atol=1e-9)
    ahead = sign * np.ones(len(s))
    np.testing.assert_allclose(state.twist, np.column_stack(
        [ahead * speed, 0 * s, curvature * speed]), atol=1e-9)  # fmt: skip
    np.testing.assert_allclose(state.spin_rates[:, 2], (ahead - 0.114 * curvature) * speed / 0.05,
                               atol=1e-7)  # fmt: skip
    slopes = np.abs((x * 1.4 / 3) / ((1 - y * across) ** 2 + (x * across) ** 2)).max(axis=1)
    middle = np.abs(t / trajectory.duration - 0.5) < 0.3
    np.testing.assert_allclose((slopes * speed)[middle], 0.3, rtol=2e-3)


def test_castors_swing_round_when_the_robot_reverses():
    """Against an integration of the rolling constraint in time by SciPy."""
    powerbot = robot("powerbot")
    ahead = through(Clothoid(1.0, 0.0, 0.8))
    x, y, _ = ahead.position([1.0])[0]
    back = through(Arc(2.0, 0.5), start=(x, y, ahead.yaw([1.0])[0] + np.pi)).backward()
    trajectory = time_scale(Path.join([ahead, back]), SPEEDS, robot=powerbot)
    wheels = {w.name: (k, w) for k, w in enumerate(powerbot.description.wheels)}
    k, castor = next(v for v in wheels.values() if v[1].kind == "castor")
    px, py = castor.position
    start = trajectory.at(0.0).steering_angles[0, k]

    def rate(t, angle):
        vx, _, w = trajectory.at(min(max(t, 0.0), trajectory.duration)).twist[0]
        direction = angle[0] + castor.angle
        across = -np.sin(direction) * (vx - w * py) + np.cos(direction) * (w * px)
        return [across / castor.trail - w]

    ends = (0.0, trajectory.duration)
    found = solve_ivp(rate, ends, [start], rtol=1e-6, atol=1e-7, max_step=0.2).y[0, -1]
    last = trajectory.at(trajectory.duration).steering_angles[0, k]
    assert last == pytest.approx(found, abs=1e-4)
    assert abs(last) > 2.5
