"""The problems of the optimizer benchmark, by name, each with its best known value.

Names: ``smdw/<file>/<free>`` and ``smdw/<file>/<free>/limits`` (a problem file in a decision space,
without and with actuator limits); ``random-smdw/<seed>/<free>[/limits]``;
``corridor/<seed>/length`` or ``/duration`` (see ``route_problems``); ``powerbot/<file>``;
``asoc/<soil>``; ``classical/<function>-<d>``; ``more-wild/<name>``; whatever a plugin file's
``PROBLEMS`` offers. ``<free>`` joins names with "+".
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError, MissingDependencyError
from trajopt.objectives.base import Capability, Evaluation, Objective
from trajopt.optimize.functions import FunctionObjective
from trajopt.optimize.plugins import mapping_of_file

CLASSICAL = (
    "ackley",
    "griewank",
    "rastrigin",
    "rosenbrock",
    "schwefel",
    "zakharov",
)  # names in pymoo
_SAMPLES = 200  # random points whose median cost is where targets start, chosen
_SEED = 20_000  # of those points, chosen


@dataclass(frozen=True)
class BenchProblem:
    """An objective within bounds (d, 2). ``reference``: cost that targets count from, at the median
    random point.

    ``best`` is the best known cost, ``found_by`` who found it (empty: not known).
    """

    name: str
    objective: Objective
    bounds: Array
    reference: float
    best: float
    found_by: str


def bench_problem(name: str, plugins: tuple[str, ...] = (), root: str = "problems") -> BenchProblem:
    """The problem called ``name`` with its reference and best known cost; evaluates the objective
    at random points.

    Raises ArgumentError for an unknown name, MissingDependencyError where a package that ships it
    is missing.
    """
    return _referenced(name, *objective_named(name, plugins, root))


def objective_named(
    name: str, plugins: tuple[str, ...] = (), root: str = "problems"
) -> tuple[Objective, Array]:
    """Objective and bounds (d, 2) of the problem called ``name``; ``root`` is the folder with
    problem files."""
    family, _, rest = name.partition("/")
    makers: dict[str, Callable[[str], tuple[Objective, Array]]] = {
        "smdw": lambda text: _smdw(text, root),
        "random-smdw": lambda text: _random_smdw(text, root),
        "corridor": _corridor,
        "powerbot": lambda text: _powerbot(text, root),
        "asoc": _asoc,
        "classical": _classical,
        "more-wild": _more_wild,
    }
    for file in plugins:
        offered = mapping_of_file(file, "PROBLEMS")
        if name in offered:
            objective, bounds = offered[name]()
            return objective, np.asarray(bounds, dtype=np.float64)
    if family not in makers:
        raise ArgumentError(
            "problem", name, "a name that starts with " + ", ".join(f"{m}/" for m in makers)
        )
    return makers[family](rest)


def _referenced(name: str, objective: Objective, bounds: Array) -> BenchProblem:
    bounds = np.asarray(bounds, dtype=np.float64)
    sample = np.random.default_rng(_SEED).uniform(
        bounds[:, 0], bounds[:, 1], (_SAMPLES, len(bounds))
    )
    try:
        cost = np.asarray(objective.evaluate(sample).cost)
    except (
        Exception
    ):  # a plugin's objective may fail in any way: it is judged by its rows, not here
        cost = np.full(1, np.nan)
    finite = cost[np.isfinite(cost)]
    known = best_known().get(name, {})
    if name.startswith("more-wild/"):
        known = {
            "cost": _more_wild_set()[name.removeprefix("more-wild/")]["solution"]["value"],
            "found_by": "optimagic's table of solutions",
        }
    return BenchProblem(
        name,
        objective,
        bounds,
        float(np.median(finite)) if finite.size else 1.0,
        float(known.get("cost", np.nan)),
        str(known.get("found_by", "")),
    )


@lru_cache(maxsize=1)
def best_known() -> dict[str, dict[str, Any]]:
    """Best known cost of each problem and who found it (best_known.json)."""
    text = (files("trajopt.bench") / "best_known.json").read_text(encoding="utf-8")
    found: dict[str, dict[str, Any]] = json.loads(text)
    return found


def _smdw(text: str, root: str) -> tuple[Objective, Array]:
    from trajopt.problem.search import Problem, load_problem

    stem, free, limited = _parts(text)
    problem = load_problem(Path(root) / "smdw" / f"{stem}.toml")
    if not isinstance(problem, Problem):
        raise ArgumentError("problem", f"smdw/{text}", "a problem with a terminal objective")
    return _terminal(problem, free, limited)


def _parts(text: str) -> tuple[str, str, bool]:
    parts = text.split("/")
    if len(parts) not in (2, 3) or (len(parts) == 3 and parts[2] != "limits"):
        raise ArgumentError("problem", text, "<name>/<free> or <name>/<free>/limits")
    return parts[0], parts[1], len(parts) == 3


def _terminal(problem: Any, free: str, limited: bool) -> tuple[Objective, Array]:
    from trajopt.objectives.terminal import terminal_objective, with_free

    changed = problem.replace(actuator={"enabled": limited}, objective={"kind": "terminal"})
    objective = terminal_objective(with_free(changed, *free.split("+")))
    return objective, objective.bounds


def _random_smdw(text: str, root: str) -> tuple[Objective, Array]:
    """Scenario 1's robot and space with a goal pose, wheel angles and a pair of wheels drawn from
    the seed."""
    from trajopt.problem.search import Problem, load_problem

    seed, free, limited = _parts(text)
    problem = load_problem(Path(root) / "smdw" / "scenario_1_forward35.toml")
    if not isinstance(problem, Problem):
        raise ArgumentError("problem", f"random-smdw/{text}", "a problem with a terminal objective")
    rng = np.random.default_rng(int(seed))
    pose = rng.uniform(
        [1.0, -1.0, 0.3], [2.8, 1.0, 1.5]
    )  # m, m, rad; far enough and turning, chosen
    pose[2] *= rng.choice([-1.0, 1.0])
    pairs = (
        ["front-left", "front-right"],
        ["front-left", "rear-left"],
        ["front-right", "rear-right"],
        ["rear-left", "rear-right"],
    )
    goal = {
        "pose": pose.tolist(),
        "wheels": rng.uniform(-np.pi, np.pi, 4).tolist(),
        "critical": pairs[int(rng.integers(len(pairs)))],
    }
    return _terminal(problem.replace(goal=goal), free, limited)


def _corridor(text: str) -> tuple[Objective, Array]:
    from trajopt.bench.route_problems import random_corridor

    seed, _, kind = text.partition("/")
    if not seed.isdigit() or kind not in ("length", "duration"):
        raise ArgumentError(
            "problem", f"corridor/{text}", "corridor/<seed>/length or corridor/<seed>/duration"
        )
    objective = random_corridor(int(seed), kind)  # type: ignore[arg-type]
    return objective, objective.bounds


def _powerbot(text: str, root: str) -> tuple[Objective, Array]:
    from trajopt.bench.route_problems import moved_knots

    objective = moved_knots(Path(root) / "powerbot" / f"{text}.toml")
    return objective, objective.bounds


def _asoc(text: str) -> tuple[Objective, Array]:
    from trajopt.systems.asoc.design import AsocDesign
    from trajopt.systems.asoc.soil import soil_named

    design = AsocDesign(soil_named(text))
    return design, design.bounds


def _classical(text: str) -> tuple[Objective, Array]:
    name, _, dimension = text.rpartition("-")
    if name not in CLASSICAL or not dimension.isdigit() or int(dimension) < 2:
        raise ArgumentError(
            "problem", f"classical/{text}", f"one of {', '.join(CLASSICAL)}, then -<d> with d >= 2"
        )
    try:
        from pymoo.problems import get_problem
    except ImportError:
        raise MissingDependencyError("pymoo", "optimizers", "the classical functions") from None
    shipped = get_problem(name, n_var=int(dimension))
    low, high = np.asarray(shipped.xl, dtype=np.float64), np.asarray(shipped.xu, dtype=np.float64)
    # A fifth is cut off on one side, or the optimum is the middle, where DIRECT and local methods
    # start. Chosen.
    bounds = np.column_stack([low + 0.2 * (high - low), high])

    def value(x: Array) -> Array:
        return np.asarray(shipped.evaluate(x), dtype=np.float64)[:, 0]

    return FunctionObjective(value, int(dimension), batch=True), bounds


@lru_cache(maxsize=1)
def _more_wild_set() -> dict[str, Any]:
    try:
        from optimagic.benchmarking.get_benchmark_problems import get_benchmark_problems
    except ImportError:
        raise MissingDependencyError("optimagic", "optimizers", "the Moré-Wild problems") from None
    found: dict[str, Any] = get_benchmark_problems("more_wild")  # type: ignore[no-untyped-call]
    return found


def more_wild_names() -> tuple[str, ...]:
    """Names of the Moré-Wild problems, as ``more-wild/<name>``."""
    return tuple(f"more-wild/{name}" for name in _more_wild_set())


def _more_wild(text: str) -> tuple[Objective, Array]:
    shipped = _more_wild_set()
    if text not in shipped:
        raise ArgumentError("problem", f"more-wild/{text}", "one of " + ", ".join(shipped))
    start = np.asarray(shipped[text]["inputs"]["params"], dtype=np.float64)
    # The set is unconstrained; the contract asks for bounds: +-10 around the published start,
    # chosen.
    reach = np.maximum(10.0, 2.0 * np.abs(start))
    return SumOfSquares(shipped[text]["inputs"]["fun"], len(start)), np.column_stack(
        [start - reach, start + reach]
    )


@dataclass(frozen=True)
class SumOfSquares:
    """|r(x)|^2 of a residual function (d,) -> (m,), with its residuals for least-squares
    methods."""

    function: Callable[[Array], Array]
    dimension: int

    @property
    def provides(self) -> frozenset[Capability]:
        return frozenset({Capability.RESIDUALS})

    @property
    def constrained(self) -> bool:
        return False

    def evaluate(self, candidates: Array) -> Evaluation:
        with np.errstate(
            all="ignore"
        ):  # far from the start these functions overflow; the run counts that
            cost = np.array([float(np.sum(np.square(self.function(row)))) for row in candidates])
        return Evaluation(cost, np.zeros(len(candidates)))

    def score(self, candidate: Array) -> Evaluation:
        return self.evaluate(candidate[None])

    def residuals(self, z: Array, turns: Any, *, exact: bool = False) -> list[Array]:  # noqa: ARG002 - the protocol
        return list(np.column_stack([self.function(row) for row in np.atleast_2d(z.T)])[:, None, :])

    def residual_gains(self) -> Array:
        return np.ones(())

    def nearest_turns(self, candidates: Array) -> Array:
        return np.zeros((len(candidates), 0))

    def coarse(self) -> SumOfSquares:
        return self
