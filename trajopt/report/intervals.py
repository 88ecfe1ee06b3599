"""Confidence intervals that tables and pictures show."""

from __future__ import annotations

from trajopt.errors import ArgumentError


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Wilson's 95 % score interval of a binomial share [wilson1927]; (0, 1) without trials.

    Raises ArgumentError unless 0 <= successes <= trials.
    """
    from scipy.stats import binomtest

    if not 0 <= successes <= trials:
        raise ArgumentError("successes", (successes, trials), "0 <= successes <= trials")
    if trials == 0:
        return 0.0, 1.0
    found = binomtest(successes, trials).proportion_ci(confidence_level=0.95, method="wilson")
    return float(found.low), float(found.high)
