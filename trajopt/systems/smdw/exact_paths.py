"""Control points whose paths end exactly in a target's pose with its wheel angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from trajopt.arrays import Array
from trajopt.objectives.clearance import ClearObjective
from trajopt.optimize.lattice import lattice_points

# Sideways shifts (shares of the distance to the goal) of P1 and P2 around which exact paths are
# looked for: first a few, then many; chosen.
_FEW = ((0.0, 0.0), (0.2, 0.0), (-0.2, 0.0), (0.0, 0.2), (0.0, -0.2), (0.2, 0.2), (-0.2, -0.2))
_MANY = tuple((a / 5, b / 5) for a in range(-3, 4) for b in range(-3, 4))


def exact_candidates(objective: ClearObjective, *, lateral: bool) -> tuple[ClearObjective, Array]:
    """Exact candidates (n, 4), least effort first, and the objective they are exact for: looked for
    more widely where there are none, around more control points, then (forward only, where physics
    shows that the phase counts modulo half a turn) with either hub facing the step."""
    for bulges in (_FEW, _MANY):
        candidates = _around(objective, bulges)
        if len(candidates) or (bulges is _MANY and lateral):
            return objective, candidates
    halved = objective.terminal.problem.replace({"objective.wheel_period": "pi"})
    relaxed = replace(objective, terminal=replace(objective.terminal, problem=halved))
    return relaxed, _around(relaxed, _MANY)


def _around(objective: ClearObjective, bulges: Sequence[tuple[float, float]]) -> Array:
    """(n, 4): exact control points near the default, bent to either side, whose footprint stays on
    free ground, least effort first."""
    part, task = objective.affine_part(), objective.terminal.problem.search
    x, y, _ = np.subtract(task.goal, task.start)
    shifts = [np.array([-a * y, a * x, -b * y, b * x]) for a, b in bulges]
    bases = [np.clip(part.base + shift, *objective.bounds.T) for shift in shifts]
    box = objective.bounds[part.variables]
    points = np.concatenate([lattice_points(replace(part, base=base), box)[0] for base in bases])
    points = points[objective.evaluate(points).violation == 0.0] if len(points) else points
    if len(points) == 0:
        return points
    points = np.unique(np.round(points, 12), axis=0)
    return np.asarray(points[np.argsort(objective.effort(points), kind="stable")])
