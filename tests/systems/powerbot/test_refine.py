"""Jerk-limited motions, following a profile."""

from __future__ import annotations

import math
from pathlib import Path as FilePath

import casadi as ca
import numpy as np
import pytest

from trajopt.errors import ArgumentError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.speed_bound import SpeedProfile
from trajopt.limits.tip import Tip
from trajopt.paths.path import Path
from trajopt.refine.jerk import limit_jerk
from trajopt.refine.profile import follow
from trajopt.report.motion import table_times
from trajopt.robots.robot import robot as shipped
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory
from trajopt.world.ramp import Ramp, lay_over

LIMITS = (Speed(1.0), Acceleration(0.5, 0.5))


@pytest.fixture(scope="module")
def straight() -> Trajectory:
    return time_scale(Path.through([[0, 0], [5, 0]]), LIMITS)


def test_jerk_limit_reaches_the_closed_form(straight: Trajectory) -> None:
    """Trapezoid with rounded corners: every change of speed takes v/a + a/j."""
    motion = limit_jerk(straight, 1.0)
    assert motion.duration == pytest.approx(5.0 / 1.0 + 1.0 / 0.5 + 0.5 / 1.0, rel=1e-3)
    assert np.abs(motion.jerk).max() <= 1.0 + 1e-6
    assert min(motion.margins().values()) >= -1e-9
    s, v, a = motion.along(np.array([0.0, motion.duration]))
    assert s == pytest.approx([0.0, 5.0], abs=1e-6)
    assert np.abs([*v, *a]).max() < 1e-6


def closed_form(length: float, v: float, a: float, jerk: float) -> float:
    """Seconds from rest to rest on a straight line: seven, five or four pieces of constant jerk."""
    ramp = v / a + a / jerk if a * a <= v * jerk else 2 * math.sqrt(v / jerk)
    if v * ramp <= length:
        return 2 * ramp + (length - v * ramp) / v
    peak = a * (math.sqrt((a / jerk) ** 2 + 4 * length / a) - a / jerk) / 2
    if peak >= a * a / jerk:
        return 2 * (peak / a + a / jerk)
    return float((32 * length / jerk) ** (1 / 3))


@pytest.mark.parametrize(
    ("length", "jerk"),
    [
        (5.0, 1e-6),
        (5.0, 1e-3),
        (5.0, 10.0),
        (5.0, 1e3),
        (1e-5, 1e-6),
        (1e-5, 1e3),
        (1e-3, 1e3),
        (100.0, 1.0),
        (1e4, 1e-6),
        (1e4, 1e-3),
        (1e4, 1.0),
        (1e4, 1e3),
    ],
)
def test_jerk_limit_is_the_closed_form_at_every_size(length: float, jerk: float) -> None:
    """From 10 um to 10 km and over nine powers of ten of jerk."""
    fastest = time_scale(Path.through([[0, 0], [length, 0]]), (Speed(1.0), Acceleration(1.0, 1.0)))
    motion = limit_jerk(fastest, jerk)
    assert motion.duration == pytest.approx(closed_form(length, 1.0, 1.0, jerk), rel=1e-3)
    assert np.abs(motion.jerk).max() <= jerk * (1 + 1e-6)
    assert min(motion.margins().values()) >= -1e-9


def test_a_jerk_limited_motion_is_a_whole_trajectory(tmp_path: FilePath) -> None:
    """States are derivatives of each other and end where the path does; tables and pictures take
    it."""
    path = Path.through([[0, 0], [2, 0.5], [4, -0.3]], start_direction=[1, 0], end_direction=[1, 0])
    fast = time_scale(path, [Speed(1.5), Acceleration(0.55, 0.8)], robot=shipped("powerbot"))
    motion = limit_jerk(fast, 2.0)
    h = 1e-4
    t = np.linspace(0.1, motion.duration - 0.1, 50)
    before, here, after = (motion.at(t + k * h) for k in (-1, 0, 1))
    rate = (after.pose - before.pose) / (2 * h)
    np.testing.assert_allclose(np.hypot(rate[:, 0], rate[:, 1]), here.twist[:, 0], atol=1e-5)
    np.testing.assert_allclose(rate[:, 2], here.twist[:, 2], atol=1e-5)
    _, v, a = motion.along(t)
    ahead, behind = motion.along(t + h), motion.along(t - h)
    np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * h), v, atol=1e-6)
    np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * h), a, atol=1e-3)
    assert np.abs(motion.jerks(t)).max() <= 2.0 * (1 + 1e-6)
    end = motion.at(motion.duration)
    np.testing.assert_allclose(end.pose[0, :2], [4, -0.3], atol=1e-7)
    np.testing.assert_allclose(
        end.wheel_angles, fast.at(fast.duration).wheel_angles, rtol=0, atol=1e-6
    )
    frame = motion.to_frame()
    assert len(frame) == len(table_times(motion))
    assert motion.energies[0] == 0
    assert np.isfinite(motion.energy)
    assert set(motion.binding) <= {"", "speed", "acceleration"}
    motion.plot().savefig(tmp_path / "motion.png")


