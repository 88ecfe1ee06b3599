"""gbest PSO is statistically no worse than pyswarms's with equal parameters; the test finds a PSO
that is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from trajopt.arrays import Array
from trajopt.bench.peers import equal_pyswarms
from trajopt.bench.profiles import superiority
from trajopt.optimize.base import Budget, Optimizer
from trajopt.optimize.pso import constriction
from trajopt.optimize.search import minimize

pytest.importorskip("pyswarms")


SEEDS, DIMENSION, EVALUATIONS = 25, 6, 5_000
BOX = np.tile([-3.0, 5.0], (DIMENSION, 1))  # optima off the middle


def sphere(x: Array) -> Array:
    return np.asarray((x * x).sum(axis=1))


def rastrigin(x: Array) -> Array:
    return np.asarray((x * x - 10.0 * np.cos(2 * np.pi * x) + 10.0).sum(axis=1))


def rosenbrock(x: Array) -> Array:
    return np.asarray(
        (100.0 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1.0 - x[:, :-1]) ** 2).sum(axis=1)
    )


def ackley(x: Array) -> Array:
    return np.asarray(
        20.0
        - 20.0 * np.exp(-0.2 * np.sqrt((x * x).mean(axis=1)))
        + np.e
        - np.exp(np.cos(2 * np.pi * x).mean(axis=1))
    )


EQUAL = replace(constriction(), boundary="mirror")
FUNCTIONS: tuple[Callable[[Array], Array], ...] = (sphere, rastrigin, rosenbrock, ackley)


@pytest.fixture(scope="module")
def theirs() -> list[list[float]]:
    return costs(equal_pyswarms())


def costs(method: Optimizer) -> list[list[float]]:
    return [
        [
            minimize(f, BOX, optimizer=method, seed=seed, budget=Budget(EVALUATIONS)).fun
            for seed in range(SEEDS)
        ]
        for f in FUNCTIONS
    ]


def verdicts(method: Optimizer, theirs: list[list[float]]) -> list[str]:
    return [
        superiority(a, b, of=len(FUNCTIONS)).verdict
        for a, b in zip(costs(method), theirs, strict=True)
    ]


def test_not_significantly_worse_on_any_function(theirs: list[list[float]]) -> None:
    assert not any("worse" in verdict for verdict in verdicts(EQUAL, theirs))


def test_an_undamped_swarm_is_found_out(theirs: list[list[float]]) -> None:
    assert set(verdicts(replace(EQUAL, inertia=0.95), theirs)) == {"worse"}
