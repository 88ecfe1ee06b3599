"""Wheel states against closed forms, SciPy's integration, and angles that no robot can start with."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from trajopt.errors import ArgumentError
from trajopt.paths.path import Path
from trajopt.robots import Robot, robot
from trajopt.robots.start import given_angles, start_angles
from trajopt.robots.steering import steering_of
from trajopt.timing.track import Track, track

POWERBOT = robot("powerbot")
CASTOR = "castor-left"
AT = [w.name for w in POWERBOT.description.wheels].index(CASTOR)
TRAIL = POWERBOT.description.wheels[AT].trail


def circle(radius: float, angle: float, knots: int = 400) -> Path:
    """Counter-clockwise from the origin, heading east; to the left for a radius > 0."""
    turn = np.linspace(0.0, angle, knots)
    points = np.column_stack([abs(radius) * np.sin(turn), radius * (1 - np.cos(turn))])
    ends = [abs(radius) * np.array([np.cos(a), np.sign(radius) * np.sin(a)]) for a in (0, angle)]
    return Path.through(points, knots=turn, start_direction=ends[0], end_direction=ends[1])


def steering_at(on: Track, s: np.ndarray) -> np.ndarray:
    states = on.samples(s, on.path.locate(s)).wheels
    assert states is not None
    return np.asarray(states.steering)


@pytest.mark.parametrize("start", [-2.5, -0.7, 0.4, 3.0])
def test_a_castor_pulled_straight_follows_the_tractrix(start: float) -> None:
    # trail beta' = -sin(beta): tan(beta / 2) falls like exp(-s / trail)
    on = track(Path.through([[0, 0], [2, 0]]), POWERBOT, start_steering={CASTOR: start})
    s = np.linspace(0.0, 0.6, 50)
    closed = 2 * np.arctan(np.tan(start / 2) * np.exp(-s / TRAIL))
    np.testing.assert_allclose(steering_at(on, s)[:, AT], closed, atol=2e-8)


@pytest.mark.parametrize("radius", [0.8, -0.8, 2.0])
def test_a_castor_on_a_circle_ends_where_its_pull_and_its_turn_agree(radius: float) -> None:
    on = track(circle(radius, 4.0), POWERBOT)
    x, y = POWERBOT.description.wheels[AT].position
    kappa = np.sign(radius) * 4.0 / on.path.length
    # v.n = trail kappa at rest in the body: |v| sin(direction - beta) = trail kappa
    v = np.array([1 - kappa * y, kappa * x])
    steady = np.arctan2(v[1], v[0]) - np.arcsin(TRAIL * kappa / np.hypot(*v))
    found = steering_at(on, np.array([on.path.length * 0.9]))[0, AT]
    assert found == pytest.approx(steady, abs=1e-6)
    assert abs(steady) > 0.1


@pytest.mark.parametrize(
    ("name", "start"), [("powerbot", 2.0), ("asoc-4", 0.3), ("small-differential", -1.0)]
)
def test_castors_agree_with_scipy(name: str, start: float) -> None:
    one = robot(name)
    castors = [w for w in one.description.wheels if w.kind == "castor"]
    points = [[0, 0], [0.7, 0.5], [1.6, -0.2], [2.2, 0.1]]
    heading = [0.2, 1.0, 0.3, -0.6] if one.holonomic else None
    path = Path.through(points, heading=heading, turning_length=one.turning_length)
    x, y = np.array([w.position for w in castors]).T
    trail, zero = np.array([w.trail for w in castors]), np.array([w.angle for w in castors])

    def rate(u: float, beta: np.ndarray) -> np.ndarray:
        (vx, vy, _), w, yaw = path.position(u, 1)[0], path.yaw(u, 1)[0], path.yaw(u)[0]
        ahead, left = vx * np.cos(yaw) + vy * np.sin(yaw), vy * np.cos(yaw) - vx * np.sin(yaw)
        direction = zero + beta
        across = (left + w * x) * np.cos(direction) - (ahead - w * y) * np.sin(direction)
        return np.asarray(across / trail - w)

    on = track(path, one, start_steering={w.name: start for w in castors})
    places = [one.description.wheels.index(w) for w in castors]
    beta, knots = np.full(len(castors), start), path.basis.knots
    for begin, end in pairwise(knots):
        inside = np.linspace(begin, end, 5)
        run = solve_ivp(rate, (begin, end), beta, "DOP853", inside, rtol=1e-12, atol=1e-13)
        found = steering_at(on, path.parameter(inside))[:, places]
        np.testing.assert_allclose(found, run.y.T, atol=2e-7)
        beta = run.y[:, -1]


def test_a_steering_angle_is_that_of_its_wheel_on_the_circle() -> None:
    car, on = robot("car"), track(circle(1.5, 2.0), robot("car"))
    samples = on.samples(np.array([1.0]), on.path.locate([1.0]))
    states, radius = samples.wheels, 1 / samples.twist[0, 2]
    assert states is not None
    assert radius == pytest.approx(1.5, rel=1e-5)
    base, half = car.description.wheels[0].position
    left, right = np.arctan2(base, radius - half), np.arctan2(base, radius + half)
    np.testing.assert_allclose(states.steering[0], [left, right, 0, 0], atol=1e-8)
    front = [np.hypot(base, radius - half), np.hypot(base, radius + half)]
    rear = [radius - half, radius + half]
    np.testing.assert_allclose(states.spin[0] * 0.05 * radius, [*front, *rear], atol=1e-8)
    middle = car.replace({"steering.front.rule": "parallel"})
    found = steering_at(track(circle(1.5, 2.0), middle), np.array([1.0]))
    np.testing.assert_allclose(found[0, :2], np.arctan(base / radius), atol=1e-8)


@pytest.mark.parametrize("name", ["car", "tricycle", "swerve", "asoc-4", "powerbot"])
def test_rates_are_derivatives_of_angles(name: str) -> None:
    one = robot(name)
    points = [[0, 0], [1.5, 0.3], [3, -0.1], [4.5, 0.2]]
    heading = [0.2, 0.9, 0.3, -0.6] if name in ("swerve", "asoc-4") else None
    path = Path.through(points, heading=heading, turning_length=one.turning_length)
    given = {w.name: 0.8 for w in one.description.wheels if w.kind == "castor"}
    on, s, h = track(path, one, start_steering=given), np.array([0.4, 1.1, 2.3, 3.9]), 1e-3

    def states(at: np.ndarray):
        found = on.samples(at, path.locate(at)).wheels
        assert found is not None
        return found

    here, sides = states(s), [states(s + k * h) for k in (-2, -1, 1, 2)]
    for value, rate in (
        ("steering", "steering_rate"),
        ("steering_rate", "steering_bend"),
        ("spin", "spin_rate"),
        ("group_rate", "group_bend"),
    ):
        a, b, c, d = (getattr(side, value) for side in sides)
        slope = (a - 8 * b + 8 * c - d) / (12 * h)
        np.testing.assert_allclose(getattr(here, rate), slope, atol=2e-6, err_msg=value)
    u = path.locate
    a, b, c, d = (on.wheels.at(u(s + k * h)) for k in (-2, -1, 1, 2))
    np.testing.assert_allclose(here.spin, (a - 8 * b + 8 * c - d) / (12 * h), atol=1e-7)
    contacts = np.array([w.position for w in one.description.wheels])
    for k, wheel in enumerate(one.description.wheels):
        if wheel.kind == "castor":
            angle = wheel.angle + here.steering[:, k]
            back = np.column_stack([np.cos(angle), np.sin(angle)])
            left = np.column_stack([-np.sin(angle), np.cos(angle)])
            there = contacts[k] - wheel.trail * back + wheel.lateral * left
            np.testing.assert_allclose(here.contacts[:, k], there, atol=1e-12)


def test_a_steered_wheel_through_zero_velocity_goes_on_the_other_way() -> None:
    # The pivot at (0.25, 0.25) stands still for an instant: its path in the plane has a cusp.
    swerve = robot("swerve")
    path = Path.through([[0, 0], [0.5, 0.2], [1, 0]], heading=[0.0, 0.5, 0.0], turning_length=0.35)
    u = float(path.basis.knots[1]) * 0.6
    p, q = path.position([u], 1)[0], path.yaw([u], 1)[0]
    # the place of the body that stands still there: v + w x r = 0 in the body frame
    yaw = path.yaw([u])[0]
    v = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]) @ p[:2]
    moved = swerve.replace({"wheels.front-left.position": [-v[1] / q, v[0] / q]})
    on = track(path, moved)
    near = u + np.array([-1e-3, -1e-7, 0.0, 1e-7, 1e-3])
    samples = on.samples(path.parameter(near), near)
    states = samples.wheels
    assert states is not None
    angle, spin = states.steering[:, 0], states.spin[:, 0]
    assert np.abs(np.diff(angle)).max() < 0.02
    assert spin[0] * spin[-1] < 0
    assert abs(spin[2]) < 1e-6
    assert states.steering_rate[2, 0] == pytest.approx(states.steering_rate[1, 0], rel=1e-3)


CAR, SWERVE, ASOC = robot("car"), robot("swerve"), robot("asoc-4")
WRONG: list[tuple[Robot, dict, str]] = [
    (CAR, {"front": 0.1}, "among front-left, front-right"),
    (CAR, {"rear-left": 0.1}, "among front-left, front-right"),
    (robot("loc8"), {"front-left": 0.1}, "among none"),
    (POWERBOT, {"left": 0.1}, "among castor-left"),
    (SWERVE, {"front-left": float("nan")}, "finite angles"),
    (SWERVE, {"front-left": float("inf")}, "finite angles"),
    (SWERVE, {"front-left": "0.1"}, "finite angles"),
    (SWERVE, {"front-left": True}, "finite angles"),
    (ASOC, {"module-1-left": 0.1, "module-1-right": 0.2}, "one angle for the pivot 'module-1'"),
    (CAR, {"front-left": 0.6}, "its range, -0.4189 to 0.4189"),
    (CAR, {"front-left": -0.6}, "its range, -0.4189 to 0.4189"),
    (robot("tricycle"), {"front": 1.31}, "its range, -1.3 to 1.3"),
    (CAR, {"front-left": 0.3, "front-right": 0.3}, "as one motion of the robot needs them"),
]


@pytest.mark.parametrize(("one", "given", "words"), WRONG)
def test_start_angles_that_cannot_be_are_refused(one: Robot, given: dict, words: str) -> None:
    with pytest.raises(ArgumentError, match="start_steering") as caught:
        track(Path.through([[0, 0], [2, 0]]), one, start_steering=given)
    assert words in str(caught.value)


def test_start_angles_need_a_robot_and_a_mapping() -> None:
    path = Path.through([[0, 0], [2, 0]])
    with pytest.raises(ArgumentError, match="a robot whose wheels"):
        track(path, None, start_steering={"front-left": 0.1})
    with pytest.raises(ArgumentError, match="by name of the wheel"):
        track(path, CAR, start_steering=[0.1, 0.1])  # type: ignore[arg-type]


def test_one_angle_tells_those_of_all_wheels_steered_with_it() -> None:
    steering, (base, half) = steering_of(CAR), CAR.description.wheels[0].position
    radius = -1.5  # to the right
    left, right = np.arctan(base / (radius - half)), np.arctan(base / (radius + half))
    middle = np.arctan(base / radius)
    for given in ({0: left}, {1: right}, {0: left, 1: right}):
        np.testing.assert_allclose(given_angles(steering, given), [left, right, middle], atol=1e-9)
    assert np.isnan(given_angles(steering, {})).all()
    endless = steering_of(CAR.replace({"steering.front.range": None}))
    sharp = np.arctan(base / np.array([-0.2 - half, -0.2 + half, -0.2])) - np.pi
    np.testing.assert_allclose(given_angles(endless, {0: sharp[0]}), sharp, atol=1e-9)
    tricycle = steering_of(robot("tricycle"))
    for end in (-1.3, 1.3):  # ends of the range belong to it
        np.testing.assert_allclose(given_angles(tricycle, {0: end}), end, atol=1e-12)
    parallel = steering_of(CAR.replace({"steering.front.rule": "parallel"}))
    np.testing.assert_allclose(given_angles(parallel, {1: 0.2}), [0.2, 0.2, 0.2], atol=1e-12)
    pair = SWERVE.description.model_dump(mode="json", exclude_none=True)
    pair["steering"] = [
        {"name": "front", "wheels": ["front-left", "front-right"]},
        {"name": "rear", "wheels": ["rear-left", "rear-right"]},
    ]
    both = steering_of(Robot.of(pair))
    with pytest.raises(ArgumentError, match="angles of all wheels of the steering 'front'"):
        given_angles(both, {0: 0.2})
    assert start_angles(steering_of(ASOC), {"module-1-left": 0.4}) == {0: 0.4, 1: 0.4}


def test_angles_count_from_the_rolling_direction_of_the_file() -> None:
    turned = {"wheels.front-left.angle": 0.5, "wheels.rear-right.angle": -0.4}
    path = Path.through([[0, 0], [1, 0.3], [2, 0]], heading=[0.1, 0.6, 0.2], turning_length=0.35)
    s = np.linspace(0, path.length, 7)
    zero, off = np.zeros(4), np.array([0.5, 0, 0, -0.4])
    found = [track(path, SWERVE.replace(turned if any(a) else {})) for a in (zero, off)]
    here = [on.samples(s, path.locate(s)).wheels for on in found]
    np.testing.assert_allclose(here[1].steering, here[0].steering - off, atol=1e-12)
    np.testing.assert_allclose(here[1].spin, here[0].spin, atol=1e-12)
    askew = POWERBOT.replace({f"wheels.{CASTOR}.angle": 0.7})
    bend, s = Path.through([[0, 0], [0.5, 0.2], [1, 0]]), np.linspace(0, 1, 7)
    plain = steering_at(track(bend, POWERBOT, start_steering={CASTOR: 0.3}), s)[:, AT]
    found_too = steering_at(track(bend, askew, start_steering={CASTOR: -0.4}), s)[:, AT]
    np.testing.assert_allclose(found_too, plain - 0.7, atol=1e-7)
    # car: one wheel's angle, told from its own zero, tells that of its pair and of the middle
    car = steering_of(
        CAR.replace({"wheels.front-left.angle": 0.3, "wheels.front-right.angle": 0.3})
    )
    plain = given_angles(steering_of(CAR), {0: 0.2})
    np.testing.assert_allclose(given_angles(car, {0: -0.1}), plain - 0.3, atol=1e-12)
    both = {"wheels.front-left.angle": 0.3, "wheels.front-right.angle": 0.1}
    parallel = steering_of(CAR.replace({**both, "steering.front.rule": "parallel"}))
    np.testing.assert_allclose(given_angles(parallel, {1: 0.2}), [0.0, 0.2, 0.0], atol=1e-12)
    np.testing.assert_allclose(given_angles(parallel, {0: 0.2}), [0.2, 0.4, 0.2], atol=1e-12)
