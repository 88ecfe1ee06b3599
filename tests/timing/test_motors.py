"""Motions that motors bound: torque falling with speed, power, and the work they do."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.motor_curve import MotorCurve
from trajopt.limits.power import Power
from trajopt.limits.speed import Speed
from trajopt.limits.torques import motor_power, wheel_torques
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_torque import WheelTorque
from trajopt.paths.path import Path
from trajopt.robots import Robot, robot
from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.timing.scaling import rough_duration, time_scale
from trajopt.timing.sensitivity import sensitivities
from trajopt.timing.track import track

G = STANDARD_GRAVITY
M, RADIUS, WHEEL = 148.0, 0.13, 4.0  # PowerBot: kg, m, kg
MASS = M + 2 * WHEEL / 2  # with the spin of its two driven wheels, discs, kg
STALL, FREE = 20.0, 10.0  # N m, rad/s at a wheel
LENGTH, BRAKES = 6.0, 0.8  # m, m/s^2
STRAIGHT = Path.through([[0, 0], [LENGTH, 0]])
HILLS = Path.through(
    [[0, 0, 0], [1.5, 0.4, 0.15], [3, -0.2, 0.0], [4.5, 0.5, 0.12], [6, 0.0, 0.05]]
)


def dc(stall: float = STALL, free: float = FREE, **changes: object) -> Robot:
    return robot("powerbot", {"motors.all.curve": [[0.0, stall], [free, 0.0]], **changes})


def graded(path: Path, count: int = 4000) -> np.ndarray:
    """Gridpoints that crowd at the start, where torque falls with the root of s."""
    return path.length * (np.arange(count + 1) / count) ** 2


def uphill(angle: float, length: float = LENGTH) -> Path:
    return Path.through([[0, 0, 0], [length * np.cos(angle), 0, length * np.sin(angle)]])


@pytest.mark.parametrize("grade", [0.0, 0.05, -0.03])
def test_dc_motors_approach_their_speed_exponentially(grade):
    """v = v_end (1 - exp(-t / tau)) with what the slope leaves of stall torque; then the brakes."""
    force = 2 * STALL / RADIUS  # N, at rest
    end = RADIUS * FREE * (1 - M * G * np.sin(grade) / force)
    tau = MASS * RADIUS * FREE / force

    def speed(t: float) -> float:
        return end * -np.expm1(-t / tau)

    def way(t: float) -> float:
        return end * (t + tau * np.expm1(-t / tau))

    cap = RADIUS * FREE  # downhill: no faster than the curve's last point
    reaches = brentq(lambda t: speed(t) - cap, 0, 100) if end > cap else np.inf

    def beyond(t: float) -> tuple[float, float]:
        if t <= reaches:
            return speed(t), way(t)
        return cap, way(reaches) + cap * (t - reaches)

    def overshoot(t: float) -> float:
        v, x = beyond(t)
        return x + v**2 / 2 / BRAKES - LENGTH

    brakes = brentq(overshoot, 0, 100)
    expected = brakes + beyond(brakes)[0] / BRAKES
    path = uphill(grade)
    found = time_scale(
        path, [MotorCurve(), Acceleration(100.0, BRAKES)], robot=dc(), gridpoints=graded(path)
    )
    assert found.duration == pytest.approx(expected, rel=1e-4)
    assert found.duration > expected * (1 - 1e-9)  # between gridpoints nothing is broken
    assert min(found.margins().values()) > -1e-9
    middle = found.at(found.duration / 3).twist[0, 0]
    assert middle == pytest.approx(beyond(found.duration / 3)[0], rel=1e-3)


def test_constant_power_gives_a_speed_that_grows_with_the_root_of_time():
    """v = sqrt(v1^2 + 2 P (t - t1) / m) from the speed where torque stops to bind; then brakes."""
    power, hardest = 50.0, 5.0
    v1 = power / (MASS * hardest)
    t1, x1 = v1 / hardest, v1**2 / 2 / hardest
    top = brentq(
        lambda v: x1 + MASS / 3 / power * (v**3 - v1**3) + v**2 / 2 / BRAKES - LENGTH, v1, 10.0
    )
    expected = t1 + (top**2 - v1**2) * MASS / 2 / power + top / BRAKES
    limits = [Power(power), Acceleration(hardest, BRAKES)]
    found = time_scale(STRAIGHT, limits, robot=robot("powerbot"), gridpoints=graded(STRAIGHT, 5500))
    assert found.duration == pytest.approx(expected, rel=1e-4)
    assert found.duration > expected * (1 - 1e-9)
    assert min(found.margins().values()) > -1e-9
    work = power * (expected - t1 - top / BRAKES) + MASS * v1**2 / 2
    assert found.energy == pytest.approx(work, rel=1e-3)


def test_power_alone_bounds_a_motion():
    """Where nothing else does: from a speed on, v^3 grows by 3 P / m a metre."""
    start, power = 0.5, 60.0
    end = (start**3 + 3 * power / MASS * LENGTH) ** (1 / 3)
    found = time_scale(
        STRAIGHT,
        [Power(power), Acceleration(1e3, 1e3)],
        robot=robot("powerbot"),
        start_speed=start,
        end_speed=0.995 * end,
        gridpoints=800,
    )
    assert found.duration == pytest.approx((end**2 - start**2) * MASS / 2 / power, rel=1e-3)
    assert set(found.binding) - {""} == {"power"}


def by_scalars(path: Path, one: Robot, power: float, cells: int) -> float:
    """Duration of the fastest motion on equal cells, without rows or tangents: from the end the
    greatest s'^2 that can still brake, found by bisection, then from the start as fast as torque,
    curve and power allow below it."""
    s = np.linspace(0.0, path.length, cells + 1)
    samples, h = track(path, one).samples(s, path.locate(s)), path.length / cells
    torque, work = wheel_torques(samples, one), motor_power(samples, one)
    total = np.stack([getattr(work, k).sum(axis=1) for k in "abc"], axis=1).tolist()
    wheels = np.stack(
        [torque.a[:, :2], torque.b[:, :2], torque.c[:, :2], samples.wheels.spin[:, :2]], axis=1
    ).tolist()
    speeds, most = np.array(one.description.motors[0].curve).T
    hardest = one.description.motors[0].torque

    def bounds(i: int, x: float) -> tuple[float, float]:
        """Least and greatest s''."""
        (low, high), v = (-np.inf, np.inf), np.sqrt(x)
        for a, b, c, spin in zip(*wheels[i], strict=True):
            driving = min(hardest, float(np.interp(abs(spin) * v, speeds, most)))
            if abs(spin) * v > speeds[-1]:
                return 1.0, -1.0
            way = 1.0 if spin > 0 else -1.0
            for sign, largest in ((way, driving), (-way, hardest)):
                room = (largest - sign * (b * x + c)) / (sign * a)
                low, high = (low, min(high, room)) if sign * a > 0 else (max(low, room), high)
        a, b, c = total[i]
        return low, min(high, (power / v - b * x - c) / a) if v > 0 else high

    highest = [0.0] * (cells + 1)
    for i in range(cells - 1, -1, -1):
        lower, upper = 0.0, highest[i + 1] + 20.0 * h
        for _ in range(45):
            x = (lower + upper) / 2
            low, high = bounds(i, x)
            fits = low <= high and x + 2 * low * h <= highest[i + 1]
            lower, upper = (x, upper) if fits else (lower, x)
        highest[i] = lower
    x = [0.0]
    for i in range(cells):
        x.append(min(highest[i + 1], x[i] + 2 * bounds(i, x[i])[1] * h))
    v = np.sqrt(x)
    return float(np.sum(2 * h / (v[1:] + v[:-1])))


@pytest.mark.parametrize(
    "curve", [[[0, 20], [30, 0]], [[0, 22], [2, 22], [4, 11], [8, 5.5], [25, 1]]]
)
def test_hills_and_bends_against_scalars(curve):
    """DC motors, and motors of constant power, with hills, bends and a bound on power. The error of
    scalars halves with their cells: extrapolated."""
    one = robot("powerbot", {"motors.all.curve": curve, "motors.all.torque": 25.0})
    limits = [WheelTorque(), MotorCurve(), Power(150.0)]
    found = time_scale(HILLS, limits, robot=one, gridpoints=graded(HILLS, 2000))
    times = [by_scalars(HILLS, one, 150.0, cells) for cells in (1500, 3000)]
    expected = 2 * times[1] - times[0]
    assert found.duration == pytest.approx(expected, rel=1e-4)
    # Bound and motion are nearer to each other than to these scalars, which with 12,000 cells and
    # extrapolated come to 7.37964 s and 9.53257 s: bounds and motions to 7.37965 and 7.37966 s, 9.53243
    # and 9.53244 s.
    assert found.bound * (1 - 5e-5) < expected < found.duration * (1 + 5e-5)
    assert found.gap < 2e-5
    assert min(found.margins().values()) > -1e-9
    assert {"motor_curve", "wheel_torque", "power"} >= set(found.binding) - {""} >= {"motor_curve"}


def test_margins_are_those_of_the_limit_itself():
    """Recomputed from torques at inner places of the motion, not from the solver's rows."""
    one = dc(**{"motors.all.braking": "curve"})
    found = time_scale(HILLS, [MotorCurve(), Power(90.0), Speed(2.0)], robot=one)
    t = np.linspace(0.0, found.duration, 4000)[1:-1]
    s, v, sdd = found.along(t)
    samples = found.track.samples(s, found.path.locate(s))
    torque = wheel_torques(samples, one).at(sdd, v**2)
    allowed = STALL - STALL / FREE * np.abs(samples.wheels.spin[:, :2]) * v[:, None]
    share = (allowed - np.abs(torque)).min() / STALL
    assert found.margins()["motor_curve"] == pytest.approx(share, abs=2e-3)
    assert share > -1e-6
    used = motor_power(samples, one).at(sdd, v**2).sum(axis=1) * v
    assert found.margins()["power"] == pytest.approx(1 - used.max() / 90.0, abs=2e-3)


