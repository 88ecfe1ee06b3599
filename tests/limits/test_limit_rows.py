"""Rows of the limits against closed forms and against finite differences of a moving robot."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.theses.textbook import planar, wheel
from trajopt.errors import ArgumentError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.forces import specific_force
from trajopt.limits.loads import contact_loads
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.speed_bound import SpeedProfile, SpeedZones
from trajopt.limits.tip import Tip, support_edges
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.limits.yaw_rate import YawRate
from trajopt.paths.path import Path
from trajopt.paths.samples import sample_path
from trajopt.robots.robot import STANDARD_GRAVITY, Body, Robot, robot

G, NAN = STANDARD_GRAVITY, float("nan")
MU, H, FRONT, REAR, TRACK = 0.332, 0.215, 0.132, 0.218, 0.2  # PowerBot-like, [waheed2006]


def powerbot_like(cog: tuple[float, float, float] = (0.0, 0.0, H)) -> Robot:
    """Origin at the centre of gravity by default, as the formulas of [waheed2006] have it."""
    size = {"radius": 0.12, "width": 0.05, "mass": 2.0}
    wheels = [
        {"name": name, "kind": "fixed", "position": [FRONT, y], **size}
        for name, y in (("left", TRACK), ("right", -TRACK))
    ]
    wheels += [
        {"name": name, "kind": "castor", "position": [0.05 - REAR, y], "trail": 0.05, **size}
        for name, y in (("castor-left", TRACK), ("castor-right", -TRACK))
    ]
    return Robot.of(
        {
            "name": "powerbot-like",
            "body": {
                "mass": 120.0,
                "cog": cog,
                "yaw_inertia": 8.0,
                "chassis": [0.8, 0.6, 0.2],
                "clearance": 0.1,
            },
            "wheels": wheels,
            "motors": [{"name": "drives", "wheels": ["left", "right"], "torque": 9.0}],
        }
    )


def slope_path(angle: float) -> Path:
    return Path.through([[0, 0, 0], [3 * np.cos(angle), 0, 3 * np.sin(angle)]])


CURVE = Path.through([[0, 0], [1, 0.4], [2, -0.2], [3, 0.5]])
TURNING = Path.through(
    [[0, 0], [1, 0.4], [2, -0.2], [3, 0.5]], heading=[0.2, 1.0, 0.1, -0.7], turning_length=0.5
)


@pytest.mark.parametrize(("degrees", "expected"), [(0, 2.55), (6, 3.56), (-6, 1.51)])
def test_braking_limits_of_the_thesis_robot(degrees, expected):
    """The drive axle carries more when braking: 2.55 flat, 3.56 uphill, 1.51 m/s^2 downhill (the
    thesis's own formula gives 2.70)."""
    samples = sample_path(slope_path(np.radians(degrees)), np.array([1.5]))
    rows = Slip(MU, sides=64).rows(samples, powerbot_like())
    slowing = rows.a < -1e-9
    braking = -np.max(rows.c[slowing] / rows.a[slowing])
    assert braking == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(("degrees", "slope_part"), [(0, 0.0), (6, np.sin(np.radians(6)))])
def test_tip_limits_of_the_thesis_robot(degrees, slope_part):
    """N_B = 0 when braking (-0.614 f_z), N_A = 0 when accelerating (1.014 f_z)."""
    samples = sample_path(slope_path(np.radians(degrees)), np.array([1.5]))
    rows = Tip().rows(samples, powerbot_like())
    f_z = G * np.cos(np.radians(degrees))
    pushing, slowing = rows.a > 1e-9, rows.a < -1e-9
    forward = np.min(rows.c[pushing] / rows.a[pushing])
    braking = np.max(rows.c[slowing] / rows.a[slowing])
    assert forward == pytest.approx(REAR / H * f_z - G * slope_part, rel=1e-9)
    assert braking == pytest.approx(-FRONT / H * f_z - G * slope_part, rel=1e-9)


def test_slip_is_the_formula_of_two_axles():
    """||(f_t, f_n)|| <= mu N_A with N_A = (0.218 f_z - 0.215 f_t)/0.35, as 16-gon, at random
    states."""
    rng = np.random.default_rng(1)
    samples = sample_path(CURVE, np.linspace(0.1, CURVE.length - 0.1, 40))
    rows = Slip(MU, sides=16, rule="load").rows(samples, powerbot_like())
    u, x = rng.uniform(-2, 2, (40, 1)), rng.uniform(0, 2, (40, 1))
    f_t, f_n = u, samples.curvature[:, None] * x
    angles = (np.arange(16) + 0.5) * np.pi / 8
    load = (REAR * G - H * f_t) / (FRONT + REAR)
    expected = f_t * np.cos(angles) + f_n * np.sin(angles) - np.cos(np.pi / 16) * MU * load
    np.testing.assert_allclose(rows.a * u + rows.b * x - rows.c, expected, atol=1e-9)


def test_lateral_tip_is_h_f_n_against_half_the_track():
    samples = sample_path(CURVE, np.linspace(0.1, CURVE.length - 0.1, 40))
    rows = Tip().rows(samples, powerbot_like())
    k = np.abs(samples.curvature)
    largest = np.min(
        np.where(rows.b > 1e-9, rows.c / np.where(rows.b > 1e-9, rows.b, 1.0), np.inf), axis=1
    )
    curved = k > 0.05
    np.testing.assert_allclose(largest[curved], (TRACK / H * G / k)[curved], rtol=1e-9)


def motion(s0: float, u: float, x: float, h: float = 1e-3) -> tuple[float, np.ndarray]:
    """Five path parameters h seconds apart of the motion with s' = sqrt(x), s'' = u at s0."""
    t = np.arange(-2, 3) * h
    return h, s0 + np.sqrt(x) * t + u * t**2 / 2


@pytest.mark.parametrize("cog", [(0.0, 0.0, 0.2), (-0.13, 0.05, 0.3)])
@pytest.mark.parametrize("path", [CURVE, TURNING], ids=["tangent", "turning"])
def test_specific_force_is_the_acceleration_of_the_centre_of_gravity(path, cog):
    body = Body(100.0, 8.0, cog, ((1, 1), (-1, 1), (0, -1)), (NAN,) * 3, (True,) * 3, 3.0, 5.0)
    for s0, u, x in [(0.8, 0.7, 0.4), (1.9, -0.5, 1.1)]:
        h, s = motion(s0, u, x)
        samples = sample_path(path, s)
        cos, sin = np.cos(samples.yaw), np.sin(samples.yaw)
        arm = np.column_stack([cos * cog[0] - sin * cog[1], sin * cog[0] + cos * cog[1]])
        world = samples.position[:, :2] + arm
        second = (-world[0] + 16 * world[1] - 30 * world[2] + 16 * world[3] - world[4]) / (
            12 * h**2
        )
        expected = [
            cos[2] * second[0] + sin[2] * second[1],
            -sin[2] * second[0] + cos[2] * second[1],
            G,
        ]
        force = specific_force(sample_path(path, np.array([s0])), body)
        np.testing.assert_allclose((force.a * u + force.b * x + force.c)[0], expected, atol=1e-5)


@pytest.mark.parametrize(("path", "mover"), [(CURVE, powerbot_like()), (TURNING, robot("loc8"))])
def test_wheel_rows_are_the_derivatives_of_wheel_rates(path, mover):
    s0, u, x = 1.3, 0.6, 0.9
    h, s = motion(s0, u, x)
    speed = np.sqrt(x) + u * np.arange(-2, 3) * h
    rates = sample_path(path, s).twist @ mover.inverse.T * speed[:, None]
    derivative = (rates[0] - 8 * rates[1] + 8 * rates[3] - rates[4]) / (12 * h)
    here = sample_path(path, np.array([s0]))
    rows = WheelAcceleration(1.0).rows(here, mover)
    wheels = len(mover.wheels)
    np.testing.assert_allclose((rows.a * u + rows.b * x)[0, :wheels], derivative, rtol=1e-6)
    top = WheelSpeed(10.0).rows(here, mover).sd2_max[0]
    assert np.abs(here.twist[0] @ mover.inverse.T).max() * np.sqrt(top) == pytest.approx(10.0)


@pytest.mark.parametrize("make", [WheelSpeed, WheelAcceleration])
def test_one_number_a_wheel_binds_each_wheel_at_its_own(make):
    """Equal numbers are one number; a wheel with half of it binds as half for all does there."""
    mover, samples = robot("loc8"), sample_path(CURVE, np.linspace(0, CURVE.length, 9))
    one, same = (make(v).rows(samples, mover) for v in (4.0, (4.0,) * 4))
    np.testing.assert_array_equal(one.sd2_max, same.sd2_max)
    np.testing.assert_array_equal(one.a, same.a)
    for i in range(4):
        values = [np.inf] * 4
        values[i] = 2.0
        rows = make(tuple(values)).rows(samples, mover)
        rates = np.abs(samples.twist @ mover.inverse[i])
        if make is WheelSpeed:
            np.testing.assert_allclose(rows.sd2_max, (2.0 / rates) ** 2)
        else:
            np.testing.assert_allclose(rows.a[:, i], samples.twist @ mover.inverse[i])
            np.testing.assert_allclose(rows.b[:, 4 + i], -samples.twist_rate @ mover.inverse[i])
            assert not rows.a[:, [j for j in range(8) if j % 4 != i]].any()
            assert (rows.c == 2.0).all()
    for wrong in ((1.0, 2.0), (1.0,) * 5):
        with pytest.raises(ArgumentError, match="one each"):
            make(wrong).rows(samples, mover)
    for wrong in ((), (1.0, 0.0, 1.0, 1.0), (np.inf,) * 4):
        with pytest.raises(ArgumentError, match="> 0"):
            make(wrong)


def test_acceleration_is_the_rate_of_translational_speed():
    s0, u, x = 1.3, 0.6, 0.9
    h, s = motion(s0, u, x)
    twist = sample_path(TURNING, s).twist
    speed = np.hypot(twist[:, 0], twist[:, 1]) * (np.sqrt(x) + u * np.arange(-2, 3) * h)
    derivative = (speed[0] - 8 * speed[1] + 8 * speed[3] - speed[4]) / (12 * h)
    rows = Acceleration(2.0, 3.0).rows(sample_path(TURNING, np.array([s0])), None)
    used = (rows.a * u + rows.b * x)[0]
    np.testing.assert_allclose(used, [derivative, -derivative], rtol=1e-6)
    np.testing.assert_allclose(rows.c[0], [2.0, 3.0])


def test_turn_on_the_spot_counts_no_translation():
    spot = Path.through(
        [[0, 0], [1, 0], [1.0, 1e-9], [2, 0]],
        knots=[0, 1, 2, 3],
        heading=[0, 0, 2, 2],
        turning_length=0.5,
    )
    samples = sample_path(spot, np.linspace(0, spot.length, 7))
    pure = samples.__class__(**{**samples.__dict__, "twist": np.tile([0.0, 0.0, 2.0], (7, 1))})
    assert np.all(np.isinf(Speed(1.0).rows(pure, None).sd2_max))
    rows = Acceleration(1.0, 1.0).rows(pure, None)
    assert np.all(rows.a == 0)
    assert np.all(rows.b == 0)
    np.testing.assert_allclose(YawRate(1.0).rows(pure, None).sd2_max, 0.25)


def test_four_wheel_loads_balance_force_and_moments():
    rng = np.random.default_rng(3)
    mover = robot("loc8")
    samples = sample_path(TURNING, rng.uniform(0.1, TURNING.length - 0.1, 30))
    u, x = rng.uniform(-2, 2, (30, 1)), rng.uniform(0, 2, (30, 1))
    loads, force = contact_loads(samples, mover), specific_force(samples, mover.body)
    n = loads.a * u + loads.b * x + loads.c
    f = force.a * u + force.b * x + force.c
    arms, h = np.array(mover.body.contacts), mover.body.cog[2]
    np.testing.assert_allclose(n.sum(axis=1), f[:, 2], atol=1e-9)
    np.testing.assert_allclose(n @ arms[:, 0], -h * f[:, 0], atol=1e-9)
    np.testing.assert_allclose(n @ arms[:, 1], -h * f[:, 1], atol=1e-9)
    # Equal stiffness: front-left + rear-right = front-right + rear-left (no warp of the ground).
    np.testing.assert_allclose(n[:, 0] + n[:, 3], n[:, 1] + n[:, 2], atol=1e-9)


def test_mecanum_slip_by_hand():
    """Forward push on level ground: every roller carries a force of m a / (4 cos 45), loads shift
    by h a."""
    mover, mu, push = robot("loc8"), 0.4, 1.0
    straight = Path.through([[0, 0], [2, 0]], heading=[0, 0], turning_length=0.5)
    rows = Slip(mu, rule="least_norm").rows(sample_path(straight, np.array([1.0])), mover)
    used = (rows.a * push - rows.c)[0].reshape(4, 2).max(axis=1)
    shift = mover.body.cog[2] * push / (4 * 0.376)
    loads = G / 4 + np.array([-shift, -shift, shift, shift])
    np.testing.assert_allclose(used, push / (4 * np.cos(np.pi / 4)) - mu * loads, atol=1e-9)


def test_per_wheel_slip_is_stricter_in_a_curve_and_equal_on_a_straight():
    mover = powerbot_like(cog=(-0.1, 0.0, 0.3))
    curve = sample_path(CURVE, np.linspace(0.2, CURVE.length - 0.2, 50))

    def top_speed(limit: Slip) -> np.ndarray:
        rows = limit.rows(curve, mover)
        return np.min(
            np.where(rows.b > 1e-9, rows.c / np.where(rows.b > 1e-9, rows.b, 1), np.inf), axis=1
        )

    assert np.all(top_speed(Slip(0.5)) <= top_speed(Slip(0.5, rule="load")) * (1 + 1e-9))
    straight = sample_path(slope_path(0.1), np.array([1.0]))
    top = []
    for limit in (Slip(0.5, rule="load"), Slip(0.5)):
        rows = limit.rows(straight, mover)
        top.append(np.min(rows.c[rows.a > 1e-9] / rows.a[rows.a > 1e-9]))
    assert top[0] == pytest.approx(top[1], rel=1e-9)


def test_support_polygon_is_counted_once():
    contacts = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1), (0, 0.5), (1, 0)])
    normals, distances = support_edges(contacts - np.array([0.1, 0.0]))
    assert len(normals) == 4
    np.testing.assert_allclose(np.sort(distances), [0.9, 1.0, 1.0, 1.1])


