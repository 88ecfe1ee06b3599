"""Pareto fronts of several terms at once, by NSGA-II of pymoo (optional extra "optimizers")."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray
from trajopt.errors import ArgumentError, MissingDependencyError
from trajopt.optimize.base import FEASIBLE, checked_bounds

Terms = Callable[[Array], tuple[Array, Array]]

POPULATION = 200  # chosen
GENERATIONS = 100  # chosen


@dataclass(frozen=True, eq=False)
class ParetoFront:
    """Designs of which none is better in every term: ``designs`` (p, d), ``terms`` (p, m), larger
    is better."""

    designs: Array
    terms: Array
    evaluations: int


def pareto_front(
    terms: Terms,
    bounds: ArrayLike,
    count: int,
    *,
    seed: int = 0,
    population: int = POPULATION,
    generations: int = GENERATIONS,
) -> ParetoFront:
    """Front of ``count`` terms to be large. ``terms`` maps designs (n, d) to terms (n, m) and
    violations (n,).

    The front is recomputed here from what the search visited last: feasible designs only, none
    dominated. Raises ArgumentError for bad bounds, counts or no feasible design,
    MissingDependencyError without pymoo.
    """
    box = checked_bounds(bounds)
    if count < 2 or population < 4 or generations < 1:
        raise ArgumentError(
            "count",
            (count, population, generations),
            ">= 2 terms, population >= 4, generations >= 1",
        )
    found = _search(terms, box, count, seed, population, generations)
    values, violation = terms(found)
    feasible = np.isfinite(values).all(axis=1) & (violation <= FEASIBLE)
    found, values = found[feasible], values[feasible]
    if len(found) == 0:
        raise ArgumentError(
            "generations", generations, "a search that finds a feasible design; search longer"
        )
    best = nondominated(values)
    return ParetoFront(found[best], values[best], population * generations)


def nondominated(values: Array) -> BoolArray:
    """(n,): which rows of ``values`` (n, m) no other row beats (at least as large in all, larger in
    one)."""
    keep = np.ones(len(values), dtype=bool)
    for i, row in enumerate(values):
        beaten = np.all(values >= row, axis=1) & np.any(values > row, axis=1)
        keep[i] = not beaten.any()
    return keep


def _search(
    terms: Terms, box: Array, count: int, seed: int, population: int, generations: int
) -> Array:
    """Last population and front of pymoo's NSGA-II (d columns)."""
    try:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.core.problem import Problem
        from pymoo.optimize import minimize as run
    except ImportError as error:
        raise MissingDependencyError("pymoo", "optimizers", "a Pareto front") from error

    class Task(Problem):  # type: ignore[misc]  # pymoo asks for a subclass
        def __init__(self) -> None:
            super().__init__(
                n_var=len(box), n_obj=count, n_ieq_constr=1, xl=box[:, 0], xu=box[:, 1]
            )

        def _evaluate(self, x: Any, out: Any, *_: Any, **__: Any) -> None:
            values, violation = terms(np.asarray(x, dtype=np.float64))
            out["F"], out["G"] = -values, violation[:, None] - FEASIBLE

    result = run(
        Task(), NSGA2(pop_size=population), ("n_gen", generations), seed=seed, verbose=False
    )
    visited = [np.asarray(result.pop.get("X"), dtype=np.float64)]
    if result.X is not None:
        visited.append(np.atleast_2d(np.asarray(result.X, dtype=np.float64)))
    return np.unique(np.concatenate(visited), axis=0)