def test_a_slope_that_only_slow_motors_hold():
    """Uphill at 90 % of stall torque the first guess, from torques at rest, leaves no motion."""
    grade = float(np.arcsin(0.9 * 2 * STALL / (RADIUS * M * G)))
    path = uphill(grade, 2.0)
    found = time_scale(path, [MotorCurve(), WheelTorque()], robot=dc())
    top = 0.1 * RADIUS * FREE  # what is left of stall torque at the tenth of the free speed
    assert found.sd.max() == pytest.approx(top, rel=1e-3)
    with pytest.raises(InfeasibleError, match="motor_curve"):
        time_scale(uphill(1.2 * grade, 2.0), [MotorCurve(), Speed(1.0)], robot=dc())


def test_torque_alone_is_a_bound_on_acceleration():
    """Constant torque: bang-bang, T = 2 sqrt(L / a)."""
    one = robot("powerbot", {"motors.all.torque": 15.0})
    rate = 2 * 15.0 / RADIUS / MASS
    found = time_scale(STRAIGHT, [WheelTorque()], robot=one)
    assert found.duration == pytest.approx(2 * np.sqrt(LENGTH / rate), rel=1e-6)


def test_a_faster_robot_brakes_below_the_last_speed_of_its_motors():
    found = time_scale(
        STRAIGHT,
        [MotorCurve(), WheelTorque()],
        robot=dc(),
        start_speed=1.2 * RADIUS * FREE,
        too_fast="brake",
    )
    assert found.duration > 0
    with pytest.raises(InfeasibleError, match="motor_curve"):
        time_scale(STRAIGHT, [MotorCurve()], robot=dc(), start_speed=1.2 * RADIUS * FREE)


