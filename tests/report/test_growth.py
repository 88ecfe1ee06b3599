"""The exponent beside the picture of what time scaling costs."""

from __future__ import annotations

import pytest

from benchmarks.peers.timing_picture import growth_exponent
from trajopt.errors import ArgumentError

POINTS = (100, 1000, 10_000)


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_exponent_of_a_power(power: float) -> None:
    assert growth_exponent(POINTS, [3e-6 * n**power for n in POINTS]) == pytest.approx(power)


@pytest.mark.parametrize(("points", "seconds"), [((1,), (1,)), ((1, 2), (1,)), ((1, 2), (0, 1))])
def test_exponent_needs_pairs_of_positive_numbers(
    points: tuple[float, ...], seconds: tuple[float, ...]
) -> None:
    with pytest.raises(ArgumentError):
        growth_exponent(points, seconds)
