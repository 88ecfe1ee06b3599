"""Torques of the motors against work and energy, and rows of curves and power against the limits
themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from trajopt.errors import ArgumentError, ProblemError
from trajopt.limits.gradeability import grade_by_friction, grade_by_torque
from trajopt.limits.motor_curve import MotorCurve, at_wheel, pieces
from trajopt.limits.power import Power
from trajopt.limits.torques import motor_power, wheel_torques
from trajopt.limits.wheel_torque import WheelTorque
from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples
from trajopt.robots import Robot, robot, robot_names
from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.timing.track import Track, track
from trajopt.world.plane import Plane

G = STANDARD_GRAVITY
DC = {"motors.all.curve": [[0.0, 20.0], [12.0, 0.0]]}
CURVES = {
    "dc": [[0, 20], [12, 0]],
    "limited current": [[0, 8], [6, 8], [12, 0]],
    "ever faster": [[0, 9], [3, 8], [7, 5], [12, 0]],
    "constant power": [[0, 12], [2, 12], [4, 6], [8, 3], [14, 2]],
    "ever slower": [[0, 12], [2, 6], [6, 2], [12, 1]],
}


def driven_along(one: Robot, tilt: tuple[float, float] = (0.0, 0.0)) -> Track:
    """A curved path on a plane, with a heading of its own where the robot can."""
    points = [[0, 0], [1.5, 0.3], [3, -0.3], [4.5, 0.2]]
    free = {"heading": [0.2, 1.0, 0.1, -0.7], "turning_length": 0.5} if one.holonomic else {}
    return track(Path.through(points, **free), one, Plane(*tilt) if any(tilt) else None)


def at(along: Track, places: np.ndarray) -> PathSamples:
    return along.samples(places, along.path.locate(places))


def inertia_along(samples: PathSamples, one: Robot) -> np.ndarray:
    """Twice the kinetic energy per s'^2: of the body, and of the spin of driven wheels."""
    body, spin = one.body, samples.wheels.spin
    velocity = samples.velocity + np.cross(samples.turning, body.cog)
    moments = [body.roll_inertia, body.pitch_inertia, body.yaw_inertia]
    found = body.mass * np.sum(velocity**2, axis=1) + samples.turning**2 @ moments
    for i, wheel in enumerate(one.description.wheels):
        if wheel.name in one.driven:
            found = found + wheel.mass * wheel.radius**2 / 2 * spin[:, i] ** 2
    return np.asarray(found)


def height_along(samples: PathSamples, one: Robot) -> np.ndarray:
    return np.asarray(samples.position[:, 2] + (samples.rotation @ np.array(one.body.cog))[:, 2])


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.2, 0.7)])
@pytest.mark.parametrize("name", robot_names())
def test_motors_do_the_work_that_energy_needs(name, tilt):
    """d/ds of kinetic and potential energy, whatever s'' and s'^2: what the motors do per metre."""
    one = robot(name)
    along = driven_along(one, tilt)
    places, h = np.linspace(0.4, along.path.length - 0.4, 9), 1e-5
    before, here, after = (at(along, places + d) for d in (-h, 0.0, h))
    work = motor_power(here, one)
    total = [part.sum(axis=1) for part in (work.a, work.b, work.c)]
    inertia = inertia_along(here, one)
    bend = (inertia_along(after, one) - inertia_along(before, one)) / (4 * h)
    climb = one.body.mass * G * (height_along(after, one) - height_along(before, one)) / (2 * h)
    size = one.body.mass
    for value, expected, scale in zip(total, (inertia, bend, climb), (1, 1, G), strict=True):
        np.testing.assert_allclose(value / size, expected / size, atol=2e-6 * scale, rtol=2e-6)
    assert np.abs(work.a).max() > 0


@pytest.mark.parametrize("degrees", [-20, 0, 12])
def test_torque_on_a_straight_ramp(degrees):
    """Closed form of the docstring, with every sign."""
    one, grade = robot("powerbot"), np.radians(degrees)
    path = Path.through([[0, 0, 0], [3 * np.cos(grade), 0, 3 * np.sin(grade)]])
    samples = at(track(path, one), np.array([1.0]))
    r, m, m_w = 0.13, 148.0, 4.0
    for sdd in (-1.5, 0.0, 2.0):
        expected = r * m * (sdd + G * np.sin(grade)) / 2 + m_w * r * sdd / 2
        found = wheel_torques(samples, one).at(np.array([sdd]), np.array([0.7]))
        np.testing.assert_allclose(found, [[expected, expected]], rtol=1e-12, atol=1e-12)
        rows = WheelTorque(15.0).rows(samples, one)
        used = (rows.a * sdd + rows.b * 0.7 - rows.c) / rows.scale
        assert used.max() == pytest.approx(abs(expected) / 15.0 - 1, abs=1e-12)


