"""Wheel states in time: cars, steering limits and ranges, castors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from trajopt.errors import InfeasibleError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.forces import contact_arms
from trajopt.limits.speed import Speed
from trajopt.limits.steering_acceleration import SteeringAcceleration
from trajopt.limits.steering_rate import SteeringRate
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.paths.path import Path
from trajopt.robots import robot
from trajopt.timing.scaling import time_scale
from trajopt.timing.track import track
from trajopt.timing.trajectory import Trajectory

PACE = [Speed(1.0), Acceleration(1.0, 1.0)]
WAVE = Path.through([[0, 0], [2, 1], [4, 0]])
BEND = Path.through([[0, 0], [2, 0.3], [4, -0.3], [6, 0]])
CAR = robot("car")
BASE = CAR.description.wheels[0].position[0]
SERVO = {"steering.all.rate": 2.0, "steering.all.acceleration": 8.0}


def test_a_car_drives_the_path_of_its_rear_axle() -> None:
    found = time_scale(WAVE, PACE, robot=CAR)
    state = found.at(np.linspace(0, found.duration, 200))
    u = WAVE.locate(found.along(np.linspace(0, found.duration, 200))[0])
    np.testing.assert_allclose(state.position[:, :2], WAVE.position(u)[:, :2], atol=1e-12)
    assert np.abs(state.twist[:, 1]).max() < 1e-12  # the rear axle does not slide
    kappa = state.twist[1:-1, 2] / state.twist[1:-1, 0]
    half = CAR.description.wheels[0].position[1]
    left = np.arctan(BASE * kappa / (1 - half * kappa))
    right = np.arctan(BASE * kappa / (1 + half * kappa))
    np.testing.assert_allclose(state.steering_angles[1:-1, 0], left, atol=1e-12)
    np.testing.assert_allclose(state.steering_angles[1:-1, 1], right, atol=1e-12)
    assert not state.steering_angles[:, 2:].any()


@pytest.mark.parametrize("side", [1, -1])
def test_a_bend_beyond_the_range_is_refused_with_place_and_radius(side: float) -> None:
    sharp = Path.through([[0, 0], [0.6, 0.0], [1.0, 0.5 * side]])
    with pytest.raises(InfeasibleError, match="steering 'front' must turn to") as caught:
        time_scale(sharp, PACE, robot=CAR)
    found = caught.value
    u = np.linspace(sharp.start, sharp.end, 40001)
    d, dd = sharp.position(u, 1), sharp.position(u, 2)
    kappa = (d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]) / np.hypot(d[:, 0], d[:, 1]) ** 3
    angle = np.arctan(BASE * kappa)
    k = int(np.argmax(np.abs(angle)))
    assert f"must turn to {angle[k]:.4g} rad, its range ends at {side * 0.4189:.4g}" in str(found)
    assert f"radius is {1 / abs(kappa[k]):.4g} m, {BASE / np.tan(0.4189):.4g} m" in str(found)
    first = float(sharp.parameter(u[np.argmax(np.abs(angle) > 0.4189)])[0])
    assert found.place == pytest.approx(first, abs=0.05)


def wandering(seed: int) -> Path:
    """Through a few points, bending either way."""
    rng = np.random.default_rng(seed)
    turn = np.cumsum(rng.uniform(-0.5, 0.5, 5))
    step = rng.uniform(0.6, 1.8, 5)[:, None]
    return Path.through(np.cumsum(np.column_stack([np.cos(turn), np.sin(turn)]) * step, axis=0))


def bow(side: float, sharpness: float) -> Path:
    """One segment whose curvature is greatest somewhere inside."""
    ends = {"start_direction": [5.2, 0.0], "end_direction": [0.0, side * sharpness]}
    return Path.through([[0, 0], [2.4, side * 2.4]], knots=[0, 1], **ends)


BOWS = [bow(side, sharpness) for side in (1, -1) for sharpness in (4.1, 4.7, 5.6)]


@pytest.mark.parametrize("path", [WAVE, *(wandering(seed) for seed in range(20)), *BOWS])
def test_a_range_is_judged_between_the_places_of_the_table(path: Path) -> None:
    # 1e-5 rad on either side of the greatest angle, at a knot or somewhere inside a cell
    u = np.union1d(np.linspace(path.start, path.end, 40001), path.basis.knots)
    d, dd = path.position(u, 1), path.position(u, 2)
    kappa = (d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]) / np.hypot(d[:, 0], d[:, 1]) ** 3
    most = float(np.arctan(BASE * np.abs(kappa)).max())
    track(path, robot("car", {"steering.0.range": [-most - 1e-5, most + 1e-5]})).turning  # noqa: B018
    less = robot("car", {"steering.0.range": [1e-5 - most, most - 1e-5]})
    with pytest.raises(InfeasibleError, match="its range ends at"):
        track(path, less).turning  # noqa: B018


def test_the_radius_that_would_do_holds_for_a_wheel_off_the_middle() -> None:
    # The wheel stands to the left, and at its angle 0 it is turned by 0.2 rad: 1 / kappa = y + x / tan(angle)
    left = robot(
        "tricycle",
        {
            "wheels.front.position": [0.65, 0.1],
            "wheels.front.angle": 0.2,
            "steering.0.range": [-0.7, 0.3],
        },
    )
    turn = np.linspace(0, 1.2, 40)
    for radius, bound in ((0.9, 0.5), (-0.9, -0.5)):
        points = np.column_stack([abs(radius) * np.sin(turn), radius * (1 - np.cos(turn))])
        wanted = abs(0.1 + 0.65 / np.tan(bound))
        with pytest.raises(InfeasibleError, match=f"{wanted:.4g} m would do"):
            time_scale(Path.through(points), PACE, robot=left)


def test_every_wheel_of_asoc_rolls_at_8_5_on_a_diagonal() -> None:
    asoc = robot("asoc-4")
    diagonal = Path.through([[0, 0], [3, 3]], heading=[0, 0], turning_length=0.5)
    pace = [Speed(0.6 * np.sqrt(2)), Acceleration(2.0, 2.0), WheelSpeed(12.0)]
    found = time_scale(diagonal, pace, robot=asoc)
    # as drawn, one wheel of every module rolls at 12 rad/s and its twin stands still; on the way
    # modules swivel into the diagonal
    drawn = asoc.inverse @ [0.6, 0.6, 0.0]
    np.testing.assert_allclose(drawn, [12.0, 0.0] * 4, atol=1e-12)
    assert np.all(np.sort(found.at(0.5).wheel_speeds.reshape(4, 2))[:, 0] < 8.4)
    middle = found.at(found.duration / 2)
    np.testing.assert_allclose(middle.wheel_speeds, 8.485281, atol=1e-5)
    np.testing.assert_allclose(middle.steering_angles, np.pi / 4, atol=1e-5)


def test_the_support_of_asoc_moves_with_its_castors() -> None:
    asoc = robot("asoc-4")
    diagonal = Path.through([[0, 0], [3, 3]], heading=[0, 0], turning_length=0.5)
    on = time_scale(diagonal, PACE, robot=asoc).track
    ends = np.array([0.0, diagonal.length])
    arms = contact_arms(on.samples(ends, diagonal.locate(ends)), asoc)
    wheels = asoc.description.wheels
    pivots = np.array([w.position for w in wheels])
    np.testing.assert_allclose(arms[0], [w.contact for w in wheels], atol=1e-12)
    back, left = np.array([1.0, 1.0]) / np.sqrt(2), np.array([-1.0, 1.0]) / np.sqrt(2)
    sides = np.array([w.lateral for w in wheels])[:, None]
    np.testing.assert_allclose(arms[1], pivots - 0.1 * back + sides * left, atol=1e-9)


def front_angles(found: Trajectory, time: np.ndarray) -> list[np.ndarray]:
    """Steering angles of a car's front wheels, from its twist: towards the middle of its turn."""
    twist, half = found.at(time).twist, CAR.description.wheels[0].position[1]
    return [np.arctan(BASE * twist[:, 2] / (twist[:, 0] - y * twist[:, 2])) for y in (half, -half)]