def test_speed_bounds_along_the_path():
    samples = sample_path(slope_path(0.0), np.linspace(0, 3, 31))
    zones = SpeedZones(((0.5, 1.0, 0.4), (0.8, 2.0, 0.2))).rows(samples, None)
    speed = np.sqrt(zones.sd2_max)
    np.testing.assert_allclose(speed[[4, 5, 7, 8, 10, 20]], [np.inf, 0.4, 0.4, 0.2, 0.2, 0.2])
    assert np.isinf(speed[21])
    assert zones.edges == (0.5, 0.8, 1.0, 2.0)
    profile = SpeedProfile((0.0, 2.0), (1.0, 0.5)).rows(samples, None)
    np.testing.assert_allclose(np.sqrt(profile.sd2_max)[[0, 10, 20, 30]], [1.0, 0.75, 0.5, 0.5])


@pytest.mark.parametrize(
    "build",
    [
        lambda: Speed(0.0),
        lambda: Speed(NAN),
        lambda: YawRate(-1.0),
        lambda: WheelSpeed(np.inf),
        lambda: WheelAcceleration(0.0),
        lambda: Acceleration(1.0, -1.0),
        lambda: Slip(0.0),
        lambda: Slip(0.3, sides=3),
        lambda: Tip(-0.1),
        lambda: SpeedZones(((1.0, 0.5, 1.0),)),
        lambda: SpeedZones(((0.0, 1.0, -1.0),)),
        lambda: SpeedProfile((), ()),
        lambda: SpeedProfile((0.0, 1.0), (1.0,)),
        lambda: SpeedProfile((0.0, 1.0), (1.0, NAN)),
    ],
)
def test_numbers_that_make_no_limit_are_refused(build):
    with pytest.raises(ArgumentError):
        build()


def test_robots_that_a_limit_cannot_use_are_refused():
    samples = sample_path(CURVE, np.array([1.0]))
    for limit in (Slip(0.3), Tip(), WheelSpeed(1.0), WheelAcceleration(1.0)):
        with pytest.raises(ArgumentError, match="robot"):
            limit.rows(samples, None)
    with pytest.raises(ArgumentError, match="support"):
        Tip(reserve=0.15).rows(samples, powerbot_like())
    line = planar("line", *(wheel("fixed", x, 0.0) for x in (1.0, 0.0, -1.0)))
    for limit in (Slip(0.3), Tip()):
        with pytest.raises(ArgumentError, match="line"):
            limit.rows(samples, line)
