"""gbest PSO with constriction against pyswarms's, everything equal that pyswarms lets one set.

Run as ``python -m benchmarks.peers.pso_statistics``. Equal: coefficients, swarm size, iterations,
bounds, uniform start, velocities of zero, positions mirrored at the bounds, no clamping. Not equal:
the random numbers. A second table has our default, which also reverses the velocity of a particle
that was mirrored. Costs after 50 x 500 evaluations are compared by the one-sided rank-sum test (is
ours worse?) with Holm's correction over the functions.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.common import ResultTable, publish
from trajopt.bench.functions import CLASSICAL
from trajopt.bench.peers import equal_pyswarms
from trajopt.bench.problems import objective_named
from trajopt.bench.profiles import holm, no_worse
from trajopt.optimize.base import Budget, Optimizer
from trajopt.optimize.pso import constriction
from trajopt.optimize.search import minimize

PACKAGES = ("trajopt", "numpy", "scipy", "pyswarms", "pymoo")
LEVEL = 0.05
EVALUATIONS = 25_000
HEADER = (
    "function",
    "median",
    "pyswarms",
    "90 %",
    "pyswarms 90 %",
    "p worse (Holm)",
    "p better (Holm)",
    "PSO is",
)


def main() -> None:
    """Run everything and write out/benchmarks/pso_statistics.{md,csv}."""
    parser = argparse.ArgumentParser(
        description="gbest PSO against pyswarms's with equal parameters."
    )
    parser.add_argument("--quick", action="store_true", help="8 seeds, 5 dimensions")
    quick = parser.parse_args().quick
    seeds, dimension = (8, 5) if quick else (30, 10)
    names = [f"classical/{name}-{dimension}" for name in CLASSICAL]
    theirs = costs(names, equal_pyswarms(), seeds)
    tables, notes = [], []
    for title, method in (
        ("equal", replace(constriction(), boundary="mirror")),
        ("default", constriction()),
    ):
        rows, bad = compared(names, costs(names, method, seeds), theirs)
        tables.append(
            ResultTable(
                f"Cost after {EVALUATIONS} evaluations, {seeds} seeds, {title} boundary rule",
                HEADER,
                rows,
            )
        )
        notes.append(
            f"{title}: significantly worse on {bad} of {len(names)}: {'FALLS SHORT' if bad else 'holds'}"
        )
    publish("pso_statistics", tables, packages=PACKAGES, notes=notes)


def costs(names: list[str], method: Optimizer, seeds: int) -> list[list[float]]:
    """Final costs of each problem and seed."""
    found = []
    for name in names:
        objective, bounds = objective_named(name)
        search = partial(minimize, objective, bounds, optimizer=method, budget=Budget(EVALUATIONS))
        found.append([search(seed=seed).fun for seed in range(seeds)])
    return found


def compared(
    names: list[str], ours: list[list[float]], theirs: list[list[float]]
) -> tuple[list[tuple[str, ...]], int]:
    """Rows of a table, and on how many functions ours is significantly worse."""
    worse = holm([no_worse(a, b) for a, b in zip(ours, theirs, strict=True)])
    better = holm([no_worse(b, a) for a, b in zip(ours, theirs, strict=True)])
    rows = [
        (
            name,
            *(f"{np.median(c):.3g}" for c in (a, b)),
            *(f"{np.quantile(c, 0.9):.3g}" for c in (a, b)),
            f"{p:.3f}",
            f"{q:.3f}",
            "worse" if p < LEVEL else "better" if q < LEVEL else "no difference shown",
        )
        for name, a, b, p, q in zip(names, ours, theirs, worse, better, strict=True)
    ]
    return rows, int(np.sum(worse < LEVEL))


if __name__ == "__main__":
    main()
