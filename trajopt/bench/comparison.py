"""The optimizer benchmark: every optimizer on every problem with every seed, as the cases of a
sweep.

The sweep makes it resumable (a row is stored whole or not at all), runs each case in a process of
its own that may die or hang without harm to others, and records versions, commit and host.
Optimizers never score themselves: a row's cost and violation are recomputed by the objective at the
final candidate.
"""

from __future__ import annotations

import json
import re
import time
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.bench.functions import more_wild_names
from trajopt.bench.problems import BenchProblem, bench_problem, objective_named
from trajopt.errors import ArgumentError
from trajopt.optimize.base import FEASIBLE, Budget, Optimizer, OptimizeResult
from trajopt.optimize.plugins import mapping_of_file
from trajopt.optimize.search import minimize, optimizer_named
from trajopt.provenance import processor
from trajopt.sweeps.cases import Case
from trajopt.sweeps.drive import Progress
from trajopt.sweeps.store import Store
from trajopt.sweeps.sweeps import Old, sweep

TARGETS = tuple(
    10.0**-k for k in range(1, 10)
)  # shares of reference - best still left; Moré and Wild's tau
_SEEDS_IN_A_ROW = 5  # chosen
# Of a problem file unless told otherwise, those that suit it: chosen, one of each kind.
USUAL = (
    *("auto", "pso", "pso-gbest", "cma-es", "differential-evolution", "lattice", "newton"),
    *("ipopt", "ipopt+newton", "slsqp", "trust-constr", "cobyqa", "l-bfgs-b", "nelder-mead"),
)
_WARM = Budget(evaluations=60)  # a first search that loads and compiles, timed apart; chosen


