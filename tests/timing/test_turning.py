"""Wheel states in time: steering limits, ranges, and wheels that turn while the robot rests."""

from __future__ import annotations

from dataclasses import replace

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
from trajopt.report.motion import trajectory_table
from trajopt.robots import robot
from trajopt.timing.rests import Rest
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory

PACE = [Speed(1.0), Acceleration(1.0, 1.0)]
TURNING = [*PACE, WheelSpeed(40.0)]
WAVE = Path.through([[0, 0], [2, 1], [4, 0]])
BEND = Path.through([[0, 0], [2, 0.3], [4, -0.3], [6, 0]])
CAR = robot("car")
BASE = CAR.description.wheels[0].position[0]
SERVO = {"steering.all.rate": 2.0, "steering.all.acceleration": 8.0}
# A swerve whose front left wheel stands under its origin. On PIVOT it drives east, turns about that
# wheel without moving it, and drives on north.
PIVOTING = robot("swerve", {"wheels.front-left.position": [0.0, 0.0]})
PIVOT = Path.through(
    [[0, 0], [1, 0], [1, 0], [1, 1]],
    heading=[0, 0.2, 0.9, 1.1],
    knots=[0, 1, 2, 3],
    start_direction=[3, 0],
    end_direction=[0, 3],
    turning_length=0.35,
)
QUARTER = np.pi / 2 - 0.7  # rad: from east to north, while the body turned by 0.7


def rest_to_rest(turn: float, rate: float, acceleration: float) -> float:
    """s, by integrating the trapezoid or triangle of speed."""
    if turn >= rate**2 / acceleration:
        return turn / rate + rate / acceleration
    return float(2 * np.sqrt(turn / acceleration))


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


@pytest.mark.parametrize("path", [WAVE, Path.through([[0, 0], [2, 1], [4.1, 0.2], [5.2, 0.9]])])
def test_a_range_is_judged_between_the_places_of_the_table(path: Path) -> None:
    # 1e-5 rad on either side of the greatest angle, which lies somewhere inside a cell
    u = np.linspace(path.start, path.end, 400001)
    d, dd = path.position(u, 1), path.position(u, 2)
    kappa = (d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]) / np.hypot(d[:, 0], d[:, 1]) ** 3
    most = float(np.arctan(BASE * np.abs(kappa)).max())
    for end in (most + 1e-5, most - 1e-5):
        one = robot("car", {"steering.0.range": [-end, end]})
        if end > most:
            time_scale(path, PACE, robot=one)
            continue
        with pytest.raises(InfeasibleError, match="its range ends at"):
            time_scale(path, PACE, robot=one)


