"""How far candidates break their constraints: as it is, and as Deb's rule is to see it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from trajopt.arrays import Array
from trajopt.objectives.base import Evaluation
from trajopt.optimize.base import FEASIBLE

if TYPE_CHECKING:
    from trajopt.optimize.limited import Limited

_BETTER = 0.2  # [takahama2006]
_FALLING = 0.8  # of the budget, chosen


class Violations:
    """Measures constraints of one search. ``limits`` (2, m): between what they are kept, once one
    was computed; ``scale`` (m,): the first excess of each that was seen, 0 before."""

    def __init__(self, bounds: Array) -> None:
        self.limits: Array | None = None
        self.scale = np.zeros(0)
        self._low, self._high = np.ascontiguousarray(bounds.T)
        self._rounding = np.zeros(0)

    def measured(self, found: Evaluation, rows: Array, inside: bool) -> tuple[Evaluation, Array]:
        """With violations as Deb's rule is to see them, and the worst excess itself, each (n,).

        ``inside`` says that all candidates are within the bounds; the distance outside adds.
        """
        rank = worst = found.violation
        if found.constraints is None and self.limits is not None:  # an answer that was none
            found = Evaluation(
                found.cost, rank, np.full((len(rows), self.limits.shape[1]), np.nan), self.limits
            )
        if found.constraints is not None and found.limits is not None:
            if self.limits is not found.limits:
                self.limits, self._rounding = found.limits, rounding(found.limits)
            over = excess(found.constraints, found.limits, self._rounding)
            rank = worst = over.max(axis=1, initial=0.0)
            if worst.any():
                rank = self._rank(over, worst)
        if not inside and ((rows < self._low).any() or (rows > self._high).any()):
            outside = np.maximum(self._low - rows, rows - self._high)
            outside = np.maximum(outside, 0.0).sum(axis=1)
            rank, worst = rank + outside, worst + outside
        if rank is not found.violation:
            found = Evaluation(found.cost, rank, found.constraints, found.limits)
        return found, worst

    def _rank(self, over: Array, worst: Array) -> Array:
        """(n,): the sum of violations (n, m), each as a multiple of the first one seen."""
        if len(self.scale) != over.shape[1]:
            self.scale = np.zeros(over.shape[1])
        if not self.scale.all():
            seen = np.where(np.isfinite(over), over, 0.0).max(axis=0)
            self.scale = np.where(self.scale > 0, self.scale, seen)
        parts = over / np.where(self.scale > 0, self.scale, 1.0)
        # However small the share of the first: what is broken must not count as rounding.
        return np.where(worst > 0, 2 * FEASIBLE + parts.sum(axis=1), 0.0)


def rounding(limits: Array) -> Array:
    """(m,): by how much constraints may miss their limits (2, m) and count as kept."""
    finite = np.where(np.isfinite(limits), np.abs(limits), 0.0)
    return np.asarray(FEASIBLE * np.maximum(1.0, finite.max(axis=0)))


def excess(values: Array, limits: Array, allowed: Array) -> Array:
    """(n, m): by how much constraints (n, m) are broken; 0 where it is but rounding (``allowed``),
    inf where they could not be computed."""
    over = np.asarray(np.maximum(limits[0] - values, values - limits[1]))
    over[over <= allowed] = 0.0
    over[np.isnan(over)] = np.inf
    return over


@dataclass
class Levels:
    """Epsilon levels [takahama2006] where there are equalities: the violation up to which
    candidates of a population count as feasible. It falls from that of the better fifth of the
    first ones to rounding, in the first half of the budget."""

    run: Limited
    first: float = 0.0

    def at(self, violation: Array) -> float:
        """The level for candidates with these violations (n,)."""
        limits = self.run.limits
        if limits is None or not (limits[0] == limits[1]).any():
            return FEASIBLE
        self.first = self.first or float(np.quantile(violation, _BETTER))
        done = min(1.0, self.run.used / _FALLING)
        return float(max(FEASIBLE, min(self.first, 1e9) ** (1.0 - done) * FEASIBLE**done))