def test_what_a_stronger_motor_saves():
    """The sensitivity is the difference that a motor of 1 % more torque at every speed makes."""
    limits = [MotorCurve(), Acceleration(100.0, BRAKES)]
    before = time_scale(STRAIGHT, limits, robot=dc(), gridpoints=1000)
    after = time_scale(STRAIGHT, limits, robot=dc(1.01 * STALL, 1.01 * FREE), gridpoints=1000)
    saved = sensitivities(before)["motor_curve"]
    assert saved == pytest.approx(before.duration - after.duration, rel=0.05)


def test_ranking_counts_the_curve():
    limits = [MotorCurve(), Acceleration(100.0, BRAKES)]
    found = rough_duration(STRAIGHT, limits, robot=dc(), gridpoints=1000)
    exact = time_scale(STRAIGHT, limits, robot=dc(), gridpoints=1000).duration
    # The rough one keeps the curve at gridpoints only, where torque falls with the root of s.
    assert found == pytest.approx(exact, rel=2e-3)


def test_the_bound_of_motors_is_near_and_below():
    """Chords in place of curves: no motion on finer grids is faster than the bound."""
    one = robot("powerbot", {"motors.all.curve": [[0, 22], [2, 22], [4, 11], [8, 5.5], [25, 1]]})
    limits = [WheelTorque(25.0), MotorCurve(), Power(150.0)]
    coarse = time_scale(HILLS, limits, robot=one)
    fine = time_scale(HILLS, limits, robot=one, gridpoints=4000, gap=None)
    assert coarse.gap <= 1e-3
    assert coarse.bound <= fine.duration * (1 + 5e-5)
    assert fine.duration <= coarse.duration * (1 + 5e-5)