def test_a_wheel_that_rolls_backwards_turns_its_motor_backwards():
    one = robot("powerbot")
    turned = one.replace({"wheels.left.angle": np.pi})
    places = np.array([0.7, 2.0])
    plain, other = (wheel_torques(at(driven_along(r), places), r) for r in (one, turned))
    sdd, sd2 = np.array([0.5, -0.4]), np.array([0.6, 0.3])
    np.testing.assert_allclose(
        other.at(sdd, sd2), plain.at(sdd, sd2) * [-1.0, 1.0], rtol=1e-9, atol=1e-9
    )
    for limit in (WheelTorque(9.0), MotorCurve(), Power(30.0)):
        margins = []
        for r in (one, turned):
            r = r.replace(DC)
            rows = limit.rows(replace(at(driven_along(r), places), sd2=sd2), r)
            used = rows.a * sdd[:, None] + rows.b * sd2[:, None] - rows.c
            margins.append(np.sort(used / rows.scale, axis=1))
        np.testing.assert_allclose(margins[0], margins[1], rtol=1e-9, atol=1e-9)


def test_one_torque_a_wheel():
    one = robot("loc8")
    samples = at(driven_along(one), np.array([1.0]))
    same = WheelTorque(5.0).rows(samples, one)
    each = WheelTorque((5.0, 5.0, np.inf, 2.5)).rows(samples, one)
    left = (same.c / same.scale)[0] - 1
    np.testing.assert_allclose((each.c / each.scale)[0] - 1, left, atol=1e-12)  # level: no offset
    ratio = (each.a / each.scale)[0] / (same.a / same.scale)[0]
    np.testing.assert_allclose(ratio, [1, 1, 0, 2, 1, 1, 0, 2], atol=1e-12)


# -- curves and power ------------------------------------------------------------------------------


def excess_of_curve(samples, one, sdd, sd2, *, braking=False):
    """(N,): the largest torque beyond the curve, as a share of stall torque, by interpolation."""
    torque = wheel_torques(samples, one).at(sdd, sd2)
    spin = samples.wheels.spin[:, [0, 1]] * np.sqrt(sd2)[:, None]
    speeds, most = np.array(at_wheel(one.description.motors[0])).T
    allowed = np.interp(np.abs(spin), speeds, most)
    driving = torque * np.sign(spin)
    found = (driving - allowed) / most[0]
    if braking:
        found = np.maximum(found, (-driving - allowed) / most[0])
    return found.max(axis=1)


@pytest.mark.parametrize("braking", ["full", "curve"])
@pytest.mark.parametrize("curve", CURVES)
def test_rows_of_a_curve_are_exact_at_their_speed_and_stricter_elsewhere(curve, braking):
    one = robot("powerbot", {"motors.all.curve": CURVES[curve], "motors.all.braking": braking})
    rng = np.random.default_rng(5)
    samples = at(driven_along(one, (0.2, 0.7)), rng.uniform(0.2, 4.2, 400))
    fastest = (CURVES[curve][-1][0] / np.abs(samples.wheels.spin[:, :2]).max(axis=1)) ** 2
    near = fastest * rng.uniform(1e-4, 1.0, 400)
    rows = MotorCurve().rows(replace(samples, sd2=near), one)
    np.testing.assert_allclose(rows.sd2_max, fastest, rtol=1e-12)
    for sd2, exact in ((near, True), (fastest * rng.uniform(1e-4, 1.0, 400), False)):
        sdd = rng.uniform(-2.0, 2.0, 400)
        used = (rows.a * sdd[:, None] + rows.b * sd2[:, None] - rows.c) / rows.scale
        true = excess_of_curve(samples, one, sdd, sd2, braking=braking == "curve")
        if exact:
            np.testing.assert_allclose(used.max(axis=1), true, rtol=1e-9, atol=1e-9)
        assert np.all(used.max(axis=1) >= true - 1e-9)


@pytest.mark.parametrize("curve", CURVES)
def test_rows_without_a_speed_hold_the_torque_at_rest(curve):
    one = robot("powerbot", {"motors.all.curve": CURVES[curve]})
    samples = at(driven_along(one), np.array([1.0, 2.0]))
    still = MotorCurve().rows(replace(samples, sd2=np.zeros(2)), one)
    rows = MotorCurve().rows(samples, one)
    np.testing.assert_allclose(rows.c, still.c, atol=3e-3)  # N m: taken at 0.1 mm/s, not at 0
    each = len(pieces(CURVES[curve]))
    np.testing.assert_allclose(
        rows.b, np.repeat(wheel_torques(samples, one).b[:, :2], each, axis=1), atol=1e-12
    )


def test_rows_of_power_are_exact_at_their_speed_and_stricter_elsewhere():
    one = robot("loc8")
    rng = np.random.default_rng(6)
    samples = at(driven_along(one, (0.2, 0.1)), rng.uniform(0.2, 4.2, 300))
    near, limit = rng.uniform(0.01, 4.0, 300), Power(40.0)
    rows = limit.rows(replace(samples, sd2=near), one)
    for sd2, exact in ((near, True), (rng.uniform(0.01, 4.0, 300), False)):
        sdd = rng.uniform(-2.0, 2.0, 300)
        power = motor_power(samples, one).at(sdd, sd2).sum(axis=1) * np.sqrt(sd2)
        used = ((rows.a * sdd[:, None] + rows.b * sd2[:, None] - rows.c) / rows.scale)[:, 0]
        if exact:
            np.testing.assert_allclose(used, power / 40.0 - 1, rtol=1e-9, atol=1e-9)
        else:  # G <= P / s' is the limit divided by s': signs, and where both break it, more so
            assert np.all(used[power > 40.0] > 0)
    free = limit.rows(samples, one)
    assert not free.a.any()
    assert not free.b.any()
    assert np.all(free.c > 0)