def test_jerk_limit_on_a_bend_keeps_slip(straight: Trajectory) -> None:
    path = Path.through([[0, 0], [2, 0.5], [4, -0.3]], start_direction=[1, 0], end_direction=[1, 0])
    fast = time_scale(
        path,
        [Speed(1.5), Acceleration(0.55, 7.8), Slip(0.332, rule="load")],
        robot=shipped("powerbot"),
    )
    durations = [limit_jerk(fast, jerk).duration for jerk in (0.5, 2.0, 8.0)]
    assert durations[0] > durations[1] > durations[2] > fast.duration
    with pytest.raises(ArgumentError, match="jerk"):
        limit_jerk(straight, -1.0)


def test_jerk_limit_over_a_ramp_keeps_every_row() -> None:
    """Slip rows jump at the ramp's rounded edges; rows left out of the program are checked like the
    others."""
    path = Path.through([[0, 0], [4, 0.3], [8, 0]], start_direction=[1, 0], end_direction=[1, 0])
    limits = [Speed(2.1), Acceleration(0.55, 7.8), Slip(0.332, rule="load"), Tip()]
    fast = time_scale(
        lay_over(path, [Ramp((2.0, 0.0), 0.0, 4.266, 0.45, 0.35)]),
        limits,
        robot=shipped("powerbot"),
    )
    motion = limit_jerk(fast, 2.0, nodes=80)
    assert set(motion.margins()) == {"speed", "acceleration", "slip", "tip"}
    assert min(motion.margins().values()) >= -1e-9
    assert motion.slowdown < 1.01
    assert fast.duration < motion.duration < 1.15 * fast.duration
    steps = np.diff(motion.times)
    for values, rates, then in (
        (motion.a, motion.jerk, 0.0),
        (motion.v, motion.a[:-1], motion.jerk * steps / 2),
    ):
        np.testing.assert_allclose(np.diff(values), steps * (rates + then), atol=1e-6)


def test_following_what_is_feasible_is_exact() -> None:
    path = Path.through([[0, 0], [6, 0]])
    places = np.linspace(0, 6, 61)
    profile = SpeedProfile(tuple(places), tuple(0.5 + 0.1 * np.sin(places)))
    for manner in ("below", "least_squares"):
        found = follow(
            path,
            profile,
            LIMITS,
            start_speed=0.5,
            end_speed=float(profile.speeds[-1]),
            manner=manner,
        )
        assert found.largest_error < 2e-3
        assert min(found.trajectory.margins().values()) >= -1e-9


def test_least_squares_is_closer_than_below() -> None:
    path = Path.through([[0, 0], [6, 0]])
    profile = SpeedProfile((0.0, 2.99, 3.01, 6.0), (0.9, 0.9, 0.4, 0.4))
    errors = {}
    for manner in ("below", "least_squares"):
        found = follow(path, profile, (Speed(1.0), Acceleration(0.3, 0.3)), manner=manner)
        errors[manner] = np.trapezoid(
            (found.trajectory.sd**2 - found.wanted**2) ** 2, found.trajectory.s
        )
    assert errors["least_squares"] < errors["below"]
    assert math.isfinite(errors["below"])


def test_programs_do_not_depend_on_casadis_global_numpy_switch() -> None:
    """Users may switch CasADi's NumPy mode on for their own models: ours must read and leave it as
    it was."""
    path = Path.through([[0, 0], [6, 0]])
    profile = SpeedProfile((0.0, 6.0), (0.9, 0.4))
    limits = (Speed(1.0), Acceleration(0.3, 0.3))
    before = ca.GlobalOptions.getNumpyMode()
    found = []
    try:
        for mode in (0, 1):
            ca.GlobalOptions.setNumpyMode(mode)
            found.append(follow(path, profile, limits, manner="least_squares").trajectory.sd)
            assert ca.GlobalOptions.getNumpyMode() == mode
    finally:
        ca.GlobalOptions.setNumpyMode(before)
    np.testing.assert_array_equal(found[0], found[1])
