"""All optimizers on all problems of [guzman2015], under one budget, scored by the objective
itself.

Run as ``python -m benchmarks.optimizers``. ``--quick`` takes fewer evaluations, seeds and starts.

Tables: every optimizer without actuator limits and through saturation and dead-zone; IPOPT from
random starts without the lattice; the package's PSO against pyswarms's.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from rich.progress import track

from benchmarks.common import PROBLEMS, ResultTable, publish
from trajopt.arrays import Array
from trajopt.objectives.terminal import TerminalObjective, terminal_objective, with_free
from trajopt.optimize.base import Budget, OptimizeResult
from trajopt.optimize.ipopt import Ipopt
from trajopt.optimize.lattice import lattice_points
from trajopt.optimize.search import minimize, optimizer_named, optimizer_names
from trajopt.problem import Problem, load_problem
from trajopt.systems.smdw.thesis import DURATIONS, through_drives

PACKAGES = ("trajopt", "numpy", "scipy", "numba", "casadi", "pyswarms")
EQUAL = 1e-9  # costs below this count as equal, chosen: exact to rounding
PARTICLES, ITERATIONS = 50, 500  # [guzman2015], Table 5.8
PYSWARMS_OPTIONS = {
    "c1": 0.5,
    "c2": 0.3,
    "w": 0.9,
}  # pyswarms 1.3 documentation, "Basic Optimization"


@dataclass(frozen=True)
class Effort:
    """How much a run of this benchmark may take."""

    budget: Budget
    seeds: int
    starts: int


FULL = Effort(Budget(evaluations=PARTICLES * ITERATIONS, seconds=2.0), 15, 20)
QUICK = Effort(Budget(evaluations=2_000, seconds=2.0), 3, 5)


def problems() -> list[Problem]:
    """The eight searches, in the order of their names, with drives that follow."""
    ideal = {"actuator": None, "infeasible": None}
    return [load_problem(PROBLEMS / "smdw" / f"{name}.toml", ideal) for name in sorted(DURATIONS)]


def short(problem: Problem) -> str:
    """File name of a problem without its ending."""
    return problem.source.rsplit("/", 1)[-1].removesuffix(".toml")


def without_limits(problem: Problem) -> TerminalObjective:
    """P2 free; P1 and P2 where no lattice point lies inside the space with P2 alone."""
    objective = terminal_objective(with_free(problem, "p2"))
    part = objective.affine_part()
    points, _ = lattice_points(part, objective.bounds[part.variables])
    return (
        objective if len(points) else terminal_objective(with_free(objective.problem, "p1", "p2"))
    )


def with_limits(problem: Problem, *free: str) -> TerminalObjective:
    """Saturation and dead-zone switched on."""
    return terminal_objective(with_free(through_drives(problem), *free))


def all_optimizers(
    title: str, objectives: Sequence[TerminalObjective], effort: Effort
) -> ResultTable:
    """One row a problem and optimizer."""
    rows = []
    for objective in objectives:
        for name in optimizer_names():
            if optimizer_named(name).needs - objective.provides:
                continue
            minimize(
                objective, objective.bounds, optimizer=name, budget=Budget(200, 2.0)
            )  # load and compile
            found = minimize(objective, objective.bounds, optimizer=name, budget=effort.budget)
            rows.append(
                (
                    short(objective.problem),
                    "+".join(objective.problem.spline.free),
                    name,
                    *_figures(found),
                )
            )
    header = (
        "problem",
        "free",
        "optimizer",
        "cost",
        "violation",
        "evaluations",
        "seconds",
        "status",
    )
    return ResultTable(title, header, rows)


def _figures(found: OptimizeResult) -> tuple[str, ...]:
    return (
        f"{found.fun:.2e}",
        f"{found.violation:.1e}",
        str(found.nfev),
        f"{found.seconds:.3f}",
        found.status.name.lower(),
    )


def ipopt_from_random(
    title: str, objectives: Sequence[TerminalObjective], effort: Effort, goal: float
) -> ResultTable:
    """Success rate of single random starts, and the time until the first success of one search."""
    rows = []
    for objective in objectives:
        rng = np.random.default_rng(0)
        low, high = objective.bounds.T
        single = Ipopt(starts=1, lattice_starts=0)
        costs = [
            minimize(objective, objective.bounds, optimizer=single, x0=rng.uniform(low, high)).fun
            for _ in range(effort.starts)
        ]
        whole = Ipopt(starts=effort.starts, lattice_starts=0)
        found = minimize(objective, objective.bounds, optimizer=whole)
        reached = sum(cost <= goal for cost in costs)
        rows.append(
            (
                short(objective.problem),
                "+".join(objective.problem.spline.free),
                f"{reached}/{len(costs)}",
                f"{min(costs):.1e}",
                f"{float(np.median(costs)):.1e}",
                f"{found.fun:.1e}",
                f"{found.seconds:.3f}",
            )
        )
    header = (
        "problem",
        "free",
        f"starts <= {goal:g}",
        "best start",
        "median start",
        "search cost",
        "search s",
    )
    return ResultTable(title, header, rows)


@dataclass(frozen=True)
class Search:
    """Final costs and median seconds of one method over the seeds."""

    costs: Array
    seconds: float


def own_swarm(objective: TerminalObjective, name: str, effort: Effort) -> Search:
    """The package's PSO, one search a seed."""
    found = [
        minimize(
            objective,
            objective.bounds,
            optimizer=name,
            seed=seed,
            budget=Budget(PARTICLES * _iterations(effort)),
        )
        for seed in range(effort.seeds)
    ]
    return Search(np.array([f.fun for f in found]), float(np.median([f.seconds for f in found])))


