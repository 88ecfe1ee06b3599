"""Test functions of the benchmark: the classical ones of pymoo and the Moré-Wild set of optimagic.

Names: ``classical/<function>-<d>``, ``more-wild/<name>``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.bench.problems import Family
from trajopt.errors import ArgumentError, MissingDependencyError
from trajopt.objectives.base import Capability, Evaluation, Objective
from trajopt.optimize.functions import FunctionObjective

CLASSICAL = (
    "ackley",
    "griewank",
    "rastrigin",
    "rosenbrock",
    "schwefel",
    "zakharov",
)  # names in pymoo


def classical(text: str, _root: Path) -> tuple[Objective, Array]:
    name, _, dimension = text.rpartition("-")
    if name not in CLASSICAL or not dimension.isdigit() or int(dimension) < 2:
        raise ArgumentError(
            "problem", f"classical/{text}", f"one of {', '.join(CLASSICAL)}, then -<d> with d >= 2"
        )
    try:
        from pymoo.problems import get_problem
    except ImportError:
        raise MissingDependencyError("pymoo", "optimizers", "the classical functions") from None
    shipped = get_problem(name, n_var=int(dimension))
    low, high = np.asarray(shipped.xl, dtype=np.float64), np.asarray(shipped.xu, dtype=np.float64)
    # A fifth is cut off on one side, or the optimum is the middle, where DIRECT and local methods
    # start. Chosen.
    bounds = np.column_stack([low + 0.2 * (high - low), high])

    def value(x: Array) -> Array:
        return np.asarray(shipped.evaluate(x), dtype=np.float64)[:, 0]

    return FunctionObjective(value, int(dimension), batch=True), bounds


@lru_cache(maxsize=1)
def _more_wild_set() -> dict[str, Any]:
    try:
        from optimagic.benchmarking.get_benchmark_problems import get_benchmark_problems
    except ImportError:
        raise MissingDependencyError("optimagic", "optimizers", "the Moré-Wild problems") from None
    found: dict[str, Any] = get_benchmark_problems("more_wild")  # type: ignore[no-untyped-call]
    return found


def more_wild_names() -> tuple[str, ...]:
    """Names of the Moré-Wild problems, as ``more-wild/<name>``."""
    return tuple(f"more-wild/{name}" for name in _more_wild_set())


def more_wild(text: str, _root: Path) -> tuple[Objective, Array]:
    shipped = _more_wild_set()
    if text not in shipped:
        raise ArgumentError("problem", f"more-wild/{text}", "one of " + ", ".join(shipped))
    start = np.asarray(shipped[text]["inputs"]["params"], dtype=np.float64)
    # The set is unconstrained; the contract asks for bounds: +-10 around the published start,
    # chosen.
    reach = np.maximum(10.0, 2.0 * np.abs(start))
    return SumOfSquares(shipped[text]["inputs"]["fun"], len(start)), np.column_stack(
        [start - reach, start + reach]
    )


def more_wild_solution(text: str) -> tuple[float, str]:
    """Best known cost of a problem of the set, and who says so."""
    return float(_more_wild_set()[text]["solution"]["value"]), "optimagic's table of solutions"


@dataclass(frozen=True)
class SumOfSquares:
    """|r(x)|^2 of a residual function (d,) -> (m,), with its residuals for least-squares
    methods."""

    function: Callable[[Array], Array]
    dimension: int

    @property
    def provides(self) -> frozenset[Capability]:
        return frozenset({Capability.RESIDUALS})

    @property
    def constrained(self) -> bool:
        return False

    def evaluate(self, candidates: Array) -> Evaluation:
        with np.errstate(
            all="ignore"
        ):  # far from the start these functions overflow; the run counts that
            cost = np.array([float(np.sum(np.square(self.function(row)))) for row in candidates])
        return Evaluation(cost, np.zeros(len(candidates)))

    def score(self, candidate: Array) -> Evaluation:
        return self.evaluate(candidate[None])

    def residuals(self, z: Array, turns: Any, *, exact: bool = False) -> list[Array]:  # noqa: ARG002 - the protocol
        return list(np.column_stack([self.function(row) for row in np.atleast_2d(z.T)])[:, None, :])

    def residual_gains(self) -> Array:
        return np.ones(())

    def nearest_turns(self, candidates: Array) -> Array:
        return np.zeros((len(candidates), 0))

    def coarse(self) -> SumOfSquares:
        return self


FAMILIES = {
    "classical": Family(classical, {"classical, 10-D": r"classical/.*"}),
    "more-wild": Family(
        more_wild, {"Moré-Wild least squares": r"more-wild/.*"}, more_wild_solution
    ),
}
