"""The swarm and ``auto`` against other packages' methods, on functions nobody tuned them on.

Run as ``python -m benchmarks.peers.swarms``. A method gets 1,000 d evaluations of every function in
2, 5, 10 and 20 dimensions; what counts is the share of 51 targets, 1e2 to 1e-8 above the optimum
and evenly spread in the exponent, that it has reached by then. The functions that the swarm was
tuned on stand beside those that were set aside before (``swarm_functions``).
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator

from benchmarks.common import ResultTable, publish
from benchmarks.peers.swarm_functions import HELD_OUT, TRAINING, instance
from trajopt.arrays import Array
from trajopt.bench.peers import Pymoo
from trajopt.objectives.base import Capability
from trajopt.optimize.base import Budget, Status
from trajopt.optimize.run import Run
from trajopt.optimize.search import minimize

PACKAGES = ("trajopt", "numpy", "scipy", "pymoo", "cma")
DIMENSIONS = (2, 5, 10, 20)
TARGETS = 10.0 ** np.linspace(2, -8, 51)


@dataclass(frozen=True)
class _Peer:
    """Another package's method behind the contract."""

    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = True
    name: str
    drive: Callable[[Callable[[Array], float], int, int], Any]

    def search(
        self,
        run: Run,
        x0: Array | None,  # noqa: ARG002 - starts on its own
        rng: Generator,
    ) -> tuple[Status, str]:
        self.drive(run.cost, len(run.bounds), int(rng.integers(1, 2**31)))
        return Status.CONVERGED, "it has ended by itself"


def _de(cost: Callable[[Array], float], d: int, seed: int) -> Any:
    from scipy.optimize import differential_evolution

    box = [(-5.0, 5.0)] * d
    return differential_evolution(
        cost, box, seed=seed, maxiter=10**6, polish=False, tol=0.0, atol=0.0
    )


def _ipop(cost: Callable[[Array], float], d: int, seed: int) -> Any:
    import cma

    rng = np.random.default_rng(seed)
    options = {"bounds": [[-5.0] * d, [5.0] * d], "verbose": -9, "seed": seed}
    return cma.fmin2(cost, lambda: rng.uniform(-5, 5, d), 3.0, options, restarts=9)


METHODS: tuple[Any, ...] = (
    "pso",
    "pso-gbest",
    "pso-ring",
    "auto",
    "cma-es",
    Pymoo(),
    _Peer("scipy-de", _de),
    _Peer("pycma-ipop", _ipop),
)


def main() -> None:
    """Run everything and write out/benchmarks/swarms.{md,csv}."""
    parser = argparse.ArgumentParser(description="Swarms on held-out functions.")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--methods", nargs="+", help="only these")
    asked = parser.parse_args()
    warnings.filterwarnings("ignore", module="cma")
    rows = []
    for method in METHODS:
        name = method if isinstance(method, str) else method.name
        if asked.methods and name not in asked.methods:
            continue
        found = [shares(method, list(names), asked.seeds) for names in (TRAINING, HELD_OUT)]
        per_dimension = found[1].mean(axis=(0, 2))
        rows.append(
            (
                name,
                *(f"{share.mean():.3f}" for share in found),
                *(f"{s:.3f}" for s in per_dimension),
            )
        )
        print(*rows[-1], flush=True)
    header = ("method", "training", "held out", *(f"held out, {d}-D" for d in DIMENSIONS))
    title = f"Share of 51 targets reached in 1,000 d evaluations, {asked.seeds} instances each"
    publish("swarms", [ResultTable(title, header, rows)], packages=PACKAGES)


def shares(method: Any, names: Sequence[str], seeds: int) -> Array:
    """(functions, dimensions, seeds): the share of targets reached."""
    found = np.empty((len(names), len(DIMENSIONS), seeds))
    for i, name in enumerate(names):
        for j, d in enumerate(DIMENSIONS):
            for seed in range(seeds):
                objective, bounds = instance(name, d, seed)
                budget = Budget(evaluations=1000 * d, target=float(TARGETS[-1]))
                result = minimize(objective, bounds, optimizer=method, seed=seed, budget=budget)
                found[i, j, seed] = (result.fun <= TARGETS).mean()
    return found


if __name__ == "__main__":
    main()
