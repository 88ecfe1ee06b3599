"""Speed of swarm evaluation and of the whole PSO search, beside NumPy, pyswarms and pymoo.

Run as ``python -m benchmarks.peers.swarm_speed``. ``--quick`` repeats less. Each figure is the
least of several repeats in CPU time of this process on one thread, which other load on the machine
disturbs little.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from benchmarks.common import PROBLEMS, ResultTable, publish
from trajopt.arrays import Array
from trajopt.objectives.terminal import TerminalObjective, terminal_objective, with_free
from trajopt.optimize import swarm
from trajopt.optimize.base import Budget
from trajopt.optimize.pso import ParticleSwarm
from trajopt.optimize.search import minimize
from trajopt.problem import Problem, load_problem
from trajopt.systems.smdw.thesis import through_drives

PACKAGES = ("trajopt", "numpy", "numba", "pyswarms", "pymoo")
PARTICLES, ITERATIONS = 50, 500  # [guzman2015], Table 5.8
OVERHEAD = (40, 20, 500)  # particles, dimension, iterations
EQUAL = {"c1": 1.49618, "c2": 1.49618, "w": 0.7298}  # [clerc2002]
MINIMUM = {
    "numpy": 20.0,
    "numpy, heading free": 20.0,
    "search": 10.0,
    "overhead": 2.0,
}  # what the ratios are to reach


def best_of(function: Callable[[], Any], repeats: int) -> float:
    """Least CPU seconds of ``repeats`` calls, each of several runs where one is too short to
    measure."""
    function()
    started = time.perf_counter()
    function()
    inner = max(1, int(2e-3 / max(time.perf_counter() - started, 1e-6)))
    found = []
    for _ in range(repeats):
        start = time.process_time()
        for _ in range(inner):
            function()
        found.append((time.process_time() - start) / inner)
    return min(found)


def objective(*free: str) -> TerminalObjective:
    """Scenario 1 lateral through saturation and dead-zone."""
    problem = load_problem(PROBLEMS / "smdw" / "scenario_1_lateral.toml")
    assert isinstance(problem, Problem)
    return terminal_objective(with_free(through_drives(problem), *free))


def kernels(repeats: int) -> tuple[list[tuple[str, ...]], list[float]]:
    """Rows for one batch of 50 particles, and the ratios NumPy / compiled."""
    rows, ratios = [], []
    for free in (("p2",), ("p1", "p2"), ("p1", "p2", "heading")):
        asked = objective(*free)
        z = np.random.default_rng(0).uniform(*asked.bounds.T, size=(PARTICLES, asked.dimension))
        readable = best_of(partial(asked.evaluate_readable, z), max(3, repeats // 10))
        fast = best_of(partial(asked.evaluate, z), repeats)
        error = float(np.max(np.abs(asked.evaluate(z).cost - asked.evaluate_readable(z).cost)))
        times = (f"{seconds * 1e3:.3f}" for seconds in (readable, fast))
        rows.append(
            ("+".join(free), str(asked.steps), *times, f"{readable / fast:.1f}", f"{error:.1e}")
        )
        ratios.append(readable / fast)
    return rows, ratios


def searches(repeats: int) -> tuple[list[tuple[str, ...]], float]:
    """Rows for the whole search of 50 x 500 over P2, and the ratio pyswarms on NumPy / ours."""
    asked = objective("p2")
    budget = Budget(PARTICLES * ITERATIONS)
    ours = best_of(lambda: minimize(asked, asked.bounds, optimizer="pso", budget=budget), repeats)
    peer = best_of(
        lambda: _pyswarms(
            lambda x: asked.evaluate_readable(x).cost, asked.bounds, PARTICLES, ITERATIONS
        ),
        max(1, repeats // 3),
    )
    fair = best_of(
        lambda: _pyswarms(lambda x: asked.evaluate(x).cost, asked.bounds, PARTICLES, ITERATIONS),
        repeats,
    )
    rows = [
        ("trajopt pso", f"{ours:.3f}", "1.0"),
        ("pyswarms, NumPy objective", f"{peer:.3f}", f"{peer / ours:.1f}"),
        ("pyswarms, our compiled objective", f"{fair:.3f}", f"{fair / ours:.1f}"),
    ]
    return rows, peer / ours


def overhead(repeats: int) -> tuple[list[tuple[str, ...]], float]:
    """Rows for 40 particles x 20-D x 500 iterations on the sphere, and the ratio pyswarms /
    ours."""
    n, d, iterations = OVERHEAD
    box = np.tile([-5.0, 5.0], (d, 1))
    own = replace(ParticleSwarm(), particles=n)
    ours = best_of(
        lambda: minimize(_sphere, box, optimizer=own, budget=Budget(n * iterations)), repeats
    )
    peer = best_of(lambda: _pyswarms(_sphere, box, n, iterations), repeats)
    rows = [
        ("trajopt pso, history kept", f"{ours:.4f}", "1.0"),
        ("pyswarms", f"{peer:.4f}", f"{peer / ours:.2f}"),
    ]
    try:
        other = best_of(lambda: _pymoo(box, n, iterations), 1)
        rows.append(("pymoo", f"{other:.4f}", f"{other / ours:.1f}"))
    except ImportError:
        rows.append(("pymoo", "not installed", ""))
    for topology in ("gbest", "ring"):
        for kernel, told in ((_kernel, "numba loaded"), (lambda: None, "without numba")):
            method = replace(own, topology=topology)
            swarm._kernel = kernel  # type: ignore[assignment]
            seconds = best_of(
                lambda m=method: minimize(_sphere, box, optimizer=m, budget=Budget(n * iterations)),  # type: ignore[misc]
                repeats,
            )
            plain = best_of(partial(_plain, topology == "ring"), repeats)
            name = f"plain NumPy loop, {topology} / trajopt, {told}"
            rows.append((name, f"{plain:.4f}", f"{plain / seconds:.2f}"))
        swarm._kernel = _kernel
    return rows, peer / ours


_kernel = swarm._kernel


def _plain(ring: bool) -> float:
    """The same swarm as few lines of NumPy, without bounds checks, history, budget or statuses."""
    n, d, iterations = OVERHEAD
    rng, i = np.random.default_rng(0), np.arange(n)
    around = np.stack([(i - 1) % n, i, (i + 1) % n], axis=1)
    x = rng.uniform(-5.0, 5.0, (n, d))
    v, own, least = np.zeros((n, d)), x.copy(), np.full(n, np.inf)
    for _ in range(iterations):
        cost = _sphere(x)
        better = cost < least
        own[better], least[better] = x[better], cost[better]
        best = own[around[i, least[around].argmin(axis=1)]] if ring else own[least.argmin()]
        r, s = rng.random((2, n, d))
        v = EQUAL["w"] * v + EQUAL["c1"] * r * (own - x) + EQUAL["c2"] * s * (best - x)
        x = np.clip(x + v, -5.0, 5.0)
    return float(least.min())


def _sphere(x: Array) -> Array:
    return np.asarray((x * x).sum(axis=1))


def _pyswarms(function: Callable[[Array], Array], box: Array, n: int, iterations: int) -> float:
    from pyswarms.single.global_best import GlobalBestPSO

    np.random.seed(0)  # noqa: NPY002 - the only seed pyswarms knows
    cost, _ = GlobalBestPSO(n, len(box), EQUAL, bounds=tuple(box.T)).optimize(
        function, iterations, verbose=False
    )
    return float(cost)


def _pymoo(box: Array, n: int, iterations: int) -> float:
    from pymoo.algorithms.soo.nonconvex.pso import PSO
    from pymoo.core.problem import Problem as PymooProblem
    from pymoo.optimize import minimize as pymoo_minimize

    class Sphere(PymooProblem):  # type: ignore[misc]
        def _evaluate(self, x: Array, out: dict[str, Any], *_: Any, **__: Any) -> None:
            out["F"] = _sphere(x)[:, None]

    problem = Sphere(n_var=len(box), n_obj=1, xl=box[:, 0], xu=box[:, 1])
    return float(pymoo_minimize(problem, PSO(pop_size=n), ("n_gen", iterations), seed=0).F[0])


def main() -> None:
    """Run everything and write out/benchmarks/swarm_speed.{md,csv}."""
    parser = argparse.ArgumentParser(description="Speed of swarm evaluation and search.")
    parser.add_argument("--quick", action="store_true", help="fewer repeats")
    repeats = 5 if parser.parse_args().quick else 60
    kernel_rows, numpy_ratios = kernels(repeats)
    search_rows, search_ratio = searches(max(2, repeats // 10))
    overhead_rows, overhead_ratio = overhead(max(3, repeats // 6))
    tables = [
        ResultTable(
            f"One batch of {PARTICLES} particles, ms",
            (
                "free",
                "steps",
                "NumPy",
                "evaluate",
                "NumPy / evaluate",
                "difference",
            ),
            kernel_rows,
        ),
        ResultTable(
            f"Whole search, {PARTICLES} x {ITERATIONS}, s",
            ("search", "seconds", "ratio"),
            search_rows,
        ),
        ResultTable(
            "Overhead, {} x {}-D x {}, s".format(*OVERHEAD),
            ("package", "seconds", "ratio"),
            overhead_rows,
        ),
    ]
    ratios = {
        "numpy": numpy_ratios[0],
        "numpy, heading free": numpy_ratios[-1],
        "search": search_ratio,
        "overhead": overhead_ratio,
    }
    notes = [
        f"{name}: {value:.1f} times, wanted {MINIMUM[name]:g}: "
        f"{'holds' if value >= MINIMUM[name] else 'FALLS SHORT'}"
        for name, value in ratios.items()
    ]
    publish("swarm_speed", tables, packages=PACKAGES, notes=notes)


if __name__ == "__main__":
    main()
