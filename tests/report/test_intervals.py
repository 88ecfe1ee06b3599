"""Confidence intervals."""

from __future__ import annotations

import math

import pytest

from trajopt.errors import ArgumentError
from trajopt.report.intervals import wilson


@pytest.mark.parametrize(("k", "n"), [(0, 10), (3, 10), (17, 20), (20, 20)])
def test_ends_of_wilsons_interval_are_1_96_deviations_away(k: int, n: int) -> None:
    """Its ends are the shares p whose |k / n - p| is 1.96 deviations of a share p of n trials."""
    low, high = wilson(k, n)
    assert 0.0 <= low <= k / n <= high <= 1.0
    for end in (low, high):
        if 0.0 < end < 1.0:
            deviation = math.sqrt(end * (1 - end) / n)
            assert abs(k / n - end) == pytest.approx(1.959963984540054 * deviation, rel=1e-9)


def test_wilson_edges() -> None:
    assert wilson(0, 0) == (0.0, 1.0)
    assert wilson(0, 5)[0] == 0.0
    assert wilson(5, 5)[1] == 1.0
    with pytest.raises(ArgumentError, match="successes"):
        wilson(3, 2)