def pyswarms_swarm(objective: TerminalObjective, effort: Effort) -> Search:
    """pyswarms's GlobalBestPSO on the same objective; its random numbers are NumPy's global
    ones."""
    from pyswarms.single.global_best import GlobalBestPSO

    costs, seconds = [], []
    for seed in range(effort.seeds):
        np.random.seed(seed)  # noqa: NPY002 - the only seed pyswarms knows
        swarm = GlobalBestPSO(
            PARTICLES, objective.dimension, PYSWARMS_OPTIONS, bounds=tuple(objective.bounds.T)
        )
        started = time.perf_counter()
        _, best = swarm.optimize(
            lambda x: objective.evaluate(x).cost, _iterations(effort), verbose=False
        )
        seconds.append(time.perf_counter() - started)
        costs.append(float(objective.score(best).cost[0]))
    return Search(np.array(costs), float(np.median(seconds)))


def _iterations(effort: Effort) -> int:
    return (effort.budget.evaluations or PARTICLES) // PARTICLES


def swarms(
    title: str, objectives: Sequence[TerminalObjective], effort: Effort
) -> tuple[ResultTable, str]:
    """Median final cost of each PSO, and how often the package's best preset is at least as
    good."""
    presets = ("pso", "pso-thesis-first", "pso-thesis-enhanced")
    rows, at_least = [], dict.fromkeys(presets, 0)
    for objective in track(objectives, description=title, transient=True):
        peer = pyswarms_swarm(objective, effort)
        own = {name: own_swarm(objective, name, effort) for name in presets}
        median = float(np.median(peer.costs))
        for name in presets:
            mine = float(np.median(own[name].costs))
            at_least[name] += mine <= median or mine < EQUAL
        rows.append(
            (
                short(objective.problem),
                *(f"{float(np.median(own[n].costs)):.2e}" for n in presets),
                f"{median:.2e}",
                f"{own['pso'].seconds:.3f}",
                f"{peer.seconds:.3f}",
            )
        )
    best = max(presets, key=lambda name: at_least[name])
    note = f"{title}: {best} is at least as good as pyswarms on {at_least[best]} of {len(objectives)} problems."
    return ResultTable(title, ("problem", *presets, "pyswarms", "pso s", "pyswarms s"), rows), note


def main() -> None:
    """Run everything and write out/benchmarks/optimizers.{md,csv}."""
    parser = argparse.ArgumentParser(description="All optimizers on all SMDW problems.")
    parser.add_argument("--quick", action="store_true", help="fewer evaluations, seeds and starts")
    effort = QUICK if parser.parse_args().quick else FULL
    every = problems()
    free = [without_limits(problem) for problem in every]
    hard = [with_limits(problem, "p1", "p2", "heading") for problem in every]
    p2_free = [terminal_objective(with_free(problem, "p2")) for problem in every]
    p2_hard = [with_limits(problem, "p2") for problem in every]
    first, note = swarms("PSO over P2, no actuator limits (median cost)", p2_free, effort)
    second, other = swarms(
        "PSO over P2, saturation 30 and dead-zone 2.3 rad/s (median cost)", p2_hard, effort
    )
    tables = [
        all_optimizers("Without actuator limits", free, effort),
        all_optimizers("Saturation 30 rad/s, dead-zone 2.3 rad/s", hard, effort),
        ipopt_from_random("IPOPT from random starts, no actuator limits", free, effort, 1e-6),
        ipopt_from_random(
            "IPOPT from random starts, saturation and dead-zone",
            hard,
            replace(effort, starts=effort.starts // 2),
            1e-6,
        ),
        first,
        second,
    ]
    publish(
        "optimizers",
        tables,
        packages=PACKAGES,
        notes=[
            f"Budget of each search: {effort.budget.evaluations} evaluations, {effort.budget.seconds:g} s. Costs are "
            f"recomputed without grid error. pyswarms: GlobalBestPSO, {PYSWARMS_OPTIONS}, {PARTICLES} particles x "
            f"{_iterations(effort)} iterations, {effort.seeds} seeds.",
            note,
            other,
        ],
    )


if __name__ == "__main__":
    main()
