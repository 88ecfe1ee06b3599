"""The problems of the optimizer benchmark, by name, each with its best known value.

The first word of a name says which module of MODULES makes it (see there for the rest of the name);
names of a plugin file's ``PROBLEMS`` come before.
"""

from __future__ import annotations

import datetime
import importlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.files import whole_file
from trajopt.objectives.base import Objective
from trajopt.optimize.plugins import mapping_of_file
from trajopt.problem import load_problem
from trajopt.solution import search_objective
from trajopt.sweeps.store import Store

MODULES = (  # each has FAMILIES: first word of a name -> Family; loaded when a problem is asked for
    "trajopt.systems.smdw.bench_problems",
    "trajopt.systems.powerbot.bench_problems",
    "trajopt.systems.asoc.bench_problems",
    "trajopt.bench.functions",
)
_SAMPLES = 200  # random points whose median cost is where targets start, chosen
_SEED = 20_000  # of those points, chosen


@dataclass(frozen=True)
class Family:
    """Problems whose names begin with one word.

    ``make(rest, root)`` builds objective and bounds (d, 2) from the rest of a name and the folder
    with problem files. ``labels``: name in the report -> what the names of its problems look like.
    ``solution(rest)``: best cost and who published it, where that is known from elsewhere.
    """

    make: Callable[[str, Path], tuple[Objective, Array]]
    labels: Mapping[str, str]
    solution: Callable[[str], tuple[float, str]] | None = None


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
    """Objective and bounds (d, 2) of the problem called ``name``, or in the problem file of that
    name; ``root`` is the folder with problem files."""
    for file in plugins:
        offered = mapping_of_file(file, "PROBLEMS")
        if name in offered:
            objective, bounds = offered[name]()
            return objective, np.asarray(bounds, dtype=np.float64)
    if name.endswith(".toml"):  # a problem file
        searched = search_objective(load_problem(name))
        return searched, searched.bounds
    first, _, rest = name.partition("/")
    known = families()
    if first not in known:
        expected = "a name that starts with " + ", ".join(f"{word}/" for word in known)
        raise ArgumentError("problem", name, expected)
    return known[first].make(rest, Path(root))


@lru_cache(maxsize=1)
def families() -> dict[str, Family]:
    """The families of problems by the first word of their names."""
    return {
        word: family
        for module in MODULES
        for word, family in importlib.import_module(module).FAMILIES.items()
    }


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
    best, found_by = float(known.get("cost", np.nan)), str(known.get("found_by", ""))
    first, _, rest = name.partition("/")
    family = families().get(first)
    if family is not None and family.solution is not None:
        best, found_by = family.solution(rest)
    return BenchProblem(
        name,
        objective,
        bounds,
        float(np.median(finite)) if finite.size else 1.0,
        best,
        found_by,
    )


@lru_cache(maxsize=1)
def best_known() -> dict[str, dict[str, Any]]:
    """Best known cost of each problem and who found it (best_known.json)."""
    text = (files("trajopt.bench") / "best_known.json").read_text(encoding="utf-8")
    found: dict[str, dict[str, Any]] = json.loads(text)
    return found


def best_costs(rows: Iterable[Mapping[str, Any]]) -> dict[str, tuple[float, str]]:
    """Best feasible cost of each problem: the known one, or what a row of this run found, and who
    found it."""
    best: dict[str, tuple[float, str]] = {}
    for row in rows:
        name = str(row["problem"])
        if name not in best:
            known = {
                "cost": row.get("best"),
                "found_by": row.get("found_by") or "best_known.json",
                **best_known().get(name, {}),
            }
            told = known["cost"] is not None and np.isfinite(known["cost"])
            best[name] = (float(known["cost"]), str(known["found_by"])) if told else (np.inf, "")
        cost = row.get("cost")
        if (
            row["status"] == "done"
            and row.get("feasible")
            and cost is not None
            and cost < best[name][0]
        ):
            best[name] = (float(cost), f"{row['optimizer']}, seed {row['seed']}")
    return best


def write_best_known(store: Store, file: str | Path) -> dict[str, dict[str, Any]]:
    """Merge the best rows of a benchmark into ``file`` (best_known.json), where they are better;
    what it then holds.

    Each entry has the cost, who found it (optimizer, seed, commit, date) and the decision
    variables.
    """
    place = Path(file)
    known: dict[str, dict[str, Any]] = (
        json.loads(place.read_text(encoding="utf-8")) if place.exists() else {}
    )
    last = store.runs()[-1]
    day = datetime.datetime.fromtimestamp(float(last["started"]), datetime.UTC).date().isoformat()
    where = f"commit {str(last.get('commit'))[:7]}, {day}"
    for row in store.frame().to_dict("records"):
        name, cost = str(row["problem"]), row.get("cost")
        if row["status"] != "done" or not row["feasible"] or cost is None or not np.isfinite(cost):
            continue
        elsewhere = row.get("best")
        told = elsewhere if elsewhere is not None and np.isfinite(elsewhere) else np.inf
        if cost < min(told, known.get(name, {}).get("cost", np.inf)):
            known[name] = {
                "cost": float(cost),
                "found_by": f"{row['optimizer']}, seed {int(row['seed'])}, {where}",
                "x": json.loads(row["x"]),
            }
    with whole_file(place) as part:
        part.write_text(json.dumps(dict(sorted(known.items())), indent=1) + "\n", encoding="utf-8")
    return known
