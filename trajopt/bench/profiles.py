"""Profiles of a benchmark: data and performance profiles, ECDF of targets, expected running time.

Input throughout is a table of running times ``times`` (problems, optimizers, seeds[, targets]):
what a search had used when it reached its target, inf where it did not. The unit (evaluations,
seconds) is the caller's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray
from trajopt.errors import ArgumentError


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
    with np.errstate(divide="ignore"):
        sample = spent[picks].sum(axis=1) / wins
    low, high = np.sort(sample)[[int(0.025 * draws), min(int(0.975 * draws), draws - 1)]]
    value = spent.sum() / success.sum() if success.any() else np.inf
    return RunningTime(float(value), float(low), float(high), int(success.sum()), len(times))


def no_worse(first: ArrayLike, second: ArrayLike) -> float:
    """p-value of the one-sided rank-sum test that ``first`` has larger costs than ``second``.

    A small value (below 0.05, say) means that ``first`` is worse. Ties are handled by the normal
    approximation.
    """
    from scipy.stats import mannwhitneyu

    return float(mannwhitneyu(first, second, alternative="greater", method="asymptotic").pvalue)


def holm(p_values: ArrayLike) -> Array:
    """(k,): p-values corrected for k tests [holm1979], to be compared with the level itself."""
    p = np.asarray(p_values, dtype=np.float64)
    order = np.argsort(p, kind="stable")
    corrected = np.empty(len(p))
    corrected[order] = np.minimum(np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)), 1.0)
    return corrected


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
