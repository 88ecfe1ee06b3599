"""CMA-ES [hansen2016] by the package pycma, behind the package's contract. Constraints by Deb's
rule as a rank."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.errors import MissingDependencyError
from trajopt.objectives.base import Capability, Objective
from trajopt.optimize.base import (
    FEASIBLE,
    Run,
    Status,
)
from trajopt.optimize.method import Method


@dataclass(frozen=True)
class CmaEs(Method):
    """Covariance matrix adaptation, restarted with twice the population when it has converged
    (IPOP).

    Works on variables scaled to [0, 1]; pycma's own bound handling keeps candidates inside.
    """

    name: ClassVar[str] = "cma-es"
    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = True

    sigma: float = 0.3  # of the width; pycma's documentation: about a quarter of the search range
    restarts: int = 9  # pycma's documentation of IPOP

    def _require(self, objective: Objective) -> None:  # noqa: ARG002
        _package()

    def _search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        package = _package()
        low, width = run.bounds[:, 0], run.bounds[:, 1] - run.bounds[:, 0]
        d = len(low)
        if x0 is not None:  # pycma samples around its start without evaluating it
            run.evaluate(x0[None])
        population = 4 + int(3 * np.log(d))  # pycma's default
        for restart in range(self.restarts + 1):
            first = rng.random(d) if x0 is None or restart else (x0 - low) / width
            options = {
                "bounds": [0.0, 1.0],
                "popsize": population << restart,
                "verbose": -9,
                "verb_log": 0,
                "verb_disp": 0,
                "seed": np.nan,
                "randn": lambda *shape: rng.standard_normal(shape),
            }
            strategy = package.CMAEvolutionStrategy(first, self.sigma, options)
            while not strategy.stop():
                asked = np.asarray(strategy.ask())
                result = run.evaluate(np.clip(low + width * asked, low, low + width))
                strategy.tell(list(asked), _ranked(result.cost, result.violation).tolist())
                run.nit += 1
        return Status.CONVERGED, f"{self.restarts} restarts"


def _ranked(cost: Array, violation: Array) -> Array:
    """Costs where all are feasible and finite; otherwise ranks by Deb's rule (CMA-ES uses ranks
    only)."""
    if np.all(violation <= FEASIBLE) and np.all(np.isfinite(cost)):
        return cost
    order = np.lexsort((cost, np.where(violation <= FEASIBLE, 0.0, violation)))
    ranks = np.empty(len(cost))
    ranks[order] = np.arange(len(cost))
    return ranks


def _package() -> Any:
    try:
        import cma
    except ImportError:
        raise MissingDependencyError("cma", "optimizers", "the optimizer cma-es") from None
    return cma
