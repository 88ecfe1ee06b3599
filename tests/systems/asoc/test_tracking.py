"""Tracking over rough ground: equations 17-20, orderings of Tables IX and X, planned corner
speed."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from benchmarks.theses.asoc_study import constant_speed, require_pivots, square_corners
from benchmarks.theses.asoc_tables_tracking import (
    FAST,
    FULL,
    KNOWLEDGE,
    NO_SLIP,
    PAIRS,
    PLANNED,
    STUDENT,
    Command,
    places,
)
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.systems.asoc.grip import SLIP_STIFFNESS, wheel_lag
from trajopt.systems.asoc.modules import AsocGeometry, link_velocities, module_jacobian
from trajopt.systems.asoc.reference import planned_speed
from trajopt.systems.asoc.tracking import (
    FRICTION,
    POSITION_GAIN,
    STEP,
    Knowledge,
    Tracking,
    body_twist,
    ground_angles,
    track,
    track_many,
    wheel_commands,
)
from trajopt.world.height_map import HeightMap

GEOMETRY = AsocGeometry(4)
FIELDS = FULL.fields
COARSE = 0.02  # s, twice the default step: tests over many fields compare, they do not measure


def errors(sigma: float, knowledge: Knowledge, command: Command) -> np.ndarray:
    """(FIELDS,): RMS error field by field; the fields differ in roughness alone."""
    ground, origins = places(sigma, FIELDS)
    found = track_many(
        GEOMETRY,
        ground,
        command.reference,
        [knowledge] * FIELDS,
        origins,
        friction=command.friction,
        step=COARSE,
    )
    return np.array([r.rms for r in found])


def level() -> HeightMap:
    return HeightMap(np.zeros((4, 4)), 10.0, (-10.0, -10.0))


def test_commands_and_body_twist_are_inverse_of_each_other() -> None:
    rng = np.random.default_rng(0)
    alpha, tilt = rng.uniform(-3, 3, (5, 4)), rng.uniform(-0.6, 0.6, (5, 4))
    slope, twist = rng.uniform(-0.6, 0.6, (5, 4, 2)), rng.uniform(-1, 1, (5, 3))
    speeds = wheel_commands(GEOMETRY, alpha, twist, tilt, slope)
    np.testing.assert_allclose(body_twist(GEOMETRY, alpha, speeds, tilt, slope), twist, atol=1e-12)
    links = np.einsum(
        "mnij,mnj->mni",
        module_jacobian(alpha, GEOMETRY.split, GEOMETRY.offset, tilt),
        speeds * np.cos(slope),
    )  # eq. 20
    np.testing.assert_allclose(links, link_velocities(GEOMETRY.positions, twist), atol=1e-12)


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
    return bool(gain.mean() > STUDENT[len(gain)] * gain.std(ddof=1) / np.sqrt(len(gain)))


@pytest.fixture(scope="module")
def fast() -> Tracking:
    """The square on level ground at 1.5 m/s, all known."""
    return track(GEOMETRY, level(), constant_speed(square_corners()), Knowledge())


def test_flat_ground_and_planned_corners(fast) -> None:
    planned = track(GEOMETRY, level(), planned_speed(square_corners()), Knowledge(), step=COARSE)
    assert 0.1 < fast.rms_across < fast.rms < 0.25  # printed 0.0867 m; engines 0.188 and 0.247 m
    assert planned.rms < 0.02
    assert not fast.airborne.any()
    assert fast.speed[40:].min() > 0.48 * 1.5  # Figure 30: never below 48 %
    rate = np.linalg.norm(np.diff(fast.pose[:, :2], n=2, axis=0), axis=1) / STEP**2
    assert rate.max() < 1.02 * FRICTION * 9.80665


def test_a_sliding_corner_is_that_of_a_point_mass_with_friction_over_the_square_root_of_two(
    fast,
) -> None:
    """Why the level error is what it is: from one side to the next the robot gets mu g/sqrt(2)
    (test_grip). A point that accelerates as fast towards the commanded velocity, position feedback
    included, has nearly its error."""
    reference, most = constant_speed(square_corners()), FRICTION * 9.80665 / np.sqrt(2)
    place, speed, squares, step = np.zeros(2), np.zeros(2), [], 1e-3
    for moment in np.arange(0.0, reference.duration, step):
        due, velocity = reference.at(float(moment))
        squares.append(np.sum((due - place) ** 2))
        change = velocity + POSITION_GAIN * (due - place) - speed
        speed = speed + change * min(1.0, most * step / max(float(np.linalg.norm(change)), 1e-12))
        place = place + step * speed
    assert fast.rms == pytest.approx(
        np.sqrt(np.mean(squares)), rel=0.08
    )  # it starts at mu g along its heading


def test_without_slip_a_straight_line_is_caught_up_as_the_lag_says() -> None:
    """e'' + e'/lag + gain e/lag = 0 for the distance e to the point due; rubber adds v/(g
    stiffness) to the lag."""
    reference = constant_speed([[0.0, 0.0], [4.5, 0.0]])
    found = track(GEOMETRY, level(), reference, Knowledge(), friction=np.inf, step=0.005)
    late = (found.wanted - found.pose[:, :2])[:, 0]
    lag = wheel_lag(GEOMETRY) + 1.5 / (9.80665 * SLIP_STIFFNESS)
    slow = (1 - np.sqrt(1 - 4 * lag * POSITION_GAIN)) / (2 * lag)
    first, last = 60, 360  # 0.3 and 1.8 s
    assert np.log(late[first] / late[last]) == pytest.approx(
        slow * (last - first) * 0.005, rel=0.02
    )
    assert late.max() < 0.05
    assert found.rms_across < 1e-12


def test_large_friction_is_no_slip() -> None:
    ground, _ = places(0.03, 1)
    reference = constant_speed(square_corners(1.0))
    free, high, real = (
        track(GEOMETRY, ground, reference, Knowledge(False, 2.0), friction=friction, step=COARSE)
        for friction in (np.inf, 500.0, 0.6)
    )
    np.testing.assert_allclose(free.pose, high.pose, atol=1e-9)
    assert np.abs(free.pose - real.pose).max() > 0.05


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "sigmas"),
    [
        (FAST, (0.0, 0.015, 0.03, 0.045)),
        (NO_SLIP, (0.015, 0.03, 0.045)),
        (PLANNED, (0.015, 0.03, 0.045)),
    ],
)
def test_error_grows_with_roughness(command, sigmas) -> None:
    """Table IX, field by field. What bumps of 1.5 cm cost a robot that does not slide is too little
    to test."""
    rms = [errors(sigma, Knowledge(), command) for sigma in sigmas]
    for smooth, rough in pairwise(rms):
        assert sure_gain(rough - smooth)


@pytest.mark.slow
@pytest.mark.parametrize("command", [FAST, NO_SLIP, PLANNED])
def test_knowledge_lowers_the_error(command) -> None:
    """Table X's comparisons, field by field.

    At constant speed and finite friction the robot slides outwards at every corner by more than
    terrain knowledge is worth: there only the absolute position shows.
    """
    rms = {case: errors(0.03, knowledge, command) for case, knowledge in KNOWLEDGE.items()}
    for name, knowing, ignorant in PAIRS:
        if command is not FAST or name.startswith("position"):
            assert sure_gain(rms[ignorant] - rms[knowing]), name


def test_odometry_is_right_where_wheels_hardly_creep_and_do_not_slide_and_runs_repeat() -> None:
    planned, reference = planned_speed(square_corners(1.5)), constant_speed(square_corners(1.5))
    blind = track(GEOMETRY, level(), planned, Knowledge(update_period=np.inf), step=COARSE)
    assert np.abs(blind.pose - blind.estimate).max() < 0.02
    sliding = track(GEOMETRY, level(), reference, Knowledge(update_period=np.inf), step=COARSE)
    assert (
        np.abs(sliding.pose - sliding.estimate).max() > 0.05
    )  # corners at 1.5 m/s ask for more than friction has
    ground, _ = places(0.03, 1)
    first, again = (
        track(GEOMETRY, ground, reference, Knowledge(False, 2.0), step=COARSE) for _ in range(2)
    )
    assert np.array_equal(first.pose, again.pose)


def test_robots_in_one_batch_do_not_touch_each_other() -> None:
    ground, origins = places(0.03, 3)
    reference = constant_speed(square_corners(1.5))
    together = track_many(GEOMETRY, ground, reference, [Knowledge()] * 3, origins, step=COARSE)
    alone = track_many(GEOMETRY, ground, reference, [Knowledge()], origins[1:2], step=COARSE)[0]
    np.testing.assert_allclose(together[1].pose, alone.pose, atol=1e-9)


def test_ground_steeper_than_the_pivots_is_reported_with_place_and_angle() -> None:
    reference = constant_speed(square_corners())
    short = AsocGeometry(4, split=0.2, offset=0.02, wheel_radius=0.15)  # pivots to 33.9 deg
    heights = np.zeros((60, 60))
    heights[:, 50:] = 0.4
    ground = HeightMap(heights, 0.1, (-1.0, -1.0))
    with pytest.raises(
        InfeasibleError, match=r"must tilt .* deg, the pivots allow 33.9 deg"
    ) as caught:
        require_pivots(short, ground, reference)
    assert caught.value.limit == "pivot"
    assert 4.5 <= caught.value.place < 9.0  # on the second side the axles lie across the edge
    assert require_pivots(short, level(), reference) == 0.0


@pytest.mark.parametrize(
    "call",
    [
        lambda: constant_speed([[0, 0]]),
        lambda: constant_speed([[0, 0], [0, 0]]),
        lambda: constant_speed(square_corners(), -1.0),
        lambda: Knowledge(update_period=-1.0),
        lambda: track(GEOMETRY, level(), constant_speed(square_corners()), Knowledge(), step=0.0),
        lambda: track(
            GEOMETRY, level(), constant_speed(square_corners()), Knowledge(), step=np.inf
        ),
        lambda: track(
            GEOMETRY, level(), constant_speed(square_corners()), Knowledge(), friction=np.nan
        ),
        lambda: track(
            GEOMETRY, level(), constant_speed(square_corners()), Knowledge(), friction=0.0
        ),
        lambda: track(
            GEOMETRY, level(), constant_speed(square_corners()), Knowledge(), friction=-np.inf
        ),
        lambda: track_many(
            GEOMETRY, level(), constant_speed(square_corners()), [Knowledge()], np.zeros((2, 2))
        ),
    ],
)
def test_bad_input_is_refused(call) -> None:
    with pytest.raises(ArgumentError):
        call()
