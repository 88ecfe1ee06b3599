"""The contract every optimizer fulfils, and the recorder that enforces it.

An optimizer is a frozen dataclass of options with one method, ``minimize``. It never touches the
objective itself, only through a ``Run``, which keeps every optimizer to the same bounds, budget and
bookkeeping: it counts evaluations, keeps the history and the best candidate (Deb's feasibility
rule), treats an objective that raises or returns NaN as infeasible, and ends the search when the
budget is used up.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Literal, NoReturn, Protocol

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray, IntArray, as_numbers, require_positive, require_whole
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability, Evaluation, Objective
from trajopt.shown import Shown

FEASIBLE = 1e-9  # violation up to which a candidate counts as feasible (rounding), chosen
DEFAULT_EVALUATIONS = 25_000  # 50 particles x 500 iterations, [guzman2015] Table 5.8
_KEPT_SAMPLES = 50_000  # explored candidates kept for pictures


Progress = Callable[[int, float], None]  # called with evaluations used and the best cost


class Status(Enum):
    """Why a search ended, and what to do about it."""

    TARGET = "the target was reached"
    CONVERGED = "the method's own stopping rule was met"
    STALLED = "the method gave up before its own stopping rule was met; start it elsewhere, or loosen its tolerance"
    EVALUATIONS = "the budget of evaluations is used up; raise Budget.evaluations to search longer"
    SECONDS = "the budget of seconds is used up; raise Budget.seconds to search longer"
    INFEASIBLE = "no feasible candidate was found; widen the bounds or free more variables"
    FAILED = "the objective gave no finite cost anywhere it was asked; check the objective at x0"
    NO_EXACT = "no exact solution was found inside the bounds; the best feasible one is returned; free more variables"


@dataclass(frozen=True)
class Budget:
    """What a search may use: objective ``evaluations``, ``seconds``, and a cost ``target`` that
    ends it.

    ``clock`` says which seconds, also in histories and results: "wall", or "cpu" for processor time
    of this process, which other load on the machine does not change.
    """

    evaluations: int | None = DEFAULT_EVALUATIONS
    seconds: float | None = None
    target: float | None = None
    clock: Literal["wall", "cpu"] = "wall"

    def __post_init__(self) -> None:
        if self.evaluations is not None:
            expected = "a whole number >= 1, or None"
            require_whole("budget.evaluations", self.evaluations, 1, expected)
        if self.seconds is not None:
            require_positive("budget.seconds", self.seconds, "s, or None")
        if self.target is not None and np.isnan(
            as_numbers("budget.target", self.target, "a cost, or None", ())
        ):
            raise ArgumentError("budget.target", self.target, "a cost, or None")
        if self.clock not in ("wall", "cpu"):
            raise ArgumentError("budget.clock", self.clock, "wall or cpu")
        if self.evaluations is None and self.seconds is None:
            raise ArgumentError("budget", "unlimited", "a limit on evaluations or on seconds")


@dataclass(frozen=True)
class History:
    """Best so far each time it improved: evaluations used, seconds, cost, violation, each (h,).

    ``samples`` (m, d) are explored candidates in the order of evaluation (the first 50,000).
    """

    evaluations: IntArray
    seconds: Array
    cost: Array
    violation: Array
    samples: Array


@dataclass(frozen=True, repr=False)
class OptimizeResult(Shown):
    """Outcome of a search, in SciPy's names.

    ``fun`` and ``violation`` are recomputed by the objective at ``x`` after the search, more finely
    than the search saw it where the objective can (``search_fun`` is what the search saw).
    ``failures`` counts evaluations that raised or were not finite; ``first_failure`` says what the
    first one was. ``ngev`` counts exact gradients and ``nhev`` exact Hessians, which are not among
    ``nfev`` (finite differences are). ``seconds`` are those of the budget's clock, without
    ``construct_seconds``: what it took before to write a program in symbols, say.
    """

    x: Array
    fun: float
    violation: float
    search_fun: float
    nfev: int
    nit: int
    success: bool
    status: Status
    message: str
    optimizer: str
    history: History = field(repr=False)
    seconds: float
    failures: int = 0
    first_failure: str = ""
    ngev: int = 0
    nhev: int = 0
    construct_seconds: float = 0.0

    def __repr__(self) -> str:
        return (
            f"OptimizeResult({self.optimizer}, fun={self.fun:.6g}, success={self.success}, "
            f"{self.nfev} evaluations)"
        )


class Optimizer(Protocol):
    """A search method. ``needs`` lists what it asks of an objective; ``stochastic`` whether seeds
    matter."""

    @property
    def name(self) -> str: ...

    @property
    def needs(self) -> frozenset[Capability]: ...

    @property
    def stochastic(self) -> bool: ...

    def minimize(
        self,
        objective: Objective,
        bounds: ArrayLike,
        *,
        x0: ArrayLike | None = None,
        rng: Generator,
        budget: Budget,
        progress: Progress | None = None,
    ) -> OptimizeResult: ...


class _Stop(Exception):
    def __init__(self, status: Status) -> None:
        self.status = status


@dataclass
class Run:
    """One search: the only way from an optimizer to its objective. Mutable by nature; lives for one
    search."""

    objective: Objective
    bounds: Array
    budget: Budget
    on_progress: Progress | None = None
    nfev: int = 0
    nit: int = 0
    ngev: int = 0
    nhev: int = 0
    construct_seconds: float = 0.0
    failures: int = 0
    first_failure: str = ""
    best_x: Array | None = None
    best_cost: float = np.inf
    best_violation: float = np.inf
    _proposals: list[Array] = field(default_factory=list)
    _rows: list[tuple[int, float, float, float]] = field(default_factory=list)
    _samples: list[Array] = field(default_factory=list)
    _kept: int = 0
    _started: float = 0.0

    def __post_init__(self) -> None:
        self._started = self._now()

    # -- evaluating
    # -----------------------------------------------------------------------------------

    def evaluate(self, candidates: Array, *, inside: bool = False) -> Evaluation:
        """Cost and violation of candidates (n, d); the distance outside the bounds adds to the
        violation.

        ``inside`` says that all are within the bounds, which saves looking. Ends the search (by an
        exception the run catches itself) when the budget is used up or the target met.
        """
        candidates = np.ascontiguousarray(candidates, dtype=np.float64)
        wanted = len(candidates)
        if self.budget.evaluations is not None:
            candidates = candidates[: self.budget.evaluations - self.nfev]
        if len(candidates) == 0:
            self.stop(Status.EVALUATIONS)
        result = self._guarded(candidates)
        violation, low, high = result.violation, self.bounds[:, 0], self.bounds[:, 1]
        if not inside and ((candidates < low).any() or (candidates > high).any()):
            outside = np.maximum(low - candidates, candidates - high)
            violation = violation + np.maximum(outside, 0.0).sum(axis=1)
        self._record(candidates, result.cost, violation)
        if (
            self.budget.target is not None
            and self.best_violation <= FEASIBLE
            and self.best_cost <= self.budget.target
        ):
            self.stop(Status.TARGET)
        if len(candidates) < wanted:
            self.stop(Status.EVALUATIONS)
        if self.budget.seconds is not None and self.elapsed >= self.budget.seconds:
            self.stop(Status.SECONDS)
        return Evaluation(result.cost, violation)

    def cost(self, candidate: Array) -> float:
        """Cost of one candidate (d,)."""
        return float(self.evaluate(np.asarray(candidate, dtype=np.float64)[None]).cost[0])

    def _guarded(self, candidates: Array) -> Evaluation:
        """The objective's answer, with everything that is not a finite number turned into
        "infeasible"."""
        try:
            result = self.objective.evaluate(candidates.copy())
            cost = np.array(result.cost, dtype=np.float64)
            violation = np.array(result.violation, dtype=np.float64)
            if cost.shape != (len(candidates),) or violation.shape != cost.shape:
                raise ValueError(
                    f"objective returned shape {cost.shape} for {len(candidates)} candidates"
                )
        except (KeyboardInterrupt, SystemExit, _Stop):
            raise
        except Exception as error:  # whatever a user's objective raises counts as infeasible
            if len(candidates) > 1:
                parts = [self._guarded(row[None]) for row in candidates]
                return Evaluation(
                    np.concatenate([p.cost for p in parts]),
                    np.concatenate([p.violation for p in parts]),
                )
            return self._failed(
                np.full(1, np.inf),
                np.full(1, np.inf),
                np.ones(1, bool),
                f"{type(error).__name__}: {error}",
            )
        if math.isfinite(
            np.add.reduce(cost) + np.add.reduce(violation)
        ):  # then each is; the usual case, quick
            return Evaluation(cost, violation)
        bad = ~(np.isfinite(cost) & np.isfinite(violation))
        if bad.any():
            worst = cost[np.argmax(bad)]
            return self._failed(
                cost, violation, bad, f"cost {worst} at {candidates[np.argmax(bad)].tolist()}"
            )
        return Evaluation(cost, violation)

    def _failed(self, cost: Array, violation: Array, bad: BoolArray, reason: str) -> Evaluation:
        self.failures += int(bad.sum())
        self.first_failure = self.first_failure or reason
        return Evaluation(np.where(bad, np.inf, cost), np.where(bad, np.inf, violation))

    def _record(self, candidates: Array, cost: Array, violation: Array) -> None:
        before = self.nfev
        self.nfev += len(candidates)
        if self._kept < _KEPT_SAMPLES:
            part = candidates[: _KEPT_SAMPLES - self._kept]
            self._samples.append(part)
            self._kept += len(part)
        i = best_index(cost, violation)
        if better(cost[i], violation[i], self.best_cost, self.best_violation):
            self.best_cost, self.best_violation = float(cost[i]), float(violation[i])
            self.best_x = candidates[i].copy()
            self._rows.append((before + i + 1, self.elapsed, self.best_cost, self.best_violation))
        if self.on_progress is not None:
            self.on_progress(self.nfev, self.best_cost)

    def spend(self, evaluations: int) -> None:
        """Count work on the objective that does not go through ``evaluate`` (residuals), before it
        is done.

        Ends the search where the budget does not hold it.
        """
        if evaluations > self.remaining():
            self.stop(Status.EVALUATIONS)
        self.nfev += evaluations
        if self.budget.seconds is not None and self.elapsed >= self.budget.seconds:
            self.stop(Status.SECONDS)

    def propose(self, candidate: Array) -> None:
        """Enter a candidate (d,) into the final judgement, whatever its cost on the search grid
        is."""
        self._proposals.append(np.clip(candidate, self.bounds[:, 0], self.bounds[:, 1]))

    def constructed(self) -> None:
        """Start the clock anew: what went before was construction, which is told apart from the
        search."""
        self.construct_seconds = self.elapsed
        self._started = self._now()

    @property
    def elapsed(self) -> float:
        """Seconds since the search began, by the budget's clock."""
        return self._now() - self._started

    def _now(self) -> float:
        return time.perf_counter() if self.budget.clock == "wall" else time.process_time()

    def remaining(self) -> int:
        """Evaluations left (a large number when unlimited)."""
        return (2**62 if self.budget.evaluations is None else self.budget.evaluations) - self.nfev

    def stop(self, status: Status) -> NoReturn:
        """End the search now."""
        raise _Stop(status)

    def _judged(self) -> tuple[Array, float, float]:
        """The best candidate by the objective's own fine score, with its cost and violation."""
        found = (
            []
            if self.best_x is None
            else [np.clip(self.best_x, self.bounds[:, 0], self.bounds[:, 1])]
        )
        best = (self.bounds.mean(axis=1), np.inf, np.inf)
        for x in [*found, *self._proposals]:
            try:
                scored = self.objective.score(x)
            except Exception as error:  # a user's objective may raise here as anywhere
                self.failures += 1
                self.first_failure = self.first_failure or f"{type(error).__name__}: {error}"
                continue
            if better(scored.cost[0], scored.violation[0], best[1], best[2]):
                best = (x, float(scored.cost[0]), float(scored.violation[0]))
        return best

    # -- finishing
    # ------------------------------------------------------------------------------------

    def finish(self, optimizer: str, search: Callable[[], tuple[Status, str]]) -> OptimizeResult:
        """Run ``search`` to its end or the budget's, then judge the best candidate anew."""
        try:
            status, message = search()
        except _Stop as stop:
            status, message = stop.status, ""
        x, fun, violation = self._judged()
        if not np.isfinite(fun):
            status = Status.FAILED
        if status is not Status.FAILED and not violation <= FEASIBLE:
            status = Status.INFEASIBLE
        text = f"{message}: {status.value}" if message else status.value
        if self.failures:
            text += f" ({self.failures} evaluations failed; the first: {self.first_failure})"
        rows = np.array(self._rows, dtype=np.float64).reshape(-1, 4)
        history = History(
            rows[:, 0].astype(np.int64),
            rows[:, 1],
            rows[:, 2],
            rows[:, 3],
            np.concatenate(self._samples) if self._samples else np.zeros((0, len(self.bounds))),
        )
        return OptimizeResult(
            x,
            fun,
            violation,
            self.best_cost,
            self.nfev,
            self.nit,
            status in (Status.TARGET, Status.CONVERGED),
            status,
            text,
            optimizer,
            history,
            self.elapsed,
            self.failures,
            self.first_failure,
            self.ngev,
            self.nhev,
            self.construct_seconds,
        )