def test_the_radius_that_would_do_holds_for_a_wheel_off_the_middle() -> None:
    # The tricycle's wheel moved to the left: 1 / kappa = y + x / tan(angle)
    left = robot(
        "tricycle", {"wheels.front.position": [0.65, 0.1], "steering.0.range": [-0.5, 0.5]}
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


def test_a_steering_rate_that_binds_makes_a_car_slower_and_says_so() -> None:
    free = time_scale(BEND, PACE, robot=CAR)
    rate = time_scale(BEND, [*PACE, SteeringRate(0.04)], robot=CAR)
    bent = time_scale(BEND, [*PACE, SteeringAcceleration(0.03)], robot=CAR)
    assert rate.duration > free.duration * 1.02
    assert bent.duration > free.duration * 1.02
    for found, name in ((rate, "steering_rate"), (bent, "steering_acceleration")):
        assert name in {stretch.limit for stretch in found.active}
        assert found.margins()[name] >= -1e-9
    time = np.linspace(0, rate.duration, 3001)[1:-1]
    # the group's angle is that of a wheel in the middle
    middle = np.arctan(BASE * rate.at(time).twist[:, 2] / rate.at(time).twist[:, 0])
    pace = np.gradient(middle, time)
    assert np.abs(pace).max() == pytest.approx(0.04, rel=2e-3)


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


@pytest.mark.parametrize(("rate", "acceleration"), [(2.0, 8.0), (10.0, 3.0), (1.0, np.inf)])
def test_a_wheel_turns_at_a_stop_in_the_rest_to_rest_time(rate: float, acceleration: float) -> None:
    keys = {"steering.all.rate": rate}
    if np.isfinite(acceleration):
        keys["steering.all.acceleration"] = acceleration
    one = PIVOTING.replace(keys)
    with pytest.raises(InfeasibleError, match="wheel 'front-left' stands still here") as caught:
        time_scale(PIVOT, TURNING, robot=one)
    place = caught.value.place
    assert place == pytest.approx(PIVOT.knot_parameters[2], abs=1e-8)
    assert f"must turn by {np.degrees(QUARTER):.3g} deg" in str(caught.value)
    assert f"stops = [{place!r}]" in str(caught.value)
    found = time_scale(PIVOT, TURNING, robot=one, stops=[place])
    (rest,) = found.rests
    wanted = QUARTER / rate if np.isinf(acceleration) else rest_to_rest(QUARTER, rate, acceleration)
    assert rest.duration == pytest.approx(wanted, rel=1e-9)
    np.testing.assert_allclose(rest.wheels, [QUARTER, 0, 0, 0], atol=1e-8)
    moving = np.sum(2 * np.diff(found.s) / (found.sd[1:] + found.sd[:-1]))
    assert found.duration == pytest.approx(moving + wanted, rel=1e-12)
    i = int(np.argmax(found.waits))
    assert found.s[i] == pytest.approx(place)
    leave, come = found.times[i], found.times[i] - wanted
    inside = np.linspace(come, leave, 101)
    s, speed, push = found.along(inside)
    assert np.ptp(s) == 0
    assert not speed.any()
    assert not push[:-1].any()
    state = found.at(inside)
    np.testing.assert_allclose(state.pose, np.tile(state.pose[0], (101, 1)), atol=1e-9)
    assert not state.spin_rates.any()
    angle, pace = state.steering_angles[:, 0], state.steering_rates[:, 0]
    assert angle[0] == pytest.approx(-0.2 - 0.7 + 0.7, abs=1e-8)
    assert angle[-1] - angle[0] == pytest.approx(QUARTER, abs=1e-8)
    assert pace.max() <= rate * (1 + 1e-12)
    assert pace.min() >= 0
    assert np.abs(np.diff(pace)[1:-1]).max() <= acceleration * (inside[1] - inside[0]) * (1 + 1e-9)
    np.testing.assert_allclose(
        state.steering_angles[:, 1:], state.steering_angles[:1, 1:].repeat(101, 0)
    )


def test_what_a_turn_has_ahead_is_the_integral_of_its_rate() -> None:
    rest = Rest(
        0.0,
        0.0,
        np.array([0.3, -0.6, 0.0, 0.0]),
        np.array([0.25, -0.6, 0.0]),
        np.array([0.5, 2.0, 1.0]),
        np.array([4.0, 3.0, np.inf]),
        (0, 1, 2, -1),
    )
    times = [rest_to_rest(0.25, 0.5, 4.0), rest_to_rest(0.6, 2.0, 3.0), 0.0]
    np.testing.assert_allclose(rest.times, times, rtol=1e-12)
    assert rest.duration == max(times)
    for t in (-0.1, 0.0, 0.05, 0.2, 0.35, 0.5, 0.7, 2.0):
        ahead, _ = rest.ahead(np.array([t]))
        for k in range(4):
            left = quad(
                lambda x, k=k: rest.ahead(np.array([x]))[1][0, k],
                max(t, 0.0),
                2.5,
                limit=400,
                points=[*times, *(x / 2 for x in times)],
            )[0]
            assert ahead[0, k] == pytest.approx(left, abs=1e-7)
    peak = rest.ahead(np.array(times[:2]) / 2)[1]
    assert peak[0, 0] == pytest.approx(0.5 * 0.3 / 0.25)
    assert peak[1, 1] == pytest.approx(-np.sqrt(0.6 * 3.0))


def test_a_turn_at_rest_needs_a_known_rate() -> None:
    place = float(PIVOT.knot_parameters[2])
    with pytest.raises(InfeasibleError, match=r"steering\.front-left\.rate") as caught:
        time_scale(PIVOT, TURNING, robot=PIVOTING, stops=[place])
    assert caught.value.place == pytest.approx(place)
    only = PIVOTING.replace({"steering.front-left.acceleration": 2.0})
    found = time_scale(PIVOT, TURNING, robot=only, stops=[place])
    assert found.rests[0].duration == pytest.approx(2 * np.sqrt(QUARTER / 2.0))
    limits = [*TURNING, SteeringRate((0.5, 9.0, 9.0, 9.0)), SteeringAcceleration(1.0)]
    slow = time_scale(PIVOT, limits, robot=PIVOTING, stops=[place])
    assert slow.rests[0].duration == pytest.approx(rest_to_rest(QUARTER, 0.5, 1.0))


def test_wheels_that_stand_otherwise_turn_before_the_start() -> None:
    straight = Path.through([[0, 0], [0, 2]], heading=[0, 0], turning_length=0.35)
    one = robot("swerve", SERVO)
    names = [w.name for w in one.description.wheels]
    free = time_scale(straight, PACE, robot=one)
    assert free.rests == ()
    assert not free.waits.any()
    given = dict(zip(names, (np.pi / 2, 0.2, -0.4, 3.0), strict=True))
    found = time_scale(straight, PACE, robot=one, start_steering=given)
    # to the nearest angle that the path begins with, half a turn more or less
    turn = np.array([0.0, np.pi / 2 - 0.2, 0.4 - np.pi / 2, np.pi / 2 - 3.0])
    wait = max(rest_to_rest(abs(t), 2.0, 8.0) for t in turn[1:])
    np.testing.assert_allclose(found.rests[0].wheels, turn, atol=1e-9)
    assert found.duration == pytest.approx(free.duration + wait, rel=1e-9)
    assert found.times[0] == pytest.approx(wait)
    state = found.at([0.0, wait / 2, wait, found.duration])
    np.testing.assert_allclose(state.steering_angles[0], list(given.values()), atol=1e-9)
    np.testing.assert_allclose(state.steering_angles[2], np.array(list(given.values())) + turn)
    assert not state.twist[:3].any()
    assert state.steering_rates[1, 1] > 0 > state.steering_rates[1, 2]
    forth = np.sign(found.at(found.duration / 2).spin_rates[0])
    np.testing.assert_array_equal(forth, [1, 1, -1, 1])
    table = trajectory_table(found)
    waiting = np.asarray(table["t_s"]) < wait
    assert not np.asarray(table["s_dot_m_s"])[waiting].any()
    for name in ("front_right", "rear_left"):
        assert np.ptp(np.asarray(table[f"wheel_{name}_steering_rad"])[waiting]) > 1.0
        assert np.abs(table[f"wheel_{name}_steering_rate_rad_s"]).max() == pytest.approx(
            2.0, rel=0.05
        )
        assert f"wheel_{name}_angle_rad" in table
        assert f"wheel_{name}_speed_rad_s" in table


def test_a_start_that_moves_cannot_turn_wheels_first() -> None:
    given = {"front-left": 0.2}
    slow = [*PACE, SteeringRate(0.5)]
    found = time_scale(BEND, slow, robot=CAR, start_steering=given)
    right = np.arctan(BASE / (BASE / np.tan(0.2) + 2 * CAR.description.wheels[0].position[1]))
    np.testing.assert_allclose(found.rests[0].wheels, [-0.2, -right, 0, 0], atol=1e-9)
    middle = np.arctan(BASE / (BASE / np.tan(0.2) + CAR.description.wheels[0].position[1]))
    assert found.rests[0].duration == pytest.approx(middle / 0.5)
    for more in ({"start_speed": 0.3}, {"engine": "linear"}):
        with pytest.raises(
            InfeasibleError, match=r"starts at 0\.2 rad, the path begins with it at"
        ):
            time_scale(BEND, slow, robot=CAR, start_steering=given, **more)
    with pytest.raises(InfeasibleError, match=r"give steering\.front\.rate"):
        time_scale(BEND, PACE, robot=CAR, start_steering=given)


def test_at_a_stop_a_wheel_turns_back_into_its_range() -> None:
    # The heading turns by 2.8 rad, back against the path: past the range, unless wheels turn about.
    keys = {**SERVO, "steering.all.range": [-1.9, 1.9]}
    one = robot("swerve", keys)
    path = Path.through([[0, 0], [4, 0], [8, 0]], heading=[0.0, -1.4, -2.8], turning_length=0.35)
    with pytest.raises(InfeasibleError, match=r"its range ends at 1\.9 rad"):
        time_scale(path, PACE, robot=one)
    place = float(path.knot_parameters[1])
    found = time_scale(path, PACE, robot=one, stops=[place])
    assert {round(abs(turn), 6) for turn in found.rests[0].groups} == {round(np.pi, 6)}
    state = found.at(np.linspace(0, found.duration, 500))
    assert np.abs(state.steering_angles).max() <= 1.9
    assert found.rests[0].duration == pytest.approx(rest_to_rest(np.pi, 2.0, 8.0))


def test_a_stop_where_nothing_needs_to_turn_costs_no_wait() -> None:
    found = time_scale(BEND, PACE, robot=CAR, stops=[2.0])
    assert found.rests == ()
    assert found.at(found.times).pose.shape == (len(found.times), 3)


def test_a_wheel_that_comes_to_rest_and_turns_back_is_timed() -> None:
    # The front left wheel's pivot has a cusp where it stands still for an instant.
    path = Path.through([[0, 0], [0.5, 0.2], [1, 0]], heading=[0, 0.5, 0], turning_length=0.35)
    u = [float(path.basis.knots[1]) * 0.6]
    yaw, turn, (vx, vy, _) = path.yaw(u)[0], path.yaw(u, 1)[0], path.position(u, 1)[0]
    ahead, left = vx * np.cos(yaw) + vy * np.sin(yaw), vy * np.cos(yaw) - vx * np.sin(yaw)
    one = robot("swerve", {"wheels.front-left.position": [-left / turn, ahead / turn], **SERVO})
    limits = [*TURNING, SteeringRate(), SteeringAcceleration()]
    found = time_scale(path, limits, robot=one)
    assert min(found.margins().values()) >= -1e-9
    state = found.at(np.linspace(0, found.duration, 4001))
    assert np.abs(np.diff(state.steering_angles, axis=0)).max() < 2.0 * found.duration / 4000 * 1.01
    assert state.spin_rates[1000, 0] * state.spin_rates[-1000, 0] < 0
    assert found.rests == ()
    stopped = time_scale(path, limits, robot=one, stops=[float(path.parameter(u)[0])])
    assert stopped.rests == ()  # the wheel is right for what comes


def test_a_trajectory_read_back_rests_again() -> None:
    place = float(PIVOT.knot_parameters[2])
    found = time_scale(PIVOT, TURNING, robot=PIVOTING.replace(SERVO), stops=[place])
    again: Trajectory = replace(found, engine="stored")
    assert again.duration == found.duration
    np.testing.assert_array_equal(again.waits, found.waits)
