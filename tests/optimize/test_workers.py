"""Slow objectives on several workers: the bits of one, in half the time."""

from __future__ import annotations

import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from trajopt.errors import ArgumentError
from trajopt.optimize.base import Budget, Status
from trajopt.optimize.search import minimize

Array = NDArray[np.float64]

BOX = [[-2.0, 3.0], [-1.5, 2.5]]


def rosenbrock(x: Array) -> float:
    return float((1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2)


def slow(x: Array) -> float:
    time.sleep(0.01)
    return rosenbrock(x)


@pytest.mark.parametrize("kind", ["int", "processes", "threads"])
def test_workers_give_the_bits_of_one(kind: str) -> None:
    def run(workers: Any) -> Any:
        return minimize(slow, BOX, optimizer="pso", workers=workers, seed=3, budget=Budget(60))

    alone = run(None)
    if kind == "int":
        together = run(2)
    else:
        pool = ProcessPoolExecutor if kind == "processes" else ThreadPoolExecutor
        with pool(2) as executor:
            together = run(executor)
    # looking for batches takes a call that workers do not make
    assert together.nfev == alone.nfev == 60
    n = min(len(alone.history.samples), len(together.history.samples))
    np.testing.assert_array_equal(alone.history.samples[:n], together.history.samples[:n])


def test_workers_take_closures_and_count_failures() -> None:
    limit = 0.5

    def fails(x: Array) -> float:
        if x[0] > limit:
            raise RuntimeError("not here")
        return float(x @ x)

    found = minimize(fails, BOX, optimizer="pso", workers=2, budget=Budget(200))
    assert 0 < found.failures < found.nfev == 200
    assert "not here" in found.first_failure
    for wrong in (0, "two", True, 1.5):
        with pytest.raises(ArgumentError, match="workers"):
            minimize(rosenbrock, BOX, workers=wrong)


def dies(x: Array) -> float:
    if x[0] > 2.5:
        import os

        os._exit(1)
    return float(x @ x)


def test_a_worker_that_dies_loses_nothing() -> None:
    found = minimize(dies, BOX, optimizer="pso", workers=2, budget=Budget(2000), seed=1)
    assert found.status is Status.INTERRUPTED
    assert "worker" in found.message
    assert np.isfinite(found.fun)


def test_workers_of_a_dask_cluster() -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, processes=False
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        found = minimize(slow, BOX, optimizer="pso", workers=client, budget=Budget(60), seed=3)
    assert found.nfev == 60
    alone = minimize(slow, BOX, optimizer="pso", workers=2, budget=Budget(60), seed=3)
    assert found.x.tobytes() == alone.x.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("d", [2, 3])  # 14 particles, and 15, of which one is left over
@pytest.mark.parametrize("kind", ["processes", "dask"])
def test_two_workers_halve_the_time_within_15_percent(kind: str, d: int) -> None:
    def seconds(workers: Any) -> float:
        box, budget = [[-2.0, 3.0]] * d, Budget(100)
        return minimize(fifty, box, optimizer="pso", workers=workers, budget=budget, seed=3).seconds

    if kind == "processes":
        both = min(seconds(2) for _ in range(2))  # the machine may be busy
    else:
        distributed = pytest.importorskip("distributed")
        with (
            distributed.LocalCluster(
                n_workers=2, threads_per_worker=1, dashboard_address=None
            ) as cluster,
            distributed.Client(cluster) as client,
        ):
            both = min(seconds(client) for _ in range(3))
    assert both <= 1.15 * 0.5 * seconds(None)


def fifty(x: Array) -> float:
    time.sleep(0.05)
    return rosenbrock(x)
