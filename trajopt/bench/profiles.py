"""Profiles of a benchmark: data and performance profiles, ECDF of targets, expected running time.

Input throughout is a table of running times ``times`` (problems, optimizers, seeds[, targets]):
what a search had used when it reached its target, inf where it did not. The unit (evaluations,
seconds) is the caller's.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray
from trajopt.errors import ArgumentError

EQUAL = 0.15  # from 0.5: probabilities of being better that count as equal; chosen


def time_to_targets(used: ArrayLike, cost: ArrayLike, targets: ArrayLike) -> Array:
    """(t,): what a search had used when its best cost first was at or below each target, inf where
    never.

    ``used`` (h,) and ``cost`` (h,) are a history of improvements; ``cost`` falls.
    """
    used, cost, targets = (np.asarray(a, dtype=np.float64) for a in (used, cost, targets))
    reached = cost[:, None] <= targets
    first = np.argmax(reached, axis=0) if len(cost) else np.zeros(targets.shape, dtype=np.intp)
    padded = used if len(used) else np.full(1, np.inf)
    return np.where(reached.any(axis=0), padded[first], np.inf)


def data_profile(times: ArrayLike, dimension: ArrayLike, budget: ArrayLike) -> Array:
    """(k, optimizers): share of (problem, seed) pairs solved within ``budget`` (k,) simplex
    gradients.

    [more2009], eq. 2.3: evaluations divided by dimension + 1. ``times`` (p, o, s), NaN
    where a run does not exist.
    """
    scaled = _three(times) / (np.asarray(dimension, dtype=np.float64)[:, None, None] + 1.0)
    return np.stack([_share(scaled <= b, scaled) for b in np.atleast_1d(budget)])


def performance_profile(times: ArrayLike, ratio: ArrayLike) -> Array:
    """(k, optimizers): share of problems solved within ``ratio`` (k,) times the best optimizer's
    time.

    [dolan2002], on the median over seeds of each problem and optimizer. Problems that
    nobody solved count as unsolved by all.
    """
    table = _three(times)
    present = ~np.isnan(table).all(axis=2)
    median = np.full(table.shape[:2], np.nan)
    for p, o in zip(*np.nonzero(present), strict=True):
        median[p, o] = _median(table[p, o][~np.isnan(table[p, o])])
    best = np.nanmin(np.where(np.isnan(median), np.inf, median), axis=1)
    with np.errstate(invalid="ignore"):
        relative = np.where(np.isfinite(best)[:, None], median / best[:, None], np.inf)
    relative = np.where(present, np.where(np.isnan(relative), np.inf, relative), np.nan)[:, :, None]
    return np.stack([_share(relative <= r, relative) for r in np.atleast_1d(ratio)])


def ecdf(times: ArrayLike, budget: ArrayLike) -> Array:
    """(k, optimizers): share of all (problem, seed, target) triples reached within ``budget`` (k,),
    as in COCO.

    ``times`` (p, o, s, t).
    """
    table = np.asarray(times, dtype=np.float64)
    if table.ndim != 4:
        raise ArgumentError("times", table.shape, "shape (problems, optimizers, seeds, targets)")
    flat = np.moveaxis(table, 1, 2).reshape(-1, table.shape[1], table.shape[3])
    return np.stack([_share(flat <= b, flat) for b in np.atleast_1d(budget)])


@dataclass(frozen=True)
class RunningTime:
    """Expected running time until a target: total time of all runs over the number of successes.

    ``low`` and ``high`` bound it with 95 % confidence (bootstrap); inf where no run, or too few,
    succeeded.
    """

    value: float
    low: float
    high: float
    successes: int
    runs: int


def expected_running_time(
    times: ArrayLike, used: ArrayLike, rng: Generator, draws: int = 1000
) -> RunningTime:
    """ERT of one optimizer on one problem ([hansen2009], eq. 3) with a percentile bootstrap
    over runs.

    ``times`` (s,): time to the target, inf for failures. ``used`` (s,): what each run used in all.
    """
    times, used = np.asarray(times, dtype=np.float64), np.asarray(used, dtype=np.float64)
    if times.ndim != 1 or times.shape != used.shape or not len(times):
        raise ArgumentError(
            "times", times.shape, "one time a run, at least one, and as many entries in used"
        )
    spent, success = np.where(np.isfinite(times), times, used), np.isfinite(times)
    picks = rng.integers(len(times), size=(draws, len(times)))
    wins = success[picks].sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        sample = spent[picks].sum(axis=1) / wins
    low, high = np.sort(sample)[[int(0.025 * draws), min(int(0.975 * draws), draws - 1)]]
    value = spent.sum() / success.sum() if success.any() else np.inf
    return RunningTime(float(value), float(low), float(high), int(success.sum()), len(times))


class Superiority(NamedTuple):
    """Probability that the first of two methods ends with the lower cost (ties count half), between
    which it lies with 95 % confidence, and what that says."""

    value: float
    low: float
    high: float

    @property
    def verdict(self) -> str:
        """better or worse: the interval holds no 0.5; equal: it lies within EQUAL of it; else open.
        It may be both: a difference that is shown, and shown to be small."""
        shown = "better" if self.low > 0.5 else "worse" if self.high < 0.5 else ""
        small = max(0.5 - self.low, self.high - 0.5) <= EQUAL
        return ", ".join([*([shown] if shown else []), *(["equal"] if small else [])]) or "open"

    def __str__(self) -> str:
        return f"{self.value:.2f} ({self.low:.2f} to {self.high:.2f})"


def superiority(first: ArrayLike, second: ArrayLike, of: int = 1) -> Superiority:
    """How often a cost of ``first`` (m,) is below one of ``second`` (n,), with a two-sided interval
    of 95 %, where there are ``of`` comparisons for all of them together (Bonferroni).

    The interval holds the values that are few of their own standard deviations from the one seen
    ([newcombe2006], method 5).
    """
    sigmas = NormalDist().inv_cdf(1 - 0.025 / of)
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    m, n = len(a), len(b)
    seen = float(((a[:, None] < b) + 0.5 * (a[:, None] == b)).mean())
    many = (m + n) / 2 - 1
    value = np.linspace(0.0, 1.0, 20_001)[1:-1]
    spread = 1 + many * ((1 - value) / (2 - value) + value / (1 + value))
    within = (value - seen) ** 2 <= sigmas**2 * value * (1 - value) * spread / (m * n)
    return Superiority(seen, float(value[within][0]), float(value[within][-1]))


def _three(times: ArrayLike) -> Array:
    table = np.asarray(times, dtype=np.float64)
    if table.ndim != 3:
        raise ArgumentError("times", table.shape, "shape (problems, optimizers, seeds)")
    return table


def _median(values: Array) -> float:
    """Median with infinities: the middle one, the mean of two only where both are finite."""
    ordered = np.sort(values)
    low, high = ordered[(len(ordered) - 1) // 2], ordered[len(ordered) // 2]
    return float(high if not np.isfinite(high) else (low + high) / 2)


def _share(hit: BoolArray, table: Array) -> Array:
    """(optimizers,): mean of ``hit`` over everything else, where the table is not NaN; NaN without
    entries."""
    present = ~np.isnan(table)
    axes = tuple(i for i in range(table.ndim) if i != 1)
    count = present.sum(axis=axes)
    return np.where(count > 0, (hit & present).sum(axis=axes) / np.maximum(count, 1), np.nan)
