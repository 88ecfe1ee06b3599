"""Many motions at once are those of single calls."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

from trajopt import Path, Speed, robot, time_scale
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.timing.many import Failed, time_scale_many
from trajopt.timing.trajectory import Trajectory

LIMITS = [Speed(1.0), Acceleration(0.5, 0.7), WheelSpeed(9.0)]


def random_paths(count: int) -> list[Path]:
    rng = np.random.default_rng(5)
    return [Path.through(np.cumsum(rng.uniform(-0.3, 1.0, (5, 2)), axis=0)) for _ in range(count)]


def same(many: Trajectory | Failed, one: Trajectory) -> None:
    assert isinstance(many, Trajectory)
    np.testing.assert_array_equal(many.sd, one.sd)
    np.testing.assert_array_equal(many.u, one.u)
    assert many.bound == one.bound


@pytest.mark.parametrize("kind", ["default", "threads", "processes"])
def test_as_single_calls(kind: str) -> None:
    paths, one = random_paths(6), robot("powerbot")
    if kind == "default":
        found = time_scale_many(paths, LIMITS, robot=one)
    elif kind == "threads":
        with ThreadPoolExecutor(3) as threads:
            found = time_scale_many(paths, LIMITS, robot=one, executor=threads)
    else:
        spawn = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(2, mp_context=spawn) as processes:
            found = time_scale_many(paths, LIMITS, robot=one, executor=processes)
    for trajectory, path in zip(found, paths, strict=True):
        same(trajectory, time_scale(path, LIMITS, robot=one))


def test_many_limits_and_pairs() -> None:
    paths = random_paths(3)
    slower = [[Speed(v), Acceleration(0.5, 0.5)] for v in (0.3, 0.6, 1.2)]
    found = time_scale_many(paths[0], slower, gap=None)
    for trajectory, limits in zip(found, slower, strict=True):
        same(trajectory, time_scale(paths[0], limits, gap=None))
    pairs = time_scale_many(paths, slower)
    for trajectory, path, limits in zip(pairs, paths, slower, strict=True):
        same(trajectory, time_scale(path, limits))


def test_errors_are_results_named_by_index() -> None:
    paths = random_paths(4)
    paths[2] = Path.through([[0, 0], [1, 0], [0, 0]])  # doubles back
    found = time_scale_many(paths, LIMITS[:2])
    failed = found[2]
    assert isinstance(failed, Failed)
    assert failed.index == 2
    assert isinstance(failed.error, InfeasibleError)
    assert str(failed).startswith("paths[2]: ")
    assert [isinstance(one, Trajectory) for one in found] == [True, True, False, True]


def test_numbers_that_do_not_fit() -> None:
    paths = random_paths(3)
    with pytest.raises(ArgumentError, match="paths, limits"):
        time_scale_many(paths, [LIMITS[:2], LIMITS[:1]])
    with pytest.raises(ArgumentError, match="paths"):
        time_scale_many([], LIMITS)
    with pytest.raises(ArgumentError, match="limits"):
        time_scale_many(paths, [])
    with pytest.raises(TypeError):
        time_scale_many(paths, LIMITS, grid=3)