@dataclass
class Starts:
    """Which start of a local method gave the best candidate, and what the method said of it."""

    run: Run
    converged: bool = False
    said: str = "nothing was found"
    tried: int = 0
    kept: int = 0  # starts that converged
    _best: tuple[float, float] = (np.inf, np.inf)

    def ended(self, converged: bool, said: str) -> None:
        """A start is over; the method says whether by its own stopping rule, and what."""
        self.tried += 1
        self.kept += converged
        now = self.run.best_cost, self.run.best_violation
        if self.tried == 1 or better(*now, *self._best):
            self.converged, self.said = converged, said.strip().rstrip(".")
        self._best = now

    def verdict(self) -> tuple[Status, str]:
        """The status of the start that found the best, and a sentence on all."""
        status = Status.CONVERGED if self.converged else Status.STALLED
        return status, f"{self.kept} of {self.tried} starts converged; the best said '{self.said}'"


def better(cost: float, violation: float, than_cost: float, than_violation: float) -> bool:
    """Deb's feasibility rule [deb2000]: feasible before infeasible, then the cost, or else the
    violation, decides."""
    feasible, than_feasible = violation <= FEASIBLE, than_violation <= FEASIBLE
    if feasible and than_feasible:
        return bool(cost < than_cost)
    if feasible or than_feasible:
        return bool(feasible)
    return bool(violation < than_violation or (violation == than_violation and cost < than_cost))


