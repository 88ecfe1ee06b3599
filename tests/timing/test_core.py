"""Time scaling's core: never beyond a limit, never far above the least time, and a bound that is
one."""

from __future__ import annotations

import numpy as np
import pytest
from graded import ball_robot, worst
from scaling_cases import limit

from trajopt.errors import TrajoptError
from trajopt.limits.registry import LIMITS
from trajopt.paths.path import Path
from trajopt.robots.robot import robot as shipped
from trajopt.timing.cells import Measure, Readable, cells_of
from trajopt.timing.grid import graded_grid
from trajopt.timing.planar import planar_of
from trajopt.timing.scaling import time_scale
from trajopt.timing.track import track

BROKEN = 5e-5
BALLS = ball_robot()
NAMES = ("speed", "acceleration", "yaw_rate", "wheel_speed", "wheel_acceleration", "slip", "tip")


def lane(apart: float) -> list[list[float]]:
    return [[0, 0], [1, 0], [2, apart], [1, 2 * apart], [0, 2 * apart]]


def holds(result, names=NAMES) -> None:
    for one in result.limits:
        if one.name in names:
            assert worst(result, one) <= 1 + BROKEN, one


@pytest.mark.parametrize(
    ("points", "limits"),
    [
        (
            lane(0.01),
            {"wheel_speed": {"largest": 12.0}, "wheel_acceleration": {"largest": 12.0}},
        ),
        (
            lane(1e-4),
            {"wheel_speed": {"largest": 12.0}, "wheel_acceleration": {"largest": 12.0}},
        ),
        (
            lane(1e-5),
            {"wheel_speed": {"largest": 12.0}, "wheel_acceleration": {"largest": 12.0}},
        ),
        (
            [[0, 0], [1, 0], [0, 1e-3]],
            {
                "speed": {"largest": 1.0},
                "acceleration": {"forward": 1.0, "braking": 1.0},
                "wheel_speed": {"largest": 10.0},
            },
        ),
        (
            [[0, 0], [1, 0], [0, 0.01]],
            {
                "speed": {"largest": 1.0},
                "acceleration": {"forward": 1.0, "braking": 1.0},
                "yaw_rate": {"largest": 1.0},
                "slip": {"friction": 0.5},
            },
        ),
        (
            [[0, 0], [1, 0], [0.1, 1e-3]],
            {
                "speed": {"largest": 1.0},
                "acceleration": {"forward": 1.0, "braking": 1.0},
                "yaw_rate": {"largest": 1.0},
            },
        ),
        (
            [[i / 2, i % 2] for i in range(21)],
            {"speed": {"largest": 1.0}, "slip": {"friction": 0.5}},
        ),
    ],
)
def test_near_cusps_keep_their_limits_and_are_near_the_least_time(points, limits):
    result = time_scale(
        Path.through(points), [limit(n, **v) for n, v in limits.items()], robot=BALLS
    )
    assert result.gap <= 1e-3
    assert min(result.margins().values()) >= -1e-9
    holds(result)


def test_lanes_as_close_as_numbers_can_tell():
    """The yaw of 1e-8 m is known to 1e-7 rad, too little for differences in time."""
    limits = [limit("wheel_speed", largest=12.0), limit("wheel_acceleration", largest=12.0)]
    result = time_scale(Path.through(lane(1e-8)), limits, robot=BALLS)
    wide = time_scale(Path.through(lane(1e-5)), limits, robot=BALLS)
    assert result.gap <= 1e-3
    assert result.duration == pytest.approx(wide.duration, rel=2e-3)
    assert min(result.margins().values()) >= -1e-9


def test_a_lane_on_powerbot_takes_what_many_points_take():
    """5.97 s is the optimum; uniform grids gave 19.9 s with a broken limit."""
    limits = [limit("wheel_speed", largest=12.0), limit("wheel_acceleration", largest=12.0)]
    result = time_scale(Path.through(lane(0.01)), limits, robot=shipped("powerbot"))
    assert result.duration == pytest.approx(5.969, abs=2e-3)


def test_gridpoints_may_be_many_on_a_sharp_bend():
    limits = [limit("speed", largest=1.0), limit("acceleration"), limit("yaw_rate")]
    result = time_scale(Path.through([[0, 0], [1, 0], [0.1, 1e-3]]), limits, gridpoints=2000)
    assert len(result.s) >= 2000


def test_a_turn_on_the_spot_takes_its_closed_form():
    path = Path.through([[0, 0], [0, 0]], heading=[0, 3.14], turning_length=0.49)
    limits = [limit("yaw_rate", largest=1.0), limit("wheel_acceleration", largest=1e4)]
    result = time_scale(path, limits, robot=shipped("loc8"))
    assert result.duration == pytest.approx(3.14, rel=2e-3)
    np.testing.assert_allclose(result.at(result.duration).pose[0], [0, 0, 3.14], atol=1e-12)


def test_slow_motions_end():
    path = Path.through([[0, 0], [1.5, 0.5], [3, 0]])
    limits = [limit("speed"), limit("acceleration", forward=1e-6, braking=1e-6)]
    result = time_scale(path, limits, robot=BALLS)
    assert result.duration == pytest.approx(2 * np.sqrt(path.length / 1e-6), rel=1e-3)