@pytest.mark.parametrize("engine", ["linear", "segments", "toppra"])
def test_engines_of_first_order_refuse_them(engine):
    with pytest.raises(ArgumentError, match="engine"):
        time_scale(STRAIGHT, [MotorCurve()], robot=dc(), engine=engine)


# -- energy ----------------------------------------------------------------------------------------


def test_energy_of_speeding_up_and_climbing():
    """m v^2 / 2 with the wheels' spin, and m g h."""
    one, limits = robot("powerbot"), [Acceleration(0.5, 0.5)]
    fast = time_scale(STRAIGHT, [*limits, Speed(1.5)], robot=one, end_speed=1.5)
    assert fast.energy == pytest.approx(MASS * 1.5**2 / 2, rel=1e-9)
    grade = 0.1
    climb = time_scale(uphill(grade), limits, robot=one, start_speed=0.4, end_speed=0.4)
    height = LENGTH * np.sin(grade)
    assert climb.energy == pytest.approx(M * G * height, rel=1e-9)  # it never brakes: 0.98 > 0.5
    down = time_scale(uphill(-grade), limits, robot=one)
    assert down.energy == 0.0
    back = robot("powerbot", {"motors.all.regeneration": 0.7})
    down = time_scale(uphill(-grade), limits, robot=back)
    assert down.energy == pytest.approx(-0.7 * M * G * height, rel=1e-9)


def test_energy_of_stopping_comes_back_as_the_file_says():
    limits = [WheelTorque(20.0), Speed(1.0)]
    for share, expected in ((None, 1.0), (0.4, 0.6), (1.0, 0.0)):
        one = robot("powerbot", {"motors.all.regeneration": share})
        found = time_scale(STRAIGHT, limits, robot=one)
        assert found.energy == pytest.approx(expected * MASS / 2, rel=1e-9, abs=1e-9)


def test_energy_of_turning():
    """A Mecanum robot that turns while it drives: kinetic energy of body, yaw and spin at the end."""
    one = robot("loc8")
    path = Path.through(
        [[0, 0], [1, 0.3], [2, 0]], heading=[0.0, 1.0, 2.5], turning_length=one.turning_length
    )
    found = time_scale(path, [WheelAcceleration(8.0)], robot=one, end_speed=0.3)
    state = found.at(found.duration)
    body, (vx, vy, w) = one.body, state.twist[0]
    spin = 1.44 * 0.098**2 / 4 * np.sum(state.wheel_speeds**2)
    kinetic = body.mass * (vx**2 + vy**2) / 2 + body.yaw_inertia * w**2 / 2 + spin
    plain = one.replace({"motors.all.regeneration": 1.0})
    again = time_scale(path, [WheelAcceleration(8.0)], robot=plain, end_speed=0.3)
    assert again.energy == pytest.approx(kinetic, rel=1e-6)
    assert found.energy > kinetic  # wheels that brake give nothing back
    assert np.all(np.diff(found.energies) >= 0)


def test_energy_is_refused_without_motors():
    found = time_scale(STRAIGHT, [Speed(1.0), Acceleration(1.0, 1.0)])
    with pytest.raises(ArgumentError, match="energy"):
        _ = found.energy
