"""gbest PSO with constriction against pyswarms's, everything equal that pyswarms lets one set.

Run as ``python -m benchmarks.peers.pso_statistics``. Equal: coefficients, swarm size, iterations,
bounds, uniform start, velocities of zero, positions mirrored at the bounds, no clamping. Not equal:
the random numbers. A second table has our default, which also reverses the velocity of a particle
that was mirrored. Costs after 50 x 500 evaluations are compared by the probability that ours is the
lower, with a two-sided interval of 95 % for all functions together; equal means that it lies within
0.15 of one half.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.common import ResultTable, publish
from trajopt.bench.answers import COMPARED, compared
from trajopt.bench.functions import CLASSICAL
from trajopt.bench.peers import equal_pyswarms
from trajopt.bench.problems import objective_named
from trajopt.optimize.base import Budget, Optimizer
from trajopt.optimize.pso import constriction
from trajopt.optimize.search import minimize

PACKAGES = ("trajopt", "numpy", "scipy", "pyswarms", "pymoo")
EVALUATIONS = 25_000


def main() -> None:
    """Run everything and write out/benchmarks/pso_statistics.{md,csv}."""
    parser = argparse.ArgumentParser(
        description="gbest PSO against pyswarms's with equal parameters."
    )
    parser.add_argument("--quick", action="store_true", help="8 seeds, 5 dimensions")
    quick = parser.parse_args().quick
    seeds, dimension = (8, 5) if quick else (100, 10)
    names = [f"classical/{name}-{dimension}" for name in CLASSICAL]
    theirs = costs(names, equal_pyswarms(), seeds)
    tables, notes = [], []
    for rule, method in (
        ("the same", replace(constriction(), boundary="mirror")),
        ("our default", constriction()),
    ):
        found = costs(names, method, seeds)
        rows = compared(
            [(n, np.array(a), np.array(b)) for n, a, b in zip(names, found, theirs, strict=True)]
        )
        title = f"Cost after {EVALUATIONS:,} evaluations, {seeds} seeds each, boundary rule: {rule}"
        tables.append(ResultTable(title, COMPARED, rows))
        said = [row[-1] for row in rows]
        notes.append(f"{rule}: " + ", ".join(f"{said.count(v)} {v}" for v in sorted(set(said))))
    publish("pso_statistics", tables, packages=PACKAGES, notes=notes)


def costs(names: list[str], method: Optimizer, seeds: int) -> list[list[float]]:
    """Final costs of each problem and seed."""
    found = []
    for name in names:
        objective, bounds = objective_named(name)
        search = partial(minimize, objective, bounds, optimizer=method, budget=Budget(EVALUATIONS))
        found.append([search(seed=seed).fun for seed in range(seeds)])
    return found


if __name__ == "__main__":
    main()
