"""What is alike in optimizers whose search is one ``Run``: checks, the run, and its end."""

from __future__ import annotations

from numpy.random import Generator
from numpy.typing import ArrayLike

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Objective
from trajopt.optimize.base import (
    Budget,
    Optimizer,
    OptimizeResult,
    Progress,
    Run,
    Status,
    checked_bounds,
    checked_x0,
)


class Method(Optimizer):
    """Base of optimizers: a subclass is a frozen dataclass of options with ``name``, ``needs``,
    ``stochastic`` and ``_search``."""

    def minimize(
        self,
        objective: Objective,
        bounds: ArrayLike,
        *,
        x0: ArrayLike | None = None,
        rng: Generator,
        budget: Budget,
        progress: Progress | None = None,
    ) -> OptimizeResult:
        """Search inside ``bounds`` (d, 2), from ``x0`` (d,) where the method takes a start, until
        the method or ``budget`` ends it.

        Raises ArgumentError for an objective the method cannot search, or a start outside the
        bounds; MissingDependencyError where the package behind it is not installed.
        """
        self._require(objective)
        box = checked_bounds(bounds, objective.dimension)
        start, run = checked_x0(x0, box), Run(objective, box, budget, progress)
        return run.finish(self.name, lambda: self._search(run, start, rng))

    def _require(self, objective: Objective) -> None:
        """Raises where the method cannot search ``objective`` or its package is missing."""

    def _search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        """Search by ``run``; why it ended, and what the method says of it."""
        raise NotImplementedError


def require_unconstrained(name: str, objective: Objective) -> None:
    """Raises ArgumentError for a constrained objective: the method knows only bounds."""
    if objective.constrained:
        raise ArgumentError(
            "optimizer",
            name,
            "a method that handles constraints for this objective: "
            "pso, cma-es, differential-evolution, slsqp or trust-constr",
        )
