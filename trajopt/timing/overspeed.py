"""A robot that is faster than a bound allows: it can only brake into it.

A speed bound below the current speed has no motion (a zone appears, a replanner lowers a limit).
The fastest braking that the other rows leave is then the least that the bound must give way.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from trajopt.arrays import Array
from trajopt.limits.limit import Limit
from trajopt.limits.yielding import Yielding
from trajopt.timing.cells import Cells
from trajopt.timing.stages import Stages
from trajopt.timing.steps import stages_of

_KEPT_BACK = (
    1e-3  # share of the possible braking that is not used, for rows between gridpoints; chosen
)
_FLAT = 1e-13  # a row (divided by its scale) with a smaller coefficient of s'' does not bound it
_ROUNDING = 1e-9  # relative, on s'^2


def yielding(limits: Sequence[Limit], cells: Cells, start: float) -> tuple[Limit, ...]:
    """``limits``, those with a bound below the fastest braking from s'^2 = ``start`` raised to
    it."""
    stages = stages_of(cells)
    squares = _braking(stages, start) * (1 + _ROUNDING)
    stops = int(np.argmin(squares > 0)) if (squares <= 0).any() else len(squares) - 1
    # Each place once: interpolation of a doubled one takes either value, and both are the same.
    kept = stages.kept[stages.kept <= max(stops, 1)]
    places, shown = tuple(stages.s[kept].tolist()), tuple(squares[kept].tolist())
    found: list[Limit] = []
    for limit, bound in zip(limits, stages.bounds, strict=True):
        over = squares > bound * (1 + _ROUNDING)
        found.append(
            Yielding(limit, places, shown, _crossings(stages.s, squares - bound))
            if over.any()
            else limit
        )
    return tuple(found)


def _braking(stages: Stages, start: float) -> Array:
    """(G,) s'^2 of the hardest braking from ``start``, 0 from where it stands."""
    squares = np.zeros(len(stages.s))
    squares[0] = x = start
    for i in range(len(squares) - 1):
        grow = 2 * (stages.s[i + 1] - stages.s[i])
        if grow > 0:
            p = np.concatenate([stages.a[i], stages.a[i + 1] + grow * stages.b[i + 1]])
            n = np.concatenate(
                [stages.c[i] - stages.b[i] * x, stages.c[i + 1] - stages.b[i + 1] * x]
            )
            down = p < -_FLAT
            hardest = float((n[down] / p[down]).max(initial=-np.inf))
            x = (
                max(x + grow * (hardest + _KEPT_BACK * abs(hardest)), 0.0)
                if np.isfinite(hardest)
                else 0.0
            )
        squares[i + 1] = x
        if x <= 0:
            break
    return squares


def _crossings(s: Array, excess: Array) -> tuple[float, ...]:
    """Places inside an interval where ``excess`` changes its sign, m."""
    a, b = excess[:-1], excess[1:]
    with np.errstate(invalid="ignore"):
        inside = np.isfinite(a) & np.isfinite(b) & (a * b < 0) & (np.diff(s) > 0)
    at = s[:-1][inside] + np.diff(s)[inside] * a[inside] / (a[inside] - b[inside])
    return tuple(at.tolist())
