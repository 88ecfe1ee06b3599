"""Time-optimal profile when no row holds s'^2: the fast pass for speed bounds and bounds on s''
alone."""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.timing.feasibility import allowed_end, empty_set, require_bounded, require_start_speed
from trajopt.timing.stages import Stages


def only_bounds(stages: Stages) -> bool:
    """Whether the fast pass is exact: no row holds s'^2, and s'' is bounded on both sides
    everywhere."""
    return not stages.b.any() and _bounds(stages) is not None


def bounds_profile(stages: Stages, start: float, end: float) -> Array:
    """(G,) s'^2 of the fastest profile with s'^2 = ``start`` and ``end`` at the ends.

    The passes of TOPP-RA, in which each step is a minimum of two numbers. Raises ArgumentError when
    ``only_bounds`` does not hold, InfeasibleError naming limit and place.
    """
    from trajopt.timing import kernel

    bounds = None if stages.b.any() else _bounds(stages)
    if bounds is None:
        raise ArgumentError(
            "engine", "bounds", "limits that bound s' and s'' alone; use engine='auto'"
        )
    lowest, highest = bounds
    end = allowed_end(stages, end)
    sets = np.empty((len(stages.s), 2))
    sets[-1] = end
    failed = kernel.controllable_in_bounds(stages.s, lowest, highest, stages.sd2_max, sets)
    if failed >= 0:
        raise empty_set(stages, int(failed), sets)
    require_start_speed(stages, start, sets)
    require_bounded(stages, sets)
    sd2 = np.empty(len(stages.s))
    kernel.fastest_in_bounds(stages.s, highest, sets, min(max(start, sets[0, 0]), sets[0, 1]), sd2)
    return sd2


def _bounds(stages: Stages) -> tuple[Array, Array] | None:
    """Lowest and highest s'' of every interval, None where rows do not give both."""
    from trajopt.timing import kernel

    lowest, highest = np.empty(len(stages.s) - 1), np.empty(len(stages.s) - 1)
    found = kernel.bounds_of_intervals(stages.s, stages.a, stages.c, lowest, highest)
    return (lowest, highest) if found else None