def best_index(cost: Array, violation: Array) -> int:
    """Index of the best candidate under Deb's rule."""
    if not np.count_nonzero(violation):  # the usual case, and quick
        return int(cost.argmin())
    feasible = violation <= FEASIBLE
    if feasible.any():
        return int(np.argmin(np.where(feasible, cost, np.inf)))
    return int(np.lexsort((cost, violation))[0])


def checked_bounds(bounds: ArrayLike, dimension: int | None = None) -> Array:
    """(d, 2) array of finite bounds, lower < upper. Raises ArgumentError otherwise."""
    array = as_numbers(
        "bounds", bounds, "a lower and an upper bound a variable: numbers of shape (d, 2)"
    )
    if array.ndim != 2 or array.shape[1] != 2 or array.shape[0] < 1:
        raise ArgumentError(
            "bounds", array.shape, "shape (d, 2): a lower and an upper bound a variable"
        )
    if not np.all(np.isfinite(array)) or np.any(array[:, 0] >= array[:, 1]):
        raise ArgumentError("bounds", array.tolist(), "finite bounds, each lower < upper")
    if dimension is not None and len(array) != dimension:
        raise ArgumentError("bounds", array.shape, f"{dimension} rows, one a decision variable")
    return array


def checked_x0(x0: ArrayLike | None, bounds: Array) -> Array | None:
    """Starting point (d,) inside the bounds, or None. Raises ArgumentError for anything else."""
    if x0 is None:
        return None
    point = as_numbers("x0", x0, f"{len(bounds)} finite numbers")
    if point.shape != (len(bounds),) or not np.all(np.isfinite(point)):
        raise ArgumentError("x0", point.tolist(), f"{len(bounds)} finite numbers")
    if np.any(point < bounds[:, 0]) or np.any(point > bounds[:, 1]):
        raise ArgumentError("x0", point.tolist(), f"a point inside the bounds {bounds.tolist()}")
    return point
