"""Time-optimal profile by our own reachability analysis, compiled by numba (timing/kernel.py)."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.errors import ArgumentError
from trajopt.timing.feasibility import allowed_end, empty_set, require_bounded, require_start_speed
from trajopt.timing.stages import SD2_CAP, Stages


def is_compiled() -> bool:
    """Whether numba is installed; without it the same functions run interpreted, slowly."""
    return find_spec("numba") is not None


def load_kernel() -> None:
    """Load the compiled passes where numba is installed: about a second, once a process, which a
    caller that measures its own time may want behind it. They are called on one interval of one
    metre."""
    if not is_compiled():
        return
    from trajopt.timing import kernel

    s, row, sets = np.array([0.0, 1.0]), np.ones((2, 1)), np.array([[0.0, 1.0], [0.0, 0.0]])
    kernel.controllable(s, row, row, row, np.ones(2), sets)
    kernel.fastest(s, row, row, row, sets, 0.0, np.empty(2))


def compiled_profile(stages: Stages, start: float, end: float) -> Array:
    """(G,) s'^2 of the fastest profile with s'^2 = ``start`` and ``end`` at the ends.

    Raises InfeasibleError naming limit and place.
    """
    from trajopt.timing import kernel

    end = allowed_end(stages, end)
    sets = controllable_sets(stages, end, end)
    require_start_speed(stages, start, sets)
    require_bounded(stages, sets)
    sd2 = np.empty(len(stages.s))
    kernel.fastest(
        stages.s, stages.a, stages.b, stages.c, sets, min(max(start, sets[0, 0]), sets[0, 1]), sd2
    )
    return sd2


def controllable_sets(stages: Stages, lowest: float, highest: float) -> Array:
    """(G, 2) least and greatest s'^2 at each gridpoint from which the end is reached in [lowest,
    highest].

    Raises InfeasibleError naming limit and place when a set is empty.
    """
    from trajopt.timing import kernel

    sets = np.empty((len(stages.s), 2))
    sets[-1] = lowest, min(highest, float(stages.sd2_max[-1]), SD2_CAP)
    failed = kernel.controllable(stages.s, stages.a, stages.b, stages.c, stages.sd2_max, sets)
    if failed >= 0:
        raise empty_set(stages, int(failed), sets)
    return sets


def fastest_profiles(
    s: Array, a: Array, b: Array, c: Array, sd2_max: Array, start: Array, end: Array
) -> tuple[Array, IndexArray]:
    """Fastest profiles of P paths at once, each with G gridpoints and R rows a s'' + b s'^2 <= c.

    ``s`` and ``sd2_max`` (P, G), ``a``, ``b``, ``c`` (P, G, R) divided by their scale, ``start``
    and ``end`` (P,) s'^2. Returns s'^2 (P, G), NaN for a path without a motion, and (P,) the
    gridpoint where that one fails first, -1 for all others. ``Stages`` and ``compiled_profile``
    tell the limit behind it. Raises ArgumentError for shapes that do not fit.
    """
    from trajopt.timing import kernel

    paths, points = np.shape(s)
    for name, values, shape in (
        ("a", a, (paths, points)),
        ("b", b, np.shape(a)),
        ("c", c, np.shape(a)),
        ("sd2_max", sd2_max, (paths, points)),
        ("start", start, (paths,)),
        ("end", end, (paths,)),
    ):
        if np.shape(values)[: len(shape)] != shape:
            raise ArgumentError(name, np.shape(values), f"shape {shape}")
    sd2, failed = np.empty((paths, points)), np.empty(paths, dtype=np.intp)
    s, a, b, c, sd2_max, start, end = (
        np.ascontiguousarray(m, dtype=np.float64) for m in (s, a, b, c, sd2_max, start, end)
    )
    kernel.fastest_of_many(s, a, b, c, sd2_max, start, end, sd2, failed)
    return sd2, failed