def test_too_many_turns_are_refused_by_name():
    path = Path.through([[0, 0], [1, 0], [1.0000001, 0], [2, 0]], heading=[0, 0, 2, 2])
    with pytest.raises(TrajoptError, match="turned"):
        time_scale(path, [limit("speed"), limit("wheel_acceleration")], robot=shipped("loc8"))


@pytest.mark.parametrize("wrong", [0.0, -1.0, float("nan"), "small"])
def test_a_gap_is_a_share(wrong):
    with pytest.raises(TrajoptError, match="gap"):
        time_scale(Path.through(lane(0.3)), [limit("speed"), limit("acceleration")], gap=wrong)


def random_case(rng: np.random.Generator):
    """Wandering, looping, needle-like and noisy paths of many sizes, and limits of all kinds."""
    count = int(rng.choice([2, 3, 4, 6, 10, 20, 60], p=[0.05, 0.2, 0.2, 0.25, 0.15, 0.1, 0.05]))
    size = 10 ** rng.uniform(-2, 2)
    kind = rng.random()
    if kind < 0.5:
        points = rng.normal(0, 1, (count, 2))
    elif kind < 0.7:
        points = np.cumsum(rng.normal(0, 1, (count, 2)) + np.array([0.8, 0]), axis=0)
    elif kind < 0.85:
        points = np.array(lane(10 ** rng.uniform(-5, -0.5)))
    else:
        points = np.column_stack([np.arange(count), 1e-2 * rng.normal(0, 1, count)])
    points = points * size + rng.choice([0.0, 1e3]) * (kind < 0.7)
    largest = 10 ** rng.uniform(-0.7, 0.7, 8)
    choices = {
        "speed": {"largest": largest[0]},
        "acceleration": {"forward": largest[1], "braking": largest[2]},
        "yaw_rate": {"largest": largest[3]},
        "wheel_speed": {"largest": 10 * largest[4]},
        "wheel_acceleration": {"largest": 10 * largest[5]},
        "slip": {"friction": 0.2 * largest[6]},
        "tip": {},
    }
    names = [n for n in choices if rng.random() < 0.5] + ["wheel_speed", "wheel_acceleration"]
    return points, [limit(n, **choices[n]) for n in dict.fromkeys(names)]


def run_cases(seeds: range) -> tuple[int, int]:
    """How many were timed, and how many of them within the gap."""
    timed = near = 0
    for seed in seeds:
        points, limits = random_case(np.random.default_rng(seed))
        try:
            result = time_scale(Path.through(points), limits, robot=BALLS)
        except TrajoptError:
            continue
        timed += 1
        near += result.gap <= 1e-3
        assert min(result.margins().values()) >= -1e-9, seed
        for one in limits:
            assert worst(result, one) <= 1 + BROKEN, (seed, one)
    return timed, near


def test_random_motions_keep_all_limits_wherever_they_are_sampled():
    timed, near = run_cases(range(60))
    assert timed >= 50
    assert near >= 0.97 * timed


@pytest.mark.slow
def test_ten_thousand_random_motions_keep_all_limits():
    timed, near = run_cases(range(1000, 11_000))
    assert timed >= 9_000
    assert near >= 0.99 * timed


@pytest.mark.parametrize("seed", range(12))
def test_the_bound_is_below_the_time_on_many_points(seed):
    points, limits = random_case(np.random.default_rng(300 + seed))
    coarse = time_scale(Path.through(points), limits, robot=BALLS)
    fine = time_scale(Path.through(points), limits, robot=BALLS, gridpoints=20_000, gap=None)
    assert coarse.bound <= coarse.duration
    assert coarse.bound <= fine.duration * (1 + 5e-5)
    assert coarse.duration <= fine.duration * (1 + 1.5e-3)


@pytest.mark.parametrize("name", ["loc8", "powerbot", "balls"])
def test_compiled_rows_are_those_of_the_limits(name):
    """a, b, c and bounds to 1e-12 (castors, which both follow to 1e-7 rad: to that)."""
    robot = BALLS if name == "balls" else shipped(name)
    heading = [0, 0.4, 1.0, 0.7] if name == "loc8" else None
    path = Path.through([[0, 0], [1, 0.5], [1.6, -0.2], [2.4, 0.3]], heading=heading)
    limits = tuple(limit(n) for n in LIMITS if n in NAMES)
    along = track(path, robot)
    measure = Measure.of(along)
    source = planar_of(along, measure, limits)
    assert source is not None
    u = graded_grid(measure, 200)
    ours = cells_of(along, measure, u, source, np.asarray(path.basis.knots)).table
    theirs = cells_of(along, measure, u, Readable(limits), np.asarray(path.basis.knots)).table
    # Castors are known to 1e-7 rad; the load of one of four wheels is a quarter of a row's scale.
    close = 1.2e-6 if name == "powerbot" else 1e-12
    for k in "abc":
        mine, reference = (np.sort(getattr(t, k), axis=1) for t in (ours, theirs))
        np.testing.assert_allclose(mine, reference, atol=close * max(1, np.abs(reference).max()))
    np.testing.assert_allclose(ours.bounds, theirs.bounds, rtol=1e-11)
