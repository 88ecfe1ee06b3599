"""Tracking over rough ground: equations 17-20, orderings of Tables IX and X, planned corner speed."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from trajopt.control.asoc_reference import constant_speed, planned_speed, require_pivots, square_corners
from trajopt.control.asoc_tracking import (
    FRICTION,
    STEP,
    Knowledge,
    Tracking,
    body_twist,
    ground_angles,
    track,
    track_many,
    wheel_commands,
)
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.robots.asoc import AsocGeometry, link_velocities, module_jacobian
from trajopt.world.height_map import HeightMap
from trajopt.world.rough import rough_ground

GEOMETRY = AsocGeometry(4)
SEEDS = 10
STUDENT = 2.262  # t, two-sided 95 %, 10 seeds
FIELD = 9.0  # m between the places of two runs


def fields(sigma: float, count: int = SEEDS) -> tuple[HeightMap, np.ndarray]:
    ground = rough_ground(sigma, rng=np.random.default_rng(11), size=FIELD * count)
    places = np.column_stack([FIELD * np.arange(count), np.zeros(count)])
    return replace(ground, origin=(-2.0, -2.0)), places


def run(sigma: float, knowledge: Knowledge, reference) -> list[Tracking]:
    ground, places = fields(sigma)
    return track_many(GEOMETRY, ground, reference, [knowledge] * SEEDS, places)


def level() -> HeightMap:
    return HeightMap(np.zeros((4, 4)), 10.0, (-10.0, -10.0))


def test_commands_and_body_twist_are_inverse_of_each_other() -> None:
    rng = np.random.default_rng(0)
    alpha, tilt = rng.uniform(-3, 3, (5, 4)), rng.uniform(-0.6, 0.6, (5, 4))
    slope, twist = rng.uniform(-0.6, 0.6, (5, 4, 2)), rng.uniform(-1, 1, (5, 3))
    speeds = wheel_commands(GEOMETRY, alpha, twist, tilt, slope)
    np.testing.assert_allclose(body_twist(GEOMETRY, alpha, speeds, tilt, slope), twist, atol=1e-12)
    links = np.einsum("mnij,mnj->mni", module_jacobian(alpha, GEOMETRY.split, GEOMETRY.offset, tilt),
                      speeds * np.cos(slope))  # eq. 20
    np.testing.assert_allclose(links, link_velocities(GEOMETRY.positions, twist), atol=1e-12)


def test_wheels_in_the_air_do_not_move_the_body() -> None:
    rng = np.random.default_rng(1)
    alpha, twist = rng.uniform(-3, 3, (1, 4)), np.array([[0.5, -0.2, 0.4]])
    none, flat = np.zeros((1, 4)), np.zeros((1, 4, 2))
    speeds = wheel_commands(GEOMETRY, alpha, twist, none, flat)
    weight = np.ones((1, 4, 2))
    weight[0, 1] = 0.0
    speeds[0, 1] = 99.0
    found = body_twist(GEOMETRY, alpha, speeds, none, flat, weight, twist)
    np.testing.assert_allclose(found, twist, atol=1e-9)


def test_on_a_plane_tilt_and_inclination_are_the_planes() -> None:
    a = 0.3
    axis = np.arange(-30, 31) * 0.1
    ground = HeightMap(np.tile(a * axis, (61, 1)), 0.1, (-3.0, -3.0))
    across = np.full((1, 4), np.pi / 2)
    tilt, slope, _ = ground_angles(GEOMETRY, ground, np.zeros((1, 3)), across)
    np.testing.assert_allclose(slope, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(tilt), np.arctan(a), atol=1e-12)
    tilt, slope, _ = ground_angles(GEOMETRY, ground, np.zeros((1, 3)), np.zeros((1, 4)))
    np.testing.assert_allclose(slope, np.arctan(a), atol=1e-12)
    np.testing.assert_allclose(tilt, 0.0, atol=1e-12)


def sure_gain(gain: np.ndarray) -> bool:
    """Whether the two-sided 95 % interval of the mean paired difference lies above 0."""
    return bool(gain.mean() > STUDENT * gain.std(ddof=1) / np.sqrt(len(gain)))


def test_flat_ground_and_planned_corners() -> None:
    square = square_corners()
    fast = track(GEOMETRY, level(), constant_speed(square), Knowledge())
    planned = track(GEOMETRY, level(), planned_speed(square), Knowledge())
    assert 0.02 < fast.rms_across < fast.rms < 0.2  # printed 0.0867 m
    assert planned.rms < 0.02
    assert not fast.airborne.any()
    np.testing.assert_allclose(fast.pose, fast.estimate, atol=1e-12)
    assert fast.speed[20:].min() > 0.48 * 1.5  # Figure 30: never below 48 %


@pytest.mark.parametrize("sigma", [0.0, 0.045])
def test_the_body_never_changes_its_velocity_faster_than_friction_allows(sigma) -> None:
    """Wheels that stand in a row or hang in the air could ask for any body speed."""
    for found in run(sigma, Knowledge(), constant_speed(square_corners())):
        rate = np.diff(found.pose, n=2, axis=0) / STEP**2
        turning = np.abs(np.diff(found.pose[:, 2])).max() / STEP * found.speed.max()  # body axes turn with it
        assert np.hypot(rate[:, 0], rate[:, 1]).max() < FRICTION * 9.80665 + turning + 1e-6
        assert np.abs(rate[:, 2]).max() < 2 * FRICTION * 9.80665 / GEOMETRY.module_radius + 1e-6


def test_error_grows_with_roughness() -> None:
    """Table IX, field by field: the fields differ in roughness alone."""
    for make, sigmas in ((constant_speed, (0.0, 0.015, 0.03, 0.045)), (planned_speed, (0.015, 0.03, 0.045))):
        reference = make(square_corners())
        rms = [np.array([r.rms for r in run(sigma, Knowledge(), reference)]) for sigma in sigmas]
        for smooth, rough in pairwise(rms):
            assert sure_gain(rough - smooth)


@pytest.mark.parametrize("make", [constant_speed, planned_speed])
def test_knowledge_lowers_the_error(make) -> None:
    """Table X's comparisons, field by field.

    At constant speed the robot slides outwards at every corner by more than terrain knowledge is worth, and
    one that ignores the terrain drives short, which makes up for it: there only the absolute position shows.
    """
    reference = make(square_corners())
    rms = {(terrain, period): np.array([r.rms for r in run(0.03, Knowledge(terrain, period), reference)])
           for terrain in (True, False) for period in (2.0, np.inf)}
    pairs = [((True, 2.0), (True, np.inf)), ((False, 2.0), (False, np.inf))]
    if make is planned_speed:
        pairs += [((True, 2.0), (False, 2.0)), ((True, np.inf), (False, np.inf))]
    for knowing, ignorant in pairs:
        assert sure_gain(rms[ignorant] - rms[knowing]), (knowing, ignorant)


def test_dead_reckoning_is_exact_where_wheels_neither_creep_nor_slide_and_runs_repeat() -> None:
    planned, reference = planned_speed(square_corners()), constant_speed(square_corners())
    blind = track(GEOMETRY, level(), planned, Knowledge(update_period=np.inf))
    np.testing.assert_allclose(blind.pose, blind.estimate, atol=1e-9)
    sliding = track(GEOMETRY, level(), reference, Knowledge(update_period=np.inf))
    assert np.abs(sliding.pose - sliding.estimate).max() > 0.05  # corners at 1.5 m/s ask for more than friction has
    ground, _ = fields(0.03, 1)
    first, again = (track(GEOMETRY, ground, reference, Knowledge(False, 2.0)) for _ in range(2))
    assert np.array_equal(first.pose, again.pose)


def test_robots_in_one_batch_do_not_touch_each_other() -> None:
    ground, places = fields(0.03, 3)
    reference = constant_speed(square_corners(1.5))
    together = track_many(GEOMETRY, ground, reference, [Knowledge()] * 3, places)
    alone = track_many(GEOMETRY, ground, reference, [Knowledge()], places[1:2])[0]
    np.testing.assert_allclose(together[1].pose, alone.pose, atol=1e-9)


def test_ground_steeper_than_the_pivots_is_reported_with_place_and_angle() -> None:
    reference = constant_speed(square_corners())
    short = AsocGeometry(4, split=0.2, offset=0.02, wheel_radius=0.15)  # pivots to 33.9 deg
    heights = np.zeros((60, 60))
    heights[:, 50:] = 0.4
    ground = HeightMap(heights, 0.1, (-1.0, -1.0))
    with pytest.raises(InfeasibleError, match=r"must tilt .* deg, the pivots allow 33.9 deg") as caught:
        require_pivots(short, ground, reference)
    assert caught.value.limit == "pivot"
    assert 4.5 <= caught.value.place < 9.0  # on the second side the axles lie across the edge
    assert require_pivots(short, level(), reference) == 0.0


@pytest.mark.parametrize("call", [
    lambda: constant_speed([[0, 0]]), lambda: constant_speed([[0, 0], [0, 0]]),
    lambda: constant_speed(square_corners(), -1.0), lambda: Knowledge(update_period=-1.0),
    lambda: track(GEOMETRY, level(), constant_speed(square_corners()), Knowledge(), step=0.0),
    lambda: track(GEOMETRY, level(), constant_speed(square_corners()), Knowledge(), friction=np.nan),
    lambda: track_many(GEOMETRY, level(), constant_speed(square_corners()), [Knowledge()], np.zeros((2, 2)))])
def test_bad_input_is_refused(call) -> None:
    with pytest.raises(ArgumentError):
        call()
