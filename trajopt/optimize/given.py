"""No search at all: judge the given candidate, so that a plan from elsewhere becomes a solution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from numpy.random import Generator
from numpy.typing import ArrayLike

from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability, Objective
from trajopt.optimize.base import (
    Budget,
    OptimizeResult,
    Progress,
    Run,
    Status,
    checked_bounds,
    checked_x0,
)


@dataclass(frozen=True)
class Given:
    """Evaluates ``x0`` and returns it."""

    name: ClassVar[str] = "given"
    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = False

    def minimize(
        self,
        objective: Objective,
        bounds: ArrayLike,
        *,
        x0: ArrayLike | None = None,
        rng: Generator,  # noqa: ARG002 - the contract has it
        budget: Budget,
        progress: Progress | None = None,
    ) -> OptimizeResult:
        """The result at ``x0`` (d,). Raises ArgumentError without one, or for one outside the
        bounds."""
        box = checked_bounds(bounds, objective.dimension)
        point = checked_x0(x0, box)
        if point is None:
            raise ArgumentError(
                "x0", None, f"the candidate to judge, {objective.dimension} numbers"
            )
        run = Run(objective, box, budget, progress)

        def judged() -> tuple[Status, str]:
            run.evaluate(point[None])
            return Status.CONVERGED, "given, not searched"

        return run.finish(self.name, judged)
