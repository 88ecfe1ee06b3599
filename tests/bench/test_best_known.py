"""Best known costs: each is what its candidate scores, and a search that beats one is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from trajopt.bench.comparison import load_bench, named_optimizer, suits
from trajopt.bench.problems import bench_problem, best_known
from trajopt.bench.tables import SOLVED
from trajopt.optimize.base import FEASIBLE, Budget
from trajopt.optimize.search import minimize

ROOT = Path(__file__).parents[2]
PLAN = load_bench(ROOT / "benchmarks" / "pso_vs_gradient.toml")
FEW = ("corridor/1/length", "corridor/2/length", "smdw/table_5_3/p2/limits", "asoc/snow")


def beats(name: str, methods: tuple[str, ...], evaluations: int) -> None:
    """No search ends below a known cost by more than what counts as solved."""
    problem = bench_problem(name, root=str(ROOT / "problems"))
    for method in methods:
        made = named_optimizer(method)
        if not suits(made, problem.objective):
            continue
        found = minimize(
            problem.objective, problem.bounds, optimizer=made, seed=77, budget=Budget(evaluations)
        )
        least = problem.best - SOLVED * abs(problem.reference - problem.best)
        told = f"{method} found {found.fun!r} at {found.x.tolist()}: keep it in best_known.json"
        assert found.violation > FEASIBLE or not found.fun < least, told


@pytest.mark.parametrize("name", FEW)
def test_known_costs_are_not_beaten(name: str) -> None:
    beats(name, ("auto", "slsqp"), 2_000)


@pytest.mark.slow
@pytest.mark.parametrize("name", PLAN.problems)
def test_known_costs_are_not_beaten_by_anything(name: str) -> None:
    beats(name, ("auto", "pso", "slsqp", "ipopt", "cma-es", "nelder-mead"), 20_000)


@pytest.mark.parametrize("name", [n for n in sorted(best_known()) if n in PLAN.problems])
def test_known_costs_are_what_their_candidates_score(name: str) -> None:
    known = best_known()[name]
    problem = bench_problem(name, root=str(ROOT / "problems"))
    x = np.array(known["x"])
    assert np.all((x >= problem.bounds[:, 0] - 1e-9) & (x <= problem.bounds[:, 1] + 1e-9))
    scored = problem.objective.score(np.clip(x, *problem.bounds.T))
    assert scored.cost[0] == pytest.approx(known["cost"], rel=1e-9, abs=1e-9)
    if scored.constraints is not None and scored.limits is not None:
        lower, upper = scored.limits
        assert np.all((scored.constraints >= lower - 1e-6) & (scored.constraints <= upper + 1e-6))
    else:
        assert scored.violation[0] <= FEASIBLE
