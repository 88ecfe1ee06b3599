"""Profiles, running times and the probability of being better, by their definitions."""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
import pytest

from trajopt.bench.profiles import (
    data_profile,
    ecdf,
    expected_running_time,
    performance_profile,
    superiority,
    time_to_targets,
)

INF, NAN = np.inf, np.nan


def test_time_to_targets() -> None:
    assert time_to_targets([1, 5, 9], [4.0, 2.0, 1.0], [5.0, 2.0, 1.5, 0.5]).tolist() == [
        1.0,
        5.0,
        9.0,
        INF,
    ]
    assert time_to_targets([], [], [1.0]).tolist() == [INF]


def test_data_profile_counts_simplex_gradients() -> None:
    times = np.array(
        [[[3.0, INF], [30.0, 6.0]], [[8.0, 8.0], [NAN, NAN]]]
    )  # 2 problems, 2 optimizers, 2 seeds
    profile = data_profile(times, [2, 3], [1.0, 2.0, 10.0])  # divided by 3 and 4
    assert profile[:, 0].tolist() == [0.25, 0.75, 0.75]
    assert profile[:, 1].tolist() == [0.0, 0.5, 1.0]


def test_performance_profile_is_relative_to_the_fastest() -> None:
    times = np.array([[[2.0], [4.0]], [[9.0], [3.0]], [[INF], [INF]], [[INF], [1.0]]])
    profile = performance_profile(times, [1.0, 2.0, 3.0])
    assert profile[:, 0].tolist() == [0.25, 0.25, 0.5]
    assert profile[:, 1].tolist() == [0.5, 0.75, 0.75]


def test_ecdf_counts_all_targets() -> None:
    times = np.array(
        [[[[1.0, 10.0], [2.0, INF]]]]
    )  # one problem, one optimizer, two seeds, two targets
    assert ecdf(times, [1.0, 2.0, 100.0])[:, 0].tolist() == [0.25, 0.5, 0.75]


def test_expected_running_time_and_its_interval() -> None:
    found = expected_running_time(
        [10.0, INF, 20.0, INF], [10.0, 100.0, 20.0, 100.0], np.random.default_rng(0)
    )
    assert found.value == pytest.approx(230.0 / 2)
    assert found.low <= found.value <= found.high
    assert (found.successes, found.runs) == (2, 4)
    never = expected_running_time([INF], [5.0], np.random.default_rng(0))
    assert never.value == INF
    sure = expected_running_time([7.0] * 10, [7.0] * 10, np.random.default_rng(0))
    assert (sure.low, sure.value, sure.high) == (7.0, 7.0, 7.0)


def test_the_probability_of_being_better_and_its_interval() -> None:
    rng = np.random.default_rng(3)
    low, high = rng.normal(0.0, 1.0, 30), rng.normal(2.0, 1.0, 30)
    better, worse = superiority(low, high), superiority(high, low)
    assert (better.verdict, worse.verdict) == ("better", "worse")
    assert [1 - v for v in worse] == pytest.approx([better.value, better.high, better.low])
    assert superiority([1.0, 2.0], [2.0, 3.0]).value == (1 + 1 + 0.5 + 1) / 4
    assert superiority(low, low).value == 0.5
    many = rng.normal(0.0, 1.0, (2, 400))
    assert superiority(*many).verdict == "equal"
    assert superiority(many[0], many[1] + 0.2).verdict == "better, equal"  # shown, and small
    assert superiority(many[0, :8], many[1, :8]).verdict == "open"
    one, six = superiority(low, high), superiority(low, high, of=6)
    assert six.low < one.low < one.high < six.high


def test_intervals_of_that_probability_hold_what_they_say() -> None:
    """Normal costs a distance apart: the first is lower with probability phi(distance / sqrt 2)."""
    rng = np.random.default_rng(8)
    for distance, sizes in ((0.0, (5, 5)), (1.0, (12, 20)), (2.5, (8, 8))):
        true = NormalDist().cdf(distance / 2**0.5)
        found = [
            superiority(rng.normal(0.0, 1.0, sizes[0]), rng.normal(distance, 1.0, sizes[1]))
            for _ in range(400)
        ]
        held = np.mean([f.low <= true <= f.high for f in found])
        assert 0.92 <= held <= 0.99
