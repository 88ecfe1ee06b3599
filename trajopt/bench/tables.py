"""Rows of an optimizer benchmark as arrays and tables: running times to targets, shares, costs by
family."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from trajopt.arrays import Array
from trajopt.bench.comparison import TARGETS, budget_of
from trajopt.bench.problems import best_costs, families
from trajopt.bench.profiles import RunningTime, expected_running_time, time_to_targets
from trajopt.errors import ArgumentError

Row = Mapping[str, Any]
Unit = Literal["evaluations", "evaluations and gradients", "seconds"]

SOLVED = 1e-6  # share of reference - best left at which a problem counts as solved; chosen
NEAR = 1e-2  # the same for nearly solved; chosen
GRADIENT_METHODS = ("ipopt", "slsqp", "l-bfgs-b", "trust-constr", "least-squares")


class Share(NamedTuple):
    """How an optimizer did on a family: shares of searches ``solved`` and ``near`` (SOLVED, NEAR),
    the median share ``left``, the median ``seconds`` of a search, and how many ``searches``."""

    solved: float
    near: float
    left: float
    seconds: float
    searches: int


@dataclass(frozen=True)
class BenchTables:
    """Everything the report needs, from ``rows`` of a store that had one budget. Best costs are
    those of ``others`` too."""

    rows: Sequence[Row]
    others: Sequence[Row] = ()

    @classmethod
    def by_budget(cls, rows: Sequence[Row]) -> dict[str, BenchTables]:
        """The tables of each budget of a store's rows: those in evaluations first, each kind from
        small to large."""
        found: dict[str, list[Row]] = {}
        for row in rows:
            found.setdefault(str(row["budget"]), []).append(row)

        def size(text: str) -> tuple[bool, float]:
            budget = budget_of("budget", text)
            return budget.seconds is not None, budget.seconds or budget.evaluations or 0.0

        return {text: cls(found[text], rows) for text in sorted(found, key=size)}

    def __post_init__(self) -> None:
        if not self.done:
            raise ArgumentError("store", f"{len(self.rows)} rows", "at least one finished search")

    @cached_property
    def done(self) -> list[Row]:
        return [row for row in self.rows if row["status"] == "done"]

    @cached_property
    def failed(self) -> list[Row]:
        """Searches that raised, hung or died, and those whose objective failed at least once."""
        return [row for row in self.rows if row["status"] != "done" or row.get("failures")]

    @cached_property
    def problems(self) -> tuple[str, ...]:
        return tuple(sorted({str(row["problem"]) for row in self.done}))

    @cached_property
    def optimizers(self) -> tuple[str, ...]:
        return tuple(sorted({str(row["optimizer"]) for row in self.rows}))

    @property
    def seeds(self) -> str:
        """How many seeds problems have: "5", or "3 to 5"."""
        seen: dict[Any, set[Any]] = {}
        for row in self.rows:
            seen.setdefault(row["problem"], set()).add(row["seed"])
        counts = sorted({len(seeds) for seeds in seen.values()})
        return " to ".join(map(str, dict.fromkeys((counts[0], counts[-1]))))

    @cached_property
    def leaders(self) -> tuple[str, ...]:
        """All optimizers, those first that reach most targets in the mean over the families of problems; a search that
        is not there reached none."""
        reached = np.isfinite(self.times("evaluations"))
        shares = [reached[places].mean(axis=(0, 2, 3)) for places in self.families().values()]
        order = np.argsort(-np.mean(shares, axis=0), kind="stable")
        return tuple(self.optimizers[k] for k in order)

    @cached_property
    def best(self) -> dict[str, tuple[float, str]]:
        return best_costs([*self.rows, *self.others])

    @cached_property
    def dimension(self) -> Array:
        """(p,)"""
        found = {str(row["problem"]): float(row["dimension"]) for row in self.done}
        return np.array([found[name] for name in self.problems])

    def families(self) -> dict[str, list[int]]:
        """Positions of the problems of each family; what fits none is listed under its first
        word, or its file."""
        labels = {name: like for one in families().values() for name, like in one.labels.items()}
        found: dict[str, list[int]] = {name: [] for name in labels}
        for i, problem in enumerate(self.problems):
            for name, pattern in labels.items():
                if re.fullmatch(pattern, problem):
                    found[name].append(i)
                    break
            else:
                file = problem.endswith(".toml")
                word = Path(problem).name if file else problem.split("/")[0]
                found.setdefault(word, []).append(i)
        return {name: places for name, places in found.items() if places}

    def spread(self, problem: str) -> float:
        """``scale`` of a problem by its name."""
        rows = (row for row in (*self.done, *self.others) if row["status"] == "done")
        row = next(row for row in rows if row["problem"] == problem)
        return self.scale(problem, row)

    def scale(self, problem: str, row: Row) -> float:
        """Cost difference that shares count from: the median random point's cost less the best
        known one."""
        reference = row["reference"]
        spread = (reference if reference is not None else 1.0) - self.best[problem][0]
        return float(spread) if np.isfinite(spread) and spread > 0 else 1.0

    def gap(self, row: Row) -> float:
        """Share of ``scale`` that a search left; inf for infeasible results."""
        problem = str(row["problem"])
        if row["status"] != "done" or not row["feasible"] or row["cost"] is None:
            return float("inf")
        return max(0.0, float(row["cost"]) - self.best[problem][0]) / self.scale(problem, row)

    def times(self, unit: Unit, targets: Sequence[float] = TARGETS) -> Array:
        """(p, o, s, t): what each search had used at each target; inf: missed, NaN: no such search.

        A search that failed counts as missed.
        """
        seeds = sorted({int(row["seed"]) for row in self.rows})
        table = np.full(
            (len(self.problems), len(self.optimizers), len(seeds), len(targets)), np.nan
        )
        for row in self.rows:
            if str(row["problem"]) not in self.problems:
                continue
            place = (
                self.problems.index(str(row["problem"])),
                self.optimizers.index(str(row["optimizer"])),
                seeds.index(int(row["seed"])),
            )
            table[place] = (
                np.inf if row["status"] != "done" else self._row_times(row, unit, targets)
            )
        return table

    def _row_times(self, row: Row, unit: Unit, targets: Sequence[float]) -> Array:
        problem = str(row["problem"])
        best, scale = self.best[problem][0], self.scale(problem, row)
        used = np.asarray(
            row["at_seconds" if unit == "seconds" else "at_evaluations"], dtype=np.float64
        )
        if unit == "evaluations and gradients" and row["nfev"]:
            used = used * (1.0 + row["dimension"] * (row.get("gradients") or 0) / row["nfev"])
        return time_to_targets(used, row["at_cost"], best + scale * np.asarray(targets))

    def shares(self) -> dict[str, dict[str, Share]]:
        """Family -> optimizer -> how it did."""
        found: dict[str, dict[str, Share]] = {}
        for family, places in self.families().items():
            names = {self.problems[i] for i in places}
            found[family] = {}
            for optimizer in self.optimizers:
                rows = [
                    r for r in self.rows if r["problem"] in names and r["optimizer"] == optimizer
                ]
                if rows:
                    gaps = np.sort([self.gap(r) for r in rows])
                    seconds = [r["seconds"] for r in rows if r["status"] == "done"]
                    found[family][optimizer] = Share(
                        float(np.mean(gaps <= SOLVED)),
                        float(np.mean(gaps <= NEAR)),
                        float(gaps[(len(gaps) - 1) // 2]),
                        float(np.median(seconds)) if seconds else float("nan"),
                        len(rows),
                    )
        return found

    def construction(self) -> list[tuple[str, str, float]]:
        """Family, optimizer, median seconds to load, build and compile before a first search
        (processor time)."""
        found = []
        for family, places in self.families().items():
            names = {self.problems[i] for i in places}
            for optimizer in self.optimizers:
                times = [
                    r["construct_seconds"]
                    for r in self.done
                    if r["problem"] in names and r["optimizer"] == optimizer
                ]
                if times:
                    found.append((family, optimizer, float(np.median(times))))
        return found

    def running_times(self, share: float = 1e-5) -> list[tuple[str, str, RunningTime]]:
        """Expected running time in evaluations until ``share`` is left, of each problem and
        optimizer."""
        rng = np.random.default_rng(0)
        found = []
        for problem in self.problems:
            for optimizer in self.optimizers:
                rows = [
                    r for r in self.done if r["problem"] == problem and r["optimizer"] == optimizer
                ]
                if rows:
                    times = [float(self._row_times(r, "evaluations", [share])[0]) for r in rows]
                    used = [float(r["nfev"]) for r in rows]
                    found.append((problem, optimizer, expected_running_time(times, used, rng)))
        return found

    def compared(
        self, first: str, second: str, start: str = "classical/"
    ) -> list[tuple[str, Array, Array]]:
        """Problem, costs of each, where problems are named ``start``..."""
        found = []
        for problem in self.problems:
            ours, theirs = (
                np.array(
                    [
                        r["cost"]
                        for r in self.done
                        if r["problem"] == problem and r["optimizer"] == name
                    ]
                )
                for name in (first, second)
            )
            if problem.startswith(start) and len(ours) and len(theirs):
                found.append((problem, ours, theirs))
        return found
