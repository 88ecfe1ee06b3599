"""Limits that change along the path, over the ground or from wheel to wheel, looked at everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from limits.slopes import CURVE, GENTLE
from world.shapes import HILLS, height_map

from trajopt.limits.acceleration import Acceleration
from trajopt.limits.friction import FrictionAlong, FrictionMap
from trajopt.limits.limit import Limit, spins
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.speed_bound import SpeedProfile, SpeedZones
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.paths.path import Path
from trajopt.robots.robot import robot
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory

KEPT = 1.001  # of a limit
LOW = height_map(0.35 * HILLS.heights)  # 5 deg steep at most
DRIVE = (Speed(1.5), Acceleration(1.0, 1.0))
PATCH = np.full((45, 60), 0.8)
PATCH[15:28, 25:32] = 0.25
ICE = FrictionAlong((1.0, 1.0 + 1e-6, 1.7, 1.7 + 1e-6), (0.8, 0.25, 0.25, 0.8))


def motion(name: str, ground: bool, *limits: Limit) -> Trajectory:
    one = robot(name)
    free = one.drivable.shape[1] == 3
    path = Path.through(
        CURVE if free or name == "powerbot" else GENTLE,
        heading=[0.2, 1.0, 0.1, -0.7] if free else None,
        turning_length=0.5,
    )
    return time_scale(
        path, [*DRIVE, *limits], robot=one, ground=LOW if ground else None, gridpoints=200
    )


def everywhere(found: Trajectory, count: int = 4001) -> tuple[np.ndarray, ...]:
    """Times, path parameters, speeds and accelerations, also between gridpoints."""
    t = np.linspace(0.0, found.duration, count)
    return t, *found.along(t)


@pytest.mark.parametrize("ground", [False, True], ids=["level", "hills"])
@pytest.mark.parametrize("name", ["powerbot", "loc8", "swerve", "asoc-4"])
@pytest.mark.parametrize("kind", ["along", "map"])
def test_slippery_places_bind_and_are_kept_everywhere(name, ground, kind):
    """Friction falls from 0.8 to 0.25 within 1e-6 m along the path, or within a cell of a map."""
    friction = ICE if kind == "along" else FrictionMap(PATCH, 0.1, (-1.0, -2.2))
    slip = Slip(friction, rule="least_norm")
    found, good = motion(name, ground, slip), motion(name, ground, Slip(0.8, rule="least_norm"))
    assert found.duration > good.duration * 1.0005
    _, s, speed, sdd = everywhere(found)
    samples = found.track.samples(s, found.path.locate(s))
    needed = slip.needed(samples, found.robot, sdd, speed**2)
    assert 0.99 < needed.max() < KEPT
    assert any(stretch.limit == "slip" for stretch in found.active)


@pytest.mark.parametrize("name", ["powerbot", "loc8", "car"])
def test_zones_and_profiles_of_speed_hold_to_their_edges(name):
    """Path parameters are arc lengths in space."""
    zones = ((0.5, 0.9, 0.6), (0.8, 1.2, 0.3), (2.0, 2.0 + 1e-4, 0.2))
    found = motion(name, True, SpeedZones(zones))
    _, s, speed, _ = everywhere(found, 40001)
    for start, end, largest in zones:
        inside = (s >= start) & (s <= end)
        assert inside.any()
        assert speed[inside].max() == pytest.approx(largest, rel=1e-3)
    assert speed.max() > 0.8
    places, speeds = (0.5, 0.7, 0.7 + 1e-6, 2.0), (1.4, 1.2, 0.4, 0.6)
    found = motion(name, True, SpeedProfile(places, speeds))
    _, s, speed, _ = everywhere(found, 40001)
    share = speed / np.interp(s, places, speeds)
    assert 0.999 < share.max() < KEPT
    assert any(stretch.limit == "speed_profile" for stretch in found.active)


@pytest.mark.parametrize("name", ["loc8", "swerve", "asoc-4", "powerbot"])
def test_each_wheel_keeps_a_number_of_its_own(name):
    """Tight for one wheel at a time: only this one binds, and more time is needed than without."""
    count = len(robot(name).wheels)
    loose = [60.0] * count
    free = motion(name, True, WheelSpeed(loose), WheelAcceleration(loose))
    for i in (0, count - 1):
        own, gain = list(loose), list(loose)
        own[i], gain[i] = 3.0, 2.5
        found = motion(name, True, WheelSpeed(own), WheelAcceleration(gain))
        assert found.duration > free.duration * 1.01
        t, s, speed, _ = everywhere(found)
        spin, _ = spins(found.track.samples(s, found.path.locate(s)), robot(name))
        rates = spin * speed[:, None]
        assert 2.9 < np.abs(rates[:, i]).max() < 3.0 * KEPT
        assert np.abs(np.diff(rates[:, i]) / np.diff(t)).max() < 2.5 * KEPT
        assert np.abs(np.delete(rates, i, axis=1)).max() > 3.0


def test_friction_of_each_wheel():
    """The slippery wheel alone decides, whichever it is."""
    one = robot("loc8")
    times = []
    for i in range(4):
        friction = [0.9] * 4
        friction[i] = 0.3
        slip = Slip(friction, rule="least_norm")
        found = motion("loc8", True, slip)
        _, s, speed, sdd = everywhere(found)
        samples = found.track.samples(s, found.path.locate(s))
        assert slip.needed(samples, one, sdd, speed**2).max() < KEPT
        times.append(found.duration)
    assert min(times) > motion("loc8", True, Slip(0.9)).duration * 1.001
    assert max(times) <= motion("loc8", True, Slip(0.3)).duration * KEPT
    assert len({round(t, 4) for t in times}) > 1
