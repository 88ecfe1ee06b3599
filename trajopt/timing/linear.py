"""Linear time scaling: one factor for the whole given-time motion ([waheed2006], eqs. 2.34 to
2.38)."""

from __future__ import annotations

from trajopt.arrays import Array
from trajopt.paths.path import Path


def linear_profile(path: Path, u: Array) -> Array:
    """(N+1,) s'^2, up to one common factor: the spline parameter runs uniformly in time."""
    return path.rate(u) ** 2