def test_a_steering_rate_that_binds_makes_a_car_slower_and_says_so() -> None:
    free = time_scale(BEND, PACE, robot=CAR)
    rate = time_scale(BEND, [*PACE, SteeringRate(0.04)], robot=CAR)
    bent = time_scale(BEND, [*PACE, SteeringAcceleration(0.03)], robot=CAR)
    assert rate.duration > free.duration * 1.02
    assert bent.duration > free.duration * 1.02
    for found, name in ((rate, "steering_rate"), (bent, "steering_acceleration")):
        assert name in {stretch.limit for stretch in found.active}
        assert found.margins()[name] >= -1e-9
    mirrored = Path.through(BEND.points * [1.0, -1.0])
    same = time_scale(mirrored, [*PACE, SteeringAcceleration(0.03)], robot=CAR)
    assert same.duration == pytest.approx(bent.duration, rel=1e-9)
    along = time_scale(BEND, [*PACE, SteeringAcceleration(0.03)], robot=CAR)
    time = np.linspace(0, along.duration, 3001)[1:-1]
    inner, outer = front_angles(along, time)
    push = np.hstack([np.gradient(np.gradient(a, time), time)[:, None] for a in (inner, outer)])
    knots = along.times[np.searchsorted(along.u, BEND.basis.knots)]
    far = np.abs(time[:, None] - knots).min(axis=1) > 0.02
    assert push[far].max() == pytest.approx(0.03, rel=5e-3)
    assert push[far].min() == pytest.approx(-0.03, rel=5e-3)
    time = np.linspace(0, rate.duration, 3001)[1:-1]
    paces = [np.abs(np.gradient(angle, time)) for angle in front_angles(rate, time)]
    assert np.max(paces) == pytest.approx(0.04, rel=2e-3)


