"""Steered wheels that turn while the robot rests: at the start, and at stops."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from trajopt.control.encounter import course
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.speed import Speed
from trajopt.limits.steering_acceleration import SteeringAcceleration
from trajopt.limits.steering_rate import SteeringRate
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.paths.path import Path
from trajopt.refine.jerk import limit_jerk
from trajopt.report.motion import binding_at, binding_shares, most, trajectory_table
from trajopt.robots import robot
from trajopt.timing.rests import Rest
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory

PACE = [Speed(1.0), Acceleration(1.0, 1.0)]
TURNING = [*PACE, WheelSpeed(40.0)]
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
    with pytest.raises(InfeasibleError, match="wheel 'front-left' stands still here"):
        time_scale(PIVOT, TURNING, robot=one, stops=[0.3])  # a stop elsewhere does not help
    found = time_scale(PIVOT, TURNING, robot=one, stops=[place])
    (rest,) = found.rests
    wanted = QUARTER / rate if np.isinf(acceleration) else rest_to_rest(QUARTER, rate, acceleration)
    assert rest.duration == pytest.approx(wanted, rel=1e-9)
    np.testing.assert_allclose(rest.wheels, [QUARTER, 0, 0, 0], atol=1e-8)
    assert found.waits.sum() == pytest.approx(wanted, rel=1e-12)
    # s'' varies a little inside a cell, so the mean of speeds tells its time only nearly.
    moving = np.sum(2 * np.diff(found.s) / (found.sd[1:] + found.sd[:-1]))
    assert found.duration == pytest.approx(moving + wanted, rel=1e-5)
    i = int(np.argmax(found.waits))
    assert found.s[i] == pytest.approx(place)
    leave, come = found.times[i], found.times[i] - wanted
    inside = np.linspace(come + 1e-12, leave, 101)  # the sum of times rounds
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
    given = dict(zip(names, (np.pi / 2, 0.2, -0.4, 20.0), strict=True))
    found = time_scale(straight, PACE, robot=one, start_steering=given)
    # to the nearest angle that the path begins with, half a turn more or less
    turn = np.array([0.0, np.pi / 2 - 0.2, 0.4 - np.pi / 2, 6.5 * np.pi - 20.0])
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


def test_what_cannot_rest_on_the_way_refuses_a_plan_that_does() -> None:
    place = float(PIVOT.knot_parameters[2])
    one = PIVOTING.replace(SERVO)
    found = time_scale(PIVOT, TURNING, robot=one, stops=[place])
    with pytest.raises(ArgumentError, match="need not turn at rest"):
        limit_jerk(found, 5.0)
    with pytest.raises(ArgumentError, match="need not turn at rest"):
        course(found, one)
    rests = [about for about in most(found) if about[1] == f"{found.rests[0].duration:.3f} s"]
    assert [round(about[2], 9) for about in rests] == [round(place, 9)]
    i = int(np.argmax(found.waits))
    inside = found.times[i] - found.waits[i] * np.array([0.9, 0.1])
    assert binding_at(found, inside) == ["", ""]
    assert binding_at(found, np.array([0.1])) == ["acceleration"]
    assert sum(binding_shares(found).values()) < 1 - found.waits[i] / found.duration


def test_a_trajectory_read_back_rests_again() -> None:
    place = float(PIVOT.knot_parameters[2])
    found = time_scale(PIVOT, TURNING, robot=PIVOTING.replace(SERVO), stops=[place])
    again: Trajectory = replace(found, engine="stored")
    assert again.duration == found.duration
    np.testing.assert_array_equal(again.waits, found.waits)
