"""One search: the only way from an optimizer to its objective.

A ``Run`` counts evaluations, keeps the history and the best candidate (Deb's feasibility rule),
measures constraints alike, differentiates where the objective does not, treats an objective that
raises or returns no number as infeasible, and ends the search where the budget ends, the callback
says so, or Ctrl-C or SIGTERM comes. Whatever ends a search, the best so far comes back.
"""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NoReturn, cast

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array, BoolArray
from trajopt.objectives.base import Capability, Evaluation, Objective
from trajopt.optimize.base import (
    FEASIBLE,
    Budget,
    History,
    OptimizeResult,
    Status,
    best_index,
    better,
)
from trajopt.optimize.functions import FunctionObjective, settled
from trajopt.optimize.state import Packable, StateFile
from trajopt.optimize.threads import one_thread
from trajopt.optimize.workers import Pool

Progress = Callable[[int, float], None]  # called with evaluations used and the best cost
Callback = Callable[[Array, float, float], Any]  # with the best x, its cost and violation

_KEPT_SAMPLES = 50_000  # explored candidates kept for pictures
_UNLIMITED = 2**62
_NEARBY = 0.1  # of the width: standard deviation of starts near the best so far, chosen
_PORTION = 0.02  # s that one call of a batch may take near the deadline, chosen
_STEPS_BACK = 3  # onto constraints that are missed by little, chosen
_LITTLE = 1e-2  # of the width, largest of those steps, chosen
_APART = 1e-3  # of the width by which candidates differ that show how a function works, chosen
_DIFFERENCE = 1.5e-8  # of the width: step of forward differences, square root of the rounding
_ENDED_FROM_OUTSIDE = (Status.INTERRUPTED, Status.CALLBACK)


class Stop(Exception):
    """Ends the search: raised inside the run, and caught by it."""

    def __init__(self, status: Status, said: str = "") -> None:
        super().__init__(said or status.value)
        self.status, self.said = status, said


class StageOver(Stop):
    """Ends one stage of a search, whose share of the budget is used up."""


class NoGradient(Exception):
    """A derivative is not finite: this start of a local method can go no further."""