@dataclass(frozen=True)
class BenchPlan:
    """What a benchmark runs: ``seeds`` each for stochastic optimizers, one for others.

    A search may use ``evaluations`` and ``seconds`` of processor time, or runs once under each of
    ``budgets``: texts like "0.15 s", "1000 evaluations", "1000 evaluations, 0.15 s". ``longer``
    gives so many times the seconds to problems whose names start with a text. ``time_limit``
    (wall-clock s) is when a case counts as hanging.
    """

    title: str
    problems: tuple[str, ...]
    optimizers: tuple[str, ...]
    seeds: int = 15
    evaluations: int = 25_000  # 50 particles x 500 iterations, [guzman2015] Table 5.8
    seconds: float = 10.0
    longer: Mapping[str, float] = field(default_factory=dict)
    budgets: tuple[str, ...] = ()
    time_limit: float = 60.0
    problem_root: str = "problems"
    plugins: tuple[str, ...] = ()

    def cases(self) -> list[dict[str, Any]]:
        """One case a problem, optimizer, budget and seed; optimizers that cannot work on a problem
        are left out."""
        budgets = self.budgets or (f"{self.evaluations} evaluations, {self.seconds:g} s",)
        makers = {name: named_optimizer(name, self.plugins) for name in self.optimizers}
        found = []
        for problem in self.problems:
            objective, _ = objective_named(problem, self.plugins, self.problem_root)
            for name, method in makers.items():
                if not suits(method, objective):
                    continue
                seeds = self.seeds if method.stochastic else 1
                found += [
                    {"problem": problem, "optimizer": name, "budget": budget, "seed": seed}
                    for budget in budgets
                    for seed in range(seeds)
                ]
        # Five seeds of everything first: what was built for a problem serves them all, and a run
        # that is stopped early leaves rows of all problems.
        return sorted(found, key=lambda case: case["seed"] // _SEEDS_IN_A_ROW)


def suits(method: Optimizer, objective: Any) -> bool:
    """Whether an optimizer can work on an objective."""
    if method.needs - objective.provides:
        return False
    if method.name == "lattice" and not hasattr(objective, "affine_part"):
        return False
    return not (objective.constrained and getattr(method, "only_bounds", False))


def named_optimizer(name: str, plugins: Iterable[str] = ()) -> Optimizer:
    """The optimizer called ``name``: of a plugin file, a peer package, or the package itself."""
    from trajopt.bench.peers import PEERS

    for file in plugins:
        offered = mapping_of_file(file, "OPTIMIZERS")
        if name in offered:
            made: Optimizer = offered[name]()
            return made
    return PEERS[name]() if name in PEERS else optimizer_named(name)


def load_bench(path: str | Path, plugins: Iterable[str | Path] = (), **changes: Any) -> BenchPlan:
    """Plan from a TOML file, or of one problem file. Raises ArgumentError naming the key that is
    wrong.

    "more-wild/*" among the problems stands for the whole set. ``changes`` are other values of the
    plan (optimizers, seeds, evaluations, seconds); those that are None change nothing.
    """
    try:
        data = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ArgumentError("bench file", str(path), f"a readable TOML file ({error})") from None
    if "robot" in data:
        title = f"{data.get('title', Path(path).stem)}: optimizers compared"
        data = {"title": title, "problems": [str(Path(path).resolve())], "optimizers": list(USUAL)}
    data.update({key: value for key, value in changes.items() if value is not None})
    known = sorted(f.name for f in fields(BenchPlan))
    for key in data.keys() - set(known):
        raise ArgumentError(f"{path}: {key}", data[key], "one of the keys " + ", ".join(known))
    for key in ("problems", "optimizers"):
        names = data.get(key)
        if not isinstance(names, list) or not names or not all(isinstance(v, str) for v in names):
            raise ArgumentError(f"{path}: {key}", names, "a list of names")
    for key in ("seeds", "evaluations", "seconds", "time_limit"):
        value = data.get(key, 1)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or value <= 0:
            raise ArgumentError(f"{path}: {key}", value, "a number > 0")
    longer = data.get("longer", {})
    if not isinstance(longer, dict) or not all(
        isinstance(v, (int, float)) and v > 0 for v in longer.values()
    ):
        expected = "a factor > 0 of the seconds by the start of a problem's name"
        raise ArgumentError(f"{path}: longer", longer, expected)
    if "budgets" in data:
        for key in data.keys() & {"evaluations", "seconds"}:
            raise ArgumentError(f"{path}: {key}", data[key], "left out beside budgets")
        data["budgets"] = tuple(data["budgets"]) if isinstance(data["budgets"], list) else ("",)
        for text in data["budgets"]:
            budget_of(f"{path}: budgets", text)
    files = [str(Path(p).resolve()) for p in (*data.pop("plugins", []), *plugins)]
    problems: list[str] = []
    for name in data.pop("problems"):
        problems += more_wild_names() if name == "more-wild/*" else [name]
    for file in files:
        problems += mapping_of_file(file, "PROBLEMS")
        data["optimizers"] += mapping_of_file(file, "OPTIMIZERS")
    return BenchPlan(
        str(data.pop("title", Path(path).stem)),
        tuple(dict.fromkeys(problems)),
        tuple(dict.fromkeys(data.pop("optimizers"))),
        plugins=tuple(files),
        **data,
    )


def budget_of(argument: str, text: Any, longer: float = 1.0) -> Budget:
    """The budget that a text like "1000 evaluations, 0.15 s" names, with ``longer`` times the
    seconds, which are those of the processor. Raises ArgumentError for other texts."""
    found = re.fullmatch(r"(?:(\d+) evaluations)?(?:(?:^|, )([\d.e+-]+) s)?", str(text))
    if not found or not str(text):
        expected = 'texts like "0.15 s", "1000 evaluations" or "1000 evaluations, 0.15 s"'
        raise ArgumentError(argument, text, expected)
    evaluations, seconds = found.groups()
    return Budget(
        int(evaluations) if evaluations else None,
        longer * float(seconds) if seconds else None,
        clock="cpu",
    )


@dataclass(frozen=True)
class BenchRun:
    """The sweep's run function: one search. ``longer``: as in the plan."""

    longer: tuple[tuple[str, float], ...]
    problem_root: str
    plugins: tuple[str, ...]

    def __call__(self, case: Case) -> dict[str, Any]:
        """One row. Loading, building and compiling are timed apart (``construct_seconds``)."""
        name, wall = str(case["problem"]), time.perf_counter()
        problem, method, construct = _built(
            name, str(case["optimizer"]), self.plugins, self.problem_root
        )
        fitting = [("", 1.0), *(entry for entry in self.longer if name.startswith(entry[0]))]
        times = max(fitting, key=lambda entry: len(entry[0]))[1]
        budget = budget_of("budgets", case["budget"], times)
        found = _search(problem, method, int(case["seed"]), budget)
        return {
            "dimension": problem.objective.dimension,
            "cost": found.fun,
            "violation": found.violation,
            "feasible": found.violation <= FEASIBLE,
            "nfev": found.nfev,
            "gradients": found.ngev,
            "hessians": found.nhev,
            "seconds": found.seconds,
            "wall_seconds": time.perf_counter() - wall,
            "construct_seconds": construct,
            "stop": found.status.name.lower(),
            "message": found.message,
            "failures": found.failures,
            "first_failure": found.first_failure,
            "reference": problem.reference,
            "best": problem.best,
            "found_by": problem.found_by,
            "cpu": processor(),
            "x": json.dumps(found.x.tolist()),
            **_history(problem, found),
        }


@lru_cache(maxsize=2)
def _built(
    name: str, optimizer: str, plugins: tuple[str, ...], root: str
) -> tuple[BenchProblem, Optimizer, float]:
    """Problem and optimizer, after a short search that loads and compiles what they need, and its
    CPU seconds.

    Kept for the seeds that follow in the same process.
    """
    started = time.process_time()
    problem, method = bench_problem(name, plugins, root), named_optimizer(optimizer, plugins)
    _search(problem, method, 0, _WARM)
    return problem, method, time.process_time() - started


def _search(problem: BenchProblem, method: Optimizer, seed: int, budget: Budget) -> OptimizeResult:
    return minimize(problem.objective, problem.bounds, optimizer=method, seed=seed, budget=budget)


def _history(problem: BenchProblem, found: OptimizeResult) -> dict[str, Any]:
    """Improvements of the feasible best, as short lists: evaluations, seconds, cost (thinned to 10
    a decade).

    The final candidate, which a method may have polished without evaluating it, ends the list.
    """
    h = found.history
    ok = h.violation <= FEASIBLE
    evaluations, seconds, cost = h.evaluations[ok].astype(float), h.seconds[ok], h.cost[ok]
    if (
        found.violation <= FEASIBLE
        and np.isfinite(found.fun)
        and (not len(cost) or found.fun < cost[-1])
    ):
        evaluations, seconds = np.append(evaluations, found.nfev), np.append(seconds, found.seconds)
        cost = np.append(cost, found.fun)
    floor = problem.best if np.isfinite(problem.best) else (cost[-1] if len(cost) else 0.0)
    decade = np.floor(10 * np.log10(np.maximum(cost - floor, 1e-16)))
    keep = np.ones(len(cost), bool)
    keep[:-1] = decade[:-1] != decade[1:]  # last of each step
    keep[:1] = True
    return {
        "at_evaluations": evaluations[keep].tolist(),
        "at_seconds": seconds[keep].tolist(),
        "at_cost": cost[keep].tolist(),
    }


def run_bench(
    plan: BenchPlan,
    store: str | Path,
    *,
    jobs: int = 1,
    retry_failed: bool = False,
    old: Old | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Store:
    """Run all cases that have no row in ``store`` yet (or only a failed one), ``jobs`` at a time;
    ``old`` as in ``sweep``."""
    longer = tuple(sorted(plan.longer.items()))
    run = BenchRun(longer, str(Path(plan.problem_root).resolve()), plan.plugins)
    about = {"longer": dict(longer), "plugins": list(plan.plugins)}
    return sweep(
        plan.cases(),
        run,
        executor=jobs,
        store=store,
        time_limit=plan.time_limit,
        problem=about,
        retry_failed=retry_failed,
        old=old,
        source=json.dumps(
            {"title": plan.title, "problems": plan.problems, "optimizers": plan.optimizers}
        ),
        progress=progress,
    )
