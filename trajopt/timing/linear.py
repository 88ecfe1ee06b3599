"""Linear time scaling: one factor for the whole given-time motion ([waheed2006], eqs. 2.34 to
2.38)."""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array
from trajopt.paths.path import Path


def linear_profile(path: Path, u: Array) -> Array:
    """(N+1,) s'^2, up to one common factor: the spline parameter runs uniformly in time."""
    return path.rate(u) ** 2


def linear_factor(
    speed: float,
    acceleration: float,
    braking: float,
    *,
    speed_limit: float,
    acceleration_limit: float,
    braking_limit: float,
) -> float:
    """The thesis's factor on time from the unscaled maxima (eqs. 2.35 to 2.38; roots restored).

    max(1, v/V, sqrt(a/A), sqrt(d/D)); speeds m/s, accelerations and brakings m/s^2, all magnitudes.
    """
    return float(
        max(
            1.0,
            speed / speed_limit,
            np.sqrt(acceleration / acceleration_limit),
            np.sqrt(braking / braking_limit),
        )
    )
