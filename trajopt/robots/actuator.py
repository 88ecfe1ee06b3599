"""Wheel actuator with saturation and dead-zone ([guzman2015], section 4.2.2), integrated exactly.

The actuator passes a commanded wheel speed w unchanged, but gives 0 below the dead-zone and
+-saturation beyond the saturation:

    f(w) = 0 for |w| < dead_zone,  w for dead_zone <= |w| <= saturation,  sign(w) saturation beyond.

Over a time step in which w moves linearly from w0 to w1, the mean of f is (G(w1) - G(w0))/(w1 - w0)
with G(w) = max(min(|w|, sat)^2 - dz^2, 0)/2 + sat max(|w| - sat, 0). That form loses digits when w1
is near w0; the code below is the same function written with factored differences.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from trajopt.errors import ArgumentError

SMALL_SPAN = 1e-9  # rad/s; a step with less change of speed is taken as constant


@dataclass(frozen=True)
class Actuator:
    """Wheel speed limits, rad/s: ``saturation`` > ``dead_zone`` >= 0. ``Actuator()`` limits
    nothing."""

    saturation: float = np.inf
    dead_zone: float = 0.0

    def __post_init__(self) -> None:
        if not self.dead_zone >= 0:
            raise ArgumentError("actuator.dead_zone", self.dead_zone, "a speed >= 0 rad/s")
        if not self.saturation > self.dead_zone:
            raise ArgumentError(
                "actuator.saturation", self.saturation, "a speed above the dead-zone, rad/s"
            )

    @property
    def is_ideal(self) -> bool:
        return self.dead_zone == 0.0 and np.isinf(self.saturation)

    def output(self, w: Any) -> Any:
        """f(w), rad/s, elementwise."""
        magnitude = np.abs(w)
        return np.where(
            magnitude < self.dead_zone, 0.0, np.sign(w) * np.minimum(magnitude, self.saturation)
        )

    def step_mean(self, mean: Any, half_span: Any) -> Any:
        """Mean of f over a step in which w moves linearly from mean - half_span to mean +
        half_span."""
        if self.is_ideal:
            return mean
        low, high = mean - half_span, mean + half_span
        span = high - low
        small = np.abs(span) < SMALL_SPAN
        return np.where(
            small, self.output(mean), self._integral(low, high) / np.where(small, 1.0, span)
        )

    def _integral(self, low: Any, high: Any) -> Any:
        """Integral of f from low to high, each difference factored so that nothing cancels."""
        sat, dz = self.saturation, self.dead_zone
        total = 0.0
        if np.isinf(sat):
            total = (high - low) * (high + low) / 2
        else:
            a, b = np.clip(low, -sat, sat), np.clip(high, -sat, sat)
            total = (b - a) * (b + a) / 2 + sat * (np.abs(high - b) - np.abs(low - a))
        if dz > 0:
            a, b = np.clip(low, -dz, dz), np.clip(high, -dz, dz)
            total = total - (b - a) * (b + a) / 2
        return total
