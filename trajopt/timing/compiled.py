"""Time-optimal profile with s'' constant between gridpoints: the passes of the core (timing/reach.py)
on such cells."""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.errors import ArgumentError
from trajopt.timing.feasibility import allowed_end, empty_set, require_bounded, require_start_speed
from trajopt.timing.stages import SD2_CAP, Stages, controllable


def load_kernel() -> None:
    """Load the compiled passes: about a second, once a process, which a caller that measures its own
    time may want behind it. They are called on one interval of one metre."""
    s, row = np.array([[0.0, 1.0]]), np.ones((1, 2, 1))
    fastest_profiles(s, row, row, row, np.ones((1, 2)), np.zeros(1), np.zeros(1))


def compiled_profile(stages: Stages, start: float, end: float) -> Array:
    """(N+1,) s'^2 of the fastest profile with s'^2 = ``start`` and ``end`` at the ends.

    Raises InfeasibleError naming limit and place.
    """
    end = allowed_end(stages, end)
    sets = controllable_sets(stages, end, end)
    require_start_speed(stages, start, sets)
    require_bounded(stages, sets)
    return _forward(stages.s, stages.a, stages.b, stages.c, sets, start)


def controllable_sets(stages: Stages, lowest: float, highest: float) -> Array:
    """(N+1, 2) least and greatest s'^2 at each gridpoint from which the end is reached in [lowest,
    highest].

    Raises InfeasibleError naming limit and place when a set is empty.
    """
    last = lowest, min(highest, float(stages.sd2_max[-1]), SD2_CAP)
    sets, failed = controllable(stages.s, stages.a, stages.b, stages.c, stages.sd2_max, last)
    if failed >= 0:
        raise empty_set(stages, failed, sets)
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
    sd2, failed = np.full((paths, points), np.nan), np.full(paths, -1, dtype=np.intp)
    s, a, b, c = (np.ascontiguousarray(m, dtype=np.float64) for m in (s, a, b, c))
    for p in range(paths):
        if end[p] > sd2_max[p, -1] * (1 + 1e-12):
            failed[p] = points - 1
            continue
        sets, failed[p] = controllable(s[p], a[p], b[p], c[p], sd2_max[p], (end[p], end[p]))
        slack = 1e-9 * sets[0, 1]
        if failed[p] < 0 and not sets[0, 0] - slack <= start[p] <= sets[0, 1] + slack:
            failed[p] = 0
        if failed[p] < 0:
            node = np.append(0, np.cumsum(np.diff(s[p]) > 0))  # gridpoints may stand at one place
            sd2[p] = _forward(s[p], a[p], b[p], c[p], sets, start[p])[node]
    return sd2, failed


def _forward(s: Array, a: Array, b: Array, c: Array, sets: Array, start: float) -> Array:
    """The greedy (and optimal) profile inside the controllable sets."""
    from trajopt.timing import reach

    d = np.diff(s)
    left = np.flatnonzero(d > 0)
    top, constant = np.full(len(s), np.inf), np.ones(len(left), dtype=np.bool_)
    y, u = np.empty(len(left) + 1), np.empty((2, len(left)))
    first = min(max(start, sets[0, 0]), sets[0, 1])
    reach.forward(d[left], left, left + 1, left, a, b, c, top, constant, sets, first, y, *u)
    return y