def test_the_inner_wheel_of_a_car_keeps_the_steering_rate() -> None:
    """Deep in a bend it turns faster than the angle in the middle."""
    found = time_scale(WAVE, [*PACE, SteeringRate(0.04)], robot=CAR)
    time = np.linspace(0, found.duration, 6001)[1:-1]
    paces = np.abs([np.gradient(angle, time) for angle in front_angles(found, time)])
    twist = found.at(time).twist
    middle = np.abs(np.gradient(np.arctan(BASE * twist[:, 2] / twist[:, 0]), time))
    assert paces.max() == pytest.approx(0.04, rel=2e-3)
    assert (paces.max(axis=0) - middle).max() > 5e-4


def test_steering_takes_the_corners_of_curvature_within_a_milliradian() -> None:
    largest = 0.5
    pace = [Speed(3.0), Acceleration(2.0, 2.0)]
    found = time_scale(BEND, [*pace, SteeringAcceleration(largest)], robot=CAR)
    knots = np.searchsorted(found.u, BEND.basis.knots[1:-1])
    times, h = found.times[knots], 1e-6
    middle = []
    for sign in (-1, 1):  # rate of the angle in the middle, on either side of the knots
        ends = [found.at(times + sign * x).twist for x in (h, 2 * h)]
        near, far = (np.arctan(BASE * twist[:, 2] / twist[:, 0]) for twist in ends)
        middle.append(sign * (far - near) / h)
    jump = np.abs(middle[1] - middle[0])
    # a ramp of rate, evenly before and after the knot
    ramp = jump / largest
    deviation = [quad(lambda t, r=r: largest * (t + r / 2), -r / 2, 0)[0] for r in ramp]
    assert max(deviation) == pytest.approx(1e-3, rel=5e-3)
    assert "steering_acceleration" in {stretch.limit for stretch in found.active}
    each = time_scale(BEND, [*pace, SteeringAcceleration((largest,))], robot=CAR)
    assert each.duration == pytest.approx(found.duration, rel=1e-12)


def test_rates_in_time_are_derivatives_of_angles() -> None:
    path = Path.through([[0, 0], [1, 0.4], [2, 0]], heading=[0, 1.2, 0.3], turning_length=0.35)
    swerve = robot("swerve", SERVO)
    servo = [*PACE, SteeringRate(0.3), SteeringAcceleration(2.0)]
    for one, along, limits, given in (
        (swerve, path, PACE, {w.name: 1.0 for w in swerve.description.wheels}),
        (CAR, BEND, servo, {"front-left": 0.2}),
    ):
        found = time_scale(along, limits, robot=one, start_steering=given)
        assert found.waits[0] > 0
        times, h = np.linspace(0.05, found.duration - 0.05, 41), 1e-5
        here, before, after = (found.at(times + k * h) for k in (0, -1, 1))
        for value, rate in (("spin_angles", "spin_rates"), ("steering_angles", "steering_rates")):
            slope = (getattr(after, value) - getattr(before, value)) / (2 * h)
            np.testing.assert_allclose(getattr(here, rate), slope, atol=2e-4)