@dataclass
class Run:
    """Mutable by nature; lives for one search."""

    objective: Objective
    bounds: Array
    budget: Budget
    on_progress: Progress | None = None
    callback: Callback | None = None
    pool: Pool | None = None
    state: StateFile | None = None  # where a population method saves itself
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
    limits: Array | None = None  # (2, m): between what constraints are kept, once one was computed
    _rank: float = np.inf  # the best candidate's violation as Deb's rule sees it
    _rounding: Array = field(default_factory=lambda: np.zeros(0))  # (m,)
    _scale: Array = field(default_factory=lambda: np.zeros(0))  # (m,) first excess of constraints
    _proposals: list[Array] = field(default_factory=list)
    _rows: list[tuple[int, float, float, float]] = field(default_factory=list)
    _samples: list[Array] = field(default_factory=list)
    _kept: int = 0
    _pace: float = np.inf  # s that one candidate takes, inf before the first
    _point: tuple[Array, Evaluation] | None = None
    _slopes: tuple[Array, Array, Array] | None = None

    def __post_init__(self) -> None:
        self._most = self.budget.evaluations or _UNLIMITED
        self._until = self.budget.seconds or math.inf
        # Single candidates: the clock, the callback and workers come in between.
        self._single = Capability.BATCH not in self.objective.provides
        self._low, self._high = np.ascontiguousarray(self.bounds.T)
        self.width = self._high - self._low
        self._started = self._now()

    # -- evaluating

    def evaluate(self, candidates: Array, *, inside: bool = False) -> Evaluation:
        """Cost, violation and constraints of candidates (n, d).

        The violation is the objective's, or the sum of its constraints' violations, each as a
        multiple of the first one seen; the distance outside the bounds adds to it. ``inside`` says
        that all are within the bounds, which saves looking. Ends the search (by an exception that
        the run catches itself) when the budget is used up or the target met.
        """
        candidates = np.ascontiguousarray(candidates, dtype=np.float64)
        asked = len(candidates)
        if asked > self.remaining():
            candidates = candidates[: max(self.remaining(), 0)]
        if len(candidates) == 0:
            self._over(Status.EVALUATIONS)
        if self._unsettled and len(candidates) > 1:
            self._settle(candidates)
            candidates = candidates[: self.remaining()]
        parts: list[Evaluation] = []
        done = 0
        while done < len(candidates):
            if done or self._until < math.inf:
                self._look(before=len(candidates) - done)
            rows = candidates[done : done + self._portion(len(candidates) - done)]
            found = self._evaluated(rows, inside)
            if self._doubtful and self._settle(rows):
                continue  # once more, as a batch
            parts.append(found)
            done += len(rows)
        if done < asked:
            self._over(Status.EVALUATIONS)
        self._look()
        return parts[0] if len(parts) == 1 else _joined(parts)

    def at(self, x: Array) -> Evaluation:
        """Evaluation of one candidate (d,); a method that asks for the last one again pays once."""
        x = np.clip(x, self._low, self._high)  # undo rounding beyond the bounds
        if self._point is None or not np.array_equal(x, self._point[0]):
            self._point = x.copy(), self.evaluate(x[None], inside=True)
        return self._point[1]

    def cost(self, candidate: Array) -> float:
        """Cost of one candidate (d,)."""
        return float(self.at(np.asarray(candidate, dtype=np.float64)).cost[0])

    def _portion(self, left: int) -> int:
        """How many candidates to compute before looking at the clock."""
        if self.pool is not None:
            return left
        if self._single:
            return 1
        if self._until == math.inf or left == 1:
            return left
        if self._pace == math.inf:
            return 1
        fits = self._pace * left <= self._until - self.elapsed
        return left if fits else max(1, min(left, int(_PORTION / max(self._pace, 1e-9))))

    def _evaluated(self, rows: Array, inside: bool) -> Evaluation:
        began = self._now()
        if self.pool is None:
            found = self._taken(rows, self._guarded(rows), inside)
        else:
            parts = []
            try:
                for i, answer in self.pool.answers(self.objective, rows, self._late):
                    row = rows[i : i + 1]
                    parts.append(self._taken(row, self._checked(row, answer), inside))
            except BrokenExecutor as error:
                raise Stop(Status.INTERRUPTED, f"a worker died ({error})") from None
            if len(parts) < len(rows):
                self._over(Status.SECONDS)
            found = _joined(parts)
        self._pace = (self._now() - began) / len(rows)
        return found

    def _taken(self, rows: Array, found: Evaluation, inside: bool) -> Evaluation:
        found, worst = self._violations(found, rows, inside)
        self._record(rows, found, worst)
        return found

    def _guarded(self, rows: Array) -> Evaluation:
        """The objective's answer, with everything that is not a finite number turned into
        "infeasible"."""
        try:
            result: Evaluation | Exception = self.objective.evaluate(rows.copy())
        except KeyboardInterrupt:
            raise Stop(Status.INTERRUPTED) from None
        except Stop:
            raise
        except Exception as error:  # whatever a user's objective raises counts as infeasible
            if len(rows) > 1:
                return _joined([self._guarded(row[None]) for row in rows])
            result = error
        return self._checked(rows, result)

    def _checked(self, rows: Array, result: Evaluation | BaseException) -> Evaluation:
        n = len(rows)
        values: Array | None = None
        try:
            if isinstance(result, BaseException):
                raise result
            cost = np.array(result.cost, dtype=np.float64)
            violation = np.array(result.violation, dtype=np.float64)
            if cost.shape != (n,) or violation.shape != cost.shape:
                raise ValueError(f"the objective returned shape {cost.shape} for {n} candidates")
            values = result.constraints
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            return self._failed(np.full(n, np.inf), np.full(n, np.inf), np.ones(n, bool), reason)
        total = np.add.reduce(cost) + np.add.reduce(violation)
        if values is not None:
            total = total + values.sum()
        if math.isfinite(total):  # then each is; the usual case, quick
            return result
        bad = ~(np.isfinite(cost) & np.isfinite(violation))
        if values is not None:
            bad |= ~np.isfinite(values).all(axis=1)
        if not bad.any():
            return result
        i = int(np.argmax(bad))
        reason = f"cost {cost[i]}" if values is None else f"cost {cost[i]}, constraints {values[i]}"
        return self._failed(cost, violation, bad, f"{reason} at {rows[i].tolist()}", result)

    def _failed(
        self,
        cost: Array,
        violation: Array,
        bad: BoolArray,
        reason: str,
        result: Evaluation | None = None,
    ) -> Evaluation:
        self.failures += int(bad.sum())
        self.first_failure = self.first_failure or reason
        values = limits = None
        if result is not None and result.constraints is not None:
            values, limits = np.where(bad[:, None], np.nan, result.constraints), result.limits
        elif self.limits is not None:
            values, limits = np.full((len(bad), self.limits.shape[1]), np.nan), self.limits
        return Evaluation(
            np.where(bad, np.inf, cost), np.where(bad, np.inf, violation), values, limits
        )

    def _violations(
        self, found: Evaluation, rows: Array, inside: bool
    ) -> tuple[Evaluation, Array]:
        """With violations as Deb's rule is to see them, and the worst excess itself, each (n,)."""
        rank = worst = found.violation
        if found.constraints is not None and found.limits is not None:
            if self.limits is not found.limits:
                self.limits, self._rounding = found.limits, _rounding(found.limits)
            excess = _excess(found.constraints, found.limits, self._rounding)
            rank = worst = excess.max(axis=1, initial=0.0)
            if worst.any():
                rank = self._rank_of(excess, worst)
        if not inside and ((rows < self._low).any() or (rows > self._high).any()):
            outside = np.maximum(self._low - rows, rows - self._high)
            outside = np.maximum(outside, 0.0).sum(axis=1)
            rank, worst = rank + outside, worst + outside
        if rank is not found.violation:
            found = Evaluation(found.cost, rank, found.constraints, found.limits)
        return found, worst

    def _rank_of(self, excess: Array, worst: Array) -> Array:
        """(n,): the sum of violations (n, m), each as a multiple of the first one seen."""
        if len(self._scale) != excess.shape[1]:
            self._scale = np.zeros(excess.shape[1])
        if not self._scale.all():
            seen = np.where(np.isfinite(excess), excess, 0.0).max(axis=0)
            self._scale = np.where(self._scale > 0, self._scale, seen)
        parts = excess / np.where(self._scale > 0, self._scale, 1.0)
        # However small the share of the first: what is broken must not count as rounding.
        return np.where(worst > 0, 2 * FEASIBLE + parts.sum(axis=1), 0.0)

    def _record(self, rows: Array, found: Evaluation, worst: Array) -> None:
        before = self.nfev
        self.nfev += len(rows)
        if self._kept < _KEPT_SAMPLES:
            part = rows[: _KEPT_SAMPLES - self._kept]
            self._samples.append(part)
            self._kept += len(part)
        i = best_index(found.cost, found.violation) if len(rows) > 1 else 0
        if better(found.cost[i], found.violation[i], self.best_cost, self._rank):
            self.best_cost, self.best_violation = float(found.cost[i]), float(worst[i])
            self._rank, self.best_x = float(found.violation[i]), rows[i].copy()
            self._rows.append((before + i + 1, self.elapsed, self.best_cost, self.best_violation))
        if self.on_progress is not None or self.callback is not None:
            self._tell()

    def _tell(self) -> None:
        try:
            if self.on_progress is not None:
                self.on_progress(self.nfev, self.best_cost)
            if self.callback is None or self.best_x is None:
                return
            told = self.callback(self.best_x.copy(), self.best_cost, self.best_violation)
            ended = bool(told)
        except KeyboardInterrupt:
            raise Stop(Status.INTERRUPTED) from None
        except StopIteration:  # SciPy's way to end a search
            ended = True
        except Exception as error:
            said = f"the callback raised {type(error).__name__}: {error}"
            raise Stop(Status.CALLBACK, said) from None
        if ended:
            self.stop(Status.CALLBACK)

    @property
    def _unsettled(self) -> bool:
        return isinstance(self.objective, FunctionObjective) and self.objective.batch is None

    @property
    def _doubtful(self) -> bool:
        """Whether a single candidate failed, and perhaps only for being single."""
        return self._unsettled and cast(FunctionObjective, self.objective).doubt

    def _settle(self, rows: Array) -> bool:
        """Find out whether a function takes batches; the calls that it takes are evaluations."""
        function = cast(FunctionObjective, self.objective)
        doubt = function.doubt
        if len(rows) > 1 and not (np.ptp(rows, axis=0) > _APART * self.width).any():
            return False  # as in differences: too near to each other to tell
        if self.pool is not None:
            function.batch = False
        else:
            self.nfev += settled(function, rows, self.remaining(), self._late)
        self._single = not function.batch
        if doubt and function.batch:  # then the candidate that failed was no failure
            self.failures, self.first_failure = self.failures - 1, ""
        return bool(function.batch) and self.remaining() > 0

    # -- differentiating

    def derivatives(self, x: Array) -> tuple[Array, Array]:
        """Gradient of the cost (d,) and of each constraint (m, d) at x (d,): the objective's own
        where it has them, else forward differences on the scale of the bounds, one batch of
        evaluations. Raises NoGradient where they are not finite."""
        x = np.clip(x, self._low, self._high)
        if self._slopes is not None and np.array_equal(x, self._slopes[0]):
            return self._slopes[1], self._slopes[2]
        provided, m = self.objective.provides, 0 if self.limits is None else self.limits.shape[1]
        own = Capability.GRADIENT in provided
        jacobian = np.zeros((m, len(x)))
        gradient = self._own_gradient(x) if own else np.zeros(len(x))
        if m and Capability.JACOBIAN in provided:
            jacobian = self._own("jacobian", x, (m, len(x)))
        if not own or (m and Capability.JACOBIAN not in provided):
            slopes, rows = self._differences(x)
            gradient = gradient if own else slopes
            jacobian = jacobian if Capability.JACOBIAN in provided else rows
        for found in (gradient, jacobian):
            if not np.isfinite(found).all():
                self._no_gradient(x)
        self._slopes = x.copy(), gradient, jacobian
        return gradient, jacobian

    def _own_gradient(self, x: Array) -> Array:
        self.ngev += 1
        return self._own("gradient", x, (len(x),))

    def _own(self, name: str, x: Array, shape: tuple[int, ...]) -> Array:
        try:
            found = np.asarray(getattr(self.objective, name)(x.copy()), dtype=np.float64)
            if found.size != math.prod(shape):
                raise ValueError(f"shape {found.shape}, expected {shape}")
        except Stop:
            raise
        except Exception as error:
            self._no_gradient(x, f"{type(error).__name__}: {error}")
        return found.reshape(shape)

    def _no_gradient(self, x: Array, reason: str = "not finite") -> NoReturn:
        said = f"the gradient is no use at {x.tolist()}: {reason}"
        self.failures += 1
        self.first_failure = self.first_failure or said
        raise NoGradient(said)

    def _differences(self, x: Array) -> tuple[Array, Array]:
        here = self.at(x)
        step = _DIFFERENCE * self.width
        step = np.where(x + step > self._high, -step, step)
        there = self.evaluate(x + np.diag(step), inside=True)
        step = np.diagonal(x + np.diag(step)) - x  # as rounded
        jacobian = np.zeros((0, len(x)))
        with np.errstate(invalid="ignore"):
            gradient = (there.cost - here.cost[0]) / step
            if here.constraints is not None and there.constraints is not None:
                jacobian = ((there.constraints - here.constraints) / step[:, None]).T
        return gradient, jacobian

    # -- limits

    def spend(self, evaluations: int) -> None:
        """Count work on the objective that does not go through ``evaluate`` (residuals), before it
        is done.

        Ends the search where the budget does not hold it.
        """
        self._look()
        if evaluations > self.remaining():
            self._over(Status.EVALUATIONS)
        self.nfev += evaluations

    def propose(self, candidate: Array) -> None:
        """Enter a candidate (d,) into the final judgement, whatever its cost on the search grid
        is."""
        self._proposals.append(np.clip(candidate, self._low, self._high))

    def constructed(self) -> None:
        """Start the clock anew: what went before was loading and building, which is told apart from
        the search."""
        if self.nfev == 0:
            self.construct_seconds += self.elapsed
            self._started = self._now()

    def keep(self, item: Packable) -> bool:
        """The search is ``item`` from now on: it can be saved, and a saved one goes on in it, which
        is what True says."""
        resumes = self.state is not None and self.state.loaded is not None
        if self.state is not None:
            loaded = self.state.loaded or {}
            self.state.keep(item)
            if resumes and "best_x" in loaded:
                self.best_x, self._rank = np.array(loaded["best_x"]), float(loaded["best_rank"])
                self.best_cost = float(loaded["best_cost"])
                self.best_violation = float(loaded["best_violation"])
                self._scale = np.array(loaded["best_scale"])
                self._rows.append((0, 0.0, self.best_cost, self.best_violation))
        return resumes

    def checkpoint(self, *, now: bool = False) -> None:
        """Save the search: where a while has passed since the last time, or ``now``."""
        if self.state is None:
            return
        best: dict[str, Any] = {}
        if self.best_x is not None:
            best = {
                "best_x": self.best_x,
                "best_cost": self.best_cost,
                "best_violation": self.best_violation,
                "best_rank": self._rank,
                "best_scale": self._scale,
            }
        self.state.save(best, now=now)

    @property
    def improvements(self) -> list[tuple[int, float, float, float]]:
        """Evaluations, seconds, cost and violation each time the best improved."""
        return self._rows

    def stage(
        self, search: Callable[[], tuple[Status, str]], share: float
    ) -> tuple[Status, str] | None:
        """A part of a search that may use ``share`` of what is left of the budget; None where that
        ended it."""
        before = self._most, self._until
        if self._most < _UNLIMITED:
            self._most = self.nfev + max(1, int(share * self.remaining()))
        if self._until < math.inf:
            self._until = self.elapsed + share * (self._until - self.elapsed)
        try:
            return search()
        except StageOver:
            return None
        finally:
            self._most, self._until = before

    @property
    def used(self) -> float:
        """Share of the budget that is used up, 0 to 1."""
        evaluations = self.nfev / (self.budget.evaluations or math.inf)
        seconds = self.elapsed / self.budget.seconds if self.budget.seconds else 0.0
        return min(1.0, max(evaluations, seconds))

    @property
    def elapsed(self) -> float:
        """Seconds since the search began, by the budget's clock."""
        return self._now() - self._started

    def _now(self) -> float:
        return time.perf_counter() if self.budget.clock == "wall" else time.process_time()

    def remaining(self) -> int:
        """Evaluations left (a large number when unlimited)."""
        return self._most - self.nfev

    def stop(self, status: Status) -> NoReturn:
        """End the search now."""
        raise Stop(status)

    def _over(self, status: Status) -> NoReturn:
        """End the stage, or the search where it is the budget that is used up."""
        evaluations = self.nfev >= (self.budget.evaluations or _UNLIMITED)
        seconds = self.elapsed >= (self.budget.seconds or math.inf)
        raise (Stop if evaluations or seconds else StageOver)(status)

    def _late(self) -> bool:
        return self._until < math.inf and self.elapsed >= self._until

    def _look(self, before: int = 0) -> None:
        """End the search where the target is met or the time is up; ``before`` evaluations are to
        come."""
        target = self.budget.target
        # A known optimum is met to rounding.
        rounding = 8 * np.finfo(float).eps * abs(target or 0.0)
        if (
            target is not None
            and self.best_violation <= FEASIBLE
            and self.best_cost <= target + rounding
        ):
            self.stop(Status.TARGET)
        if self._late() and not (before and self.nfev == 0):
            self._over(Status.SECONDS)

    # -- finishing

    def _judged(self) -> tuple[Array, float, float]:
        """The best candidate by the objective's own fine score, with its cost and violation."""
        middle = self.bounds.mean(axis=1)
        if getattr(self.objective, "exact", False):  # what the search saw is all there is
            if self.best_x is None:
                return middle, np.inf, np.inf
            inside = np.clip(self.best_x, self._low, self._high)
            return inside, self.best_cost, self.best_violation
        found = [] if self.best_x is None else [np.clip(self.best_x, self._low, self._high)]
        best = middle, np.inf, np.inf
        for x in [*found, *self._proposals]:
            try:
                scored = self.objective.score(x)
            except Exception as error:  # a user's objective may raise here as anywhere
                self.failures += 1
                self.first_failure = self.first_failure or f"{type(error).__name__}: {error}"
                continue
            if better(scored.cost[0], scored.violation[0], best[1], best[2]):
                best = x, float(scored.cost[0]), float(scored.violation[0])
        return best

    def finish(
        self, optimizer: str, search: Callable[[], tuple[Status, str]], note: str = ""
    ) -> OptimizeResult:
        """Run ``search`` to its end or the budget's, then judge the best candidate anew. ``note``
        comes first in the message."""
        with _terminable(), one_thread():
            try:
                status, said = search()
            except Stop as stop:
                status, said = stop.status, stop.said
            except KeyboardInterrupt:
                status, said = Status.INTERRUPTED, ""
        seconds = self.elapsed
        self.checkpoint(now=True)
        x, fun, violation = self._judged()
        if status not in _ENDED_FROM_OUTSIDE:
            if not np.isfinite(fun):
                status = Status.FAILED
            elif not violation <= FEASIBLE:
                status = Status.INFEASIBLE
        text = ": ".join(part for part in (note, said, status.value) if part)
        if self.failures:
            text += f" ({self.failures} evaluations failed; the first: {self.first_failure})"
        rows = np.array(self._rows, dtype=np.float64).reshape(-1, 4)
        samples = np.concatenate(self._samples) if self._samples else np.zeros((0, len(x)))
        return OptimizeResult(
            x=x,
            fun=fun,
            violation=violation,
            search_fun=self.best_cost,
            nfev=self.nfev,
            nit=self.nit,
            success=status in (Status.TARGET, Status.CONVERGED),
            status=status,
            message=text,
            optimizer=optimizer,
            history=History(
                rows[:, 0].astype(np.int64), rows[:, 1], rows[:, 2], rows[:, 3], samples
            ),
            seconds=seconds,
            failures=self.failures,
            first_failure=self.first_failure,
            ngev=self.ngev,
            nhev=self.nhev,
            construct_seconds=self.construct_seconds,
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


def starting_points(run: Run, x0: Array | None, rng: Generator, count: int) -> Iterator[Array]:
    """``count`` points (d,) where local searches begin: x0; the objective's own (``starts``), the
    best of them first, or else the middle; then random ones, every other near the best so far."""
    given = 0
    if x0 is not None:
        yield x0
        given = 1
    own = getattr(run.objective, "starts", None)
    found = run.bounds.mean(axis=1)[None] if own is None else own()
    if own is not None:
        seen = run.evaluate(found)
        found = found[np.lexsort((seen.cost, seen.violation))]
    for start in found if own is not None or x0 is None else ():
        if given < count:
            yield start
            given += 1
    low, high = run.bounds.T
    for index in range(count - given):
        if index % 2 and run.best_x is not None:
            step = _NEARBY * run.width * rng.standard_normal(len(low))
            yield np.clip(run.best_x + step, low, high)
        else:
            yield rng.uniform(low, high)


def _rounding(limits: Array) -> Array:
    """(m,): by how much constraints may miss their limits and count as kept."""
    finite = np.where(np.isfinite(limits), np.abs(limits), 0.0)
    return np.asarray(FEASIBLE * np.maximum(1.0, finite.max(axis=0)))


def _excess(values: Array, limits: Array, rounding: Array) -> Array:
    """(n, m): by how much constraints (n, m) are broken; 0 where it is but rounding, inf where they
    could not be computed."""
    excess = np.asarray(np.maximum(limits[0] - values, values - limits[1]))
    excess[excess <= rounding] = 0.0
    excess[np.isnan(excess)] = np.inf
    return excess


def onto_constraints(run: Run, x: Array) -> Array:
    """``x`` (d,), where a local method ended, moved the shortest way (on the scale of the bounds)
    onto the constraints that it breaks by little, as such methods do."""
    for _ in range(_STEPS_BACK):
        here = run.at(x)
        if here.constraints is None or here.limits is None or run.remaining() < 2:
            return x
        excess = _excess(here.constraints, here.limits, _rounding(here.limits))[0]
        broken = excess > 0
        if not broken.any() or not np.isfinite(excess).all():
            return x
        below = here.constraints[0] < here.limits[0]
        target = np.where(below, here.limits[0], here.limits[1]) - here.constraints[0]
        rows = run.derivatives(x)[1][broken] * run.width
        step = np.linalg.lstsq(rows, target[broken], rcond=1e-10)[0]
        if np.abs(step).max() > _LITTLE:
            return x
        x = np.clip(x + run.width * step, *run.bounds.T)
    run.at(x)
    return x


def _joined(parts: list[Evaluation]) -> Evaluation:
    if len(parts) == 1:
        return parts[0]
    cost, violation = (
        np.concatenate([getattr(p, name) for p in parts]) for name in ("cost", "violation")
    )
    limits = next((p.limits for p in parts if p.limits is not None), None)
    if limits is None:
        return Evaluation(cost, violation)
    missing = limits.shape[1]
    values = [
        np.full((len(p.cost), missing), np.nan) if p.constraints is None else p.constraints
        for p in parts
    ]
    return Evaluation(cost, violation, np.concatenate(values), limits)


@contextmanager
def _terminable() -> Iterator[None]:
    """SIGTERM ends a search as Ctrl-C does, unless the program has a use of its own for it."""
    mine = threading.current_thread() is threading.main_thread()
    if not mine or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
