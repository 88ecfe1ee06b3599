"""Duration or energy as the cost: what the fastest motion along the candidate path takes.

Wheel angles at the end do not depend on timing, so they are a constraint here: the violation is
what the critical wheels' deviations exceed their tolerance by. The lattice meets it exactly and
picks the fastest solution; population methods handle it by Deb's rule.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from trajopt.arrays import Array, fold
from trajopt.errors import InfeasibleError
from trajopt.objectives.base import Capability, Evaluation
from trajopt.objectives.on_terminal import OnTerminal
from trajopt.timing.scaling import time_scale

SEARCH_GRIDPOINTS = 60  # of the time scaling inside a search; the score uses the full grid. Chosen


@dataclass(frozen=True)
class DurationObjective(OnTerminal):
    """``kind``: duration (s) or energy (J) of the fastest motion, over the free control values of
    ``terminal``'s problem, wheel angles as a constraint."""

    kind: Literal["duration", "energy"] = "duration"
    gridpoints: int = SEARCH_GRIDPOINTS

    @property
    def provides(self) -> frozenset[Capability]:
        offered = {Capability.BATCH, Capability.RESIDUALS}
        return frozenset(offered | ({Capability.AFFINE} if self.terminal.is_affine else set()))

    def _cost(self, candidate: Array, gridpoints: int | None) -> float:
        """Duration or energy; inf where the limits allow no motion along this path."""
        problem = self.terminal.problem
        try:
            found = time_scale(
                self.path(candidate),
                problem.limits,
                robot=self.terminal.robot,
                gridpoints=gridpoints,
            )
            return found.duration if self.kind == "duration" else found.energy
        except InfeasibleError:
            return float(np.inf)

    def _violation(self, candidates: Array) -> Array:
        section = self.terminal.problem.objective
        errors = self.terminal.wheel_errors(self.terminal.predict(candidates.T))
        folded = [np.abs(fold(np.asarray(e)[0], section.period)) for e in errors]
        worst = np.max([np.zeros(len(candidates)), *folded], axis=0)
        return np.asarray(np.maximum(worst - section.wheel_tolerance, 0.0))

    def evaluate(self, candidates: Array) -> Evaluation:
        """Costs are computed only where the wheel angles are within tolerance: elsewhere Deb's
        rule compares violations and the path length (m) stands in for the cost. Where the limits
        allow no motion, both are inf."""
        candidates = np.asarray(candidates, dtype=np.float64)
        violation = self._violation(candidates)
        cost = np.array(
            [
                self._cost(row, self.gridpoints) if v == 0.0 else self.path(row).length
                for row, v in zip(candidates, violation, strict=True)
            ]
        )
        return Evaluation(cost, np.where(np.isfinite(cost), violation, np.inf))

    def score(self, candidate: Array) -> Evaluation:
        cost = self._cost(candidate, None)
        violation = self._violation(candidate[None]) if np.isfinite(cost) else np.array([np.inf])
        return Evaluation(np.array([cost]), violation)

    def terms(self, candidate: Array) -> dict[str, float]:
        """Named terms of one candidate (d,): the duration in s, or the energy in J."""
        return {self.kind: self._cost(candidate, None)}

    # -- the lattice, through the terminal objective
    # --------------------------------------------------

    def effort(self, candidates: Array) -> Array:
        """(n,): cost; ranks exact solutions."""
        return np.array([self._cost(row, self.gridpoints) for row in candidates])
