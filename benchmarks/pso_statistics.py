"""gbest PSO with constriction against pyswarms's, everything equal that pyswarms lets one set.

Run as ``python -m benchmarks.pso_statistics``. Equal: coefficients, swarm size, iterations, bounds, uniform start,
velocities of zero, reflection at the bounds, no clamping. Not equal: our reflection also reverses the velocity, and the
random numbers. Costs after 50 x 500 evaluations are compared by the one-sided rank-sum test (is ours worse?) with
Holm's correction over the functions.
"""

from __future__ import annotations

import argparse
from functools import partial

import numpy as np

from benchmarks.common import ResultTable, publish
from trajopt.optimize.base import Budget
from trajopt.optimize.search import minimize
from trajopt.study.bench_problems import CLASSICAL, objective_named
from trajopt.study.peers import equal_pyswarms
from trajopt.study.profiles import holm, no_worse

PACKAGES = ("trajopt", "numpy", "scipy", "pyswarms", "pymoo")
LEVEL = 0.05
EVALUATIONS = 25_000


def main() -> None:
    """Run everything and write out/benchmarks/pso_statistics.{md,csv}."""
    parser = argparse.ArgumentParser(description="gbest PSO against pyswarms's with equal parameters.")
    parser.add_argument("--quick", action="store_true", help="8 seeds, 5 dimensions")
    quick = parser.parse_args().quick
    seeds, dimension = (8, 5) if quick else (30, 10)
    names = [f"classical/{name}-{dimension}" for name in CLASSICAL]
    costs = []
    for name in names:
        objective, bounds = objective_named(name)
        search = partial(minimize, objective, bounds, budget=Budget(EVALUATIONS))
        costs.append([[search(optimizer=method, seed=seed).fun for seed in range(seeds)]
                      for method in ("pso-gbest", equal_pyswarms())])
    worse = holm([no_worse(ours, theirs) for ours, theirs in costs])
    better = holm([no_worse(theirs, ours) for ours, theirs in costs])
    rows = [(name, *(f"{np.median(c):.3g}" for c in pair), *(f"{np.quantile(c, 0.9):.3g}" for c in pair),
             f"{p:.3f}", f"{q:.3f}", "worse" if p < LEVEL else "better" if q < LEVEL else "no difference shown")
            for name, pair, p, q in zip(names, costs, worse, better, strict=True)]
    header = ("function", "median", "pyswarms", "90 %", "pyswarms 90 %", "p worse (Holm)", "p better (Holm)", "PSO is")
    bad = sum(p < LEVEL for p in worse)
    publish("pso_statistics", [ResultTable(f"Cost after {EVALUATIONS} evaluations, {seeds} seeds", header, rows)],
            packages=PACKAGES, notes=[f"significantly worse on {bad} of {len(names)}: "
                                      f"{'holds' if not bad else 'FALLS SHORT'}"])


if __name__ == "__main__":
    main()