def test_pieces_bend_up_and_their_least_is_the_curve():
    for curve in CURVES.values():
        points = tuple((float(w), float(t)) for w, t in curve)
        speeds, torques = np.array(points).T
        grid = np.linspace(0, speeds[-1], 200)
        found = np.full(200, np.inf)
        for piece in pieces(points):
            w, t = np.array(piece).T
            slopes = np.diff(t) / np.diff(w)
            assert np.all(np.diff(slopes) >= 0)
            i = np.clip(np.searchsorted(w, grid) - 1, 0, len(slopes) - 1)
            found = np.minimum(found, t[i] + slopes[i] * (grid - w[i]))
        np.testing.assert_allclose(found, np.interp(grid, speeds, torques), atol=1e-12)


def test_a_gear_trades_speed_for_torque():
    """The shaft turns ``gear`` times as fast, with that much less torque."""
    plain = robot("powerbot", DC)
    geared = robot(
        "powerbot", {"motors.all.curve": [[0.0, 0.5], [480.0, 0.0]], "motors.all.gear": 40.0}
    )
    sd2 = np.array([0.3, 0.5])
    rows = []
    for one in (plain, geared):
        samples = replace(at(driven_along(one), np.array([1.0, 2.0])), sd2=sd2)
        found = MotorCurve().rows(samples, one)
        rows.append(np.hstack([found.a, found.b, found.c, found.sd2_max[:, None]]))
    np.testing.assert_allclose(rows[0], rows[1], rtol=1e-12)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"curve": [[1, 5], [2, 0]]}, "rise from 0"),
        ({"curve": [[0, 5], [2, 6]]}, "rise from 0"),
        ({"curve": [[0, 5], [2, 3], [2, 1]]}, "rise from 0"),
        ({"curve": [[0, 5], [2, -1]]}, "rise from 0"),
        ({"curve": [[0, 9], [1, 8], [2, 3], [3, 2]]}, "ever faster"),
        ({"curve": [[0, 5]]}, "2"),
        ({"gear": 20.0}, "a curve with it"),
        ({"braking": "curve"}, "a curve with it"),
        ({"regeneration": 1.5}, "1"),
    ],
)
def test_keys_of_a_motor_that_cannot_be_are_refused(changes, words):
    with pytest.raises(ProblemError, match=words):
        robot("powerbot", {f"motors.left.{key}": value for key, value in changes.items()})


def test_robots_whose_torques_are_not_known_are_refused():
    samples = at(driven_along(robot("powerbot")), np.array([1.0]))
    with pytest.raises(ArgumentError, match="robot"):
        WheelTorque().rows(samples, None)
    with pytest.raises(ArgumentError, match="curve"):
        MotorCurve().rows(samples, robot("powerbot"))
    for wrong in (0.0, -1.0, (1.0, -2.0)):
        with pytest.raises(ArgumentError, match=r"wheel_torque\.largest"):
            WheelTorque(wrong)
    with pytest.raises(ArgumentError, match=r"power\.largest"):
        Power(0.0)
    with pytest.raises(ArgumentError, match="motor"):
        WheelTorque(1.0).rows(samples, robot("powerbot", {"motors": []}))


# -- slopes ----------------------------------------------------------------------------------------


def test_slope_by_torque():
    """sin = driven wheels x torque / (r m g); a curve's torque at rest counts where it is less."""
    expected = np.arcsin(2 * 30.0 / (0.13 * 148.0 * G))
    one = robot("powerbot", {"motors.all.torque": 30.0})
    assert grade_by_torque(one) == pytest.approx(expected, rel=1e-12)
    curve = {"motors.all.curve": [[0, 3.0], [100.0, 0.0]], "motors.all.gear": 10.0}
    assert grade_by_torque(robot("powerbot", curve)) == pytest.approx(expected, rel=1e-12)
    assert grade_by_torque(robot("powerbot")) == np.pi / 2
    assert grade_by_torque(robot("swerve", {"motors.all.torque": 0.5})) == pytest.approx(
        np.arcsin(4 * 0.5 / (0.05 * 40.0 * G)), rel=1e-9
    )


def test_slope_by_friction():
    """The front axle drives: tan = mu l / (L + mu h), with l from the castors to the cog's foot."""
    expected = np.arctan(0.4 * 0.218 / (0.35 + 0.4 * 0.215))
    assert grade_by_friction(robot("powerbot"), 0.4) == pytest.approx(expected, abs=1e-9)
    assert grade_by_friction(robot("swerve"), 0.4) == pytest.approx(np.arctan(0.4), abs=1e-9)
