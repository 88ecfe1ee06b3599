"""One search: the only way from an optimizer to its objective.

A ``Run`` counts evaluations, keeps the history and the best candidate (Deb's feasibility rule),
measures constraints alike, differentiates where the objective does not, treats an objective that
raises or returns no number as infeasible, and ends the search where the budget ends, the callback
says so, or Ctrl-C or SIGTERM comes. Whatever ends a search, the best so far comes back.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np

from trajopt.arrays import Array
from trajopt.objectives.base import Capability, Evaluation
from trajopt.optimize.answers import Answers, joined
from trajopt.optimize.base import FEASIBLE, OptimizeResult, Status, Stop
from trajopt.optimize.derivatives import Derivatives
from trajopt.optimize.functions import FunctionObjective, settled
from trajopt.optimize.limited import Limited
from trajopt.optimize.process import one_thread, terminable
from trajopt.optimize.record import Record
from trajopt.optimize.state import Packable, StateFile
from trajopt.optimize.workers import Pool

Progress = Callable[[int, float], None]  # called with evaluations used and the best cost
Callback = Callable[[Array, float, float], Any]  # with the best x, its cost and violation

_REPEATS = 1000  # times in a row that a method may ask for the same candidate, chosen
_PORTION = 0.02  # s that one call of a batch may take near the deadline, chosen
_APART = 1e-3  # of the width by which candidates differ that show how a function works, chosen
_ENDED_FROM_OUTSIDE = (Status.INTERRUPTED, Status.CALLBACK)


@dataclass
class Run(Limited):
    """One search. Mutable by nature; lives for one search."""

    on_progress: Progress | None = None
    callback: Callback | None = None
    pool: Pool | None = None
    state: StateFile | None = None  # where a population method saves itself
    taken: list[str] = field(default_factory=list)  # methods that a portfolio has begun

    def __post_init__(self) -> None:
        Record.__post_init__(self)
        Limited.__post_init__(self)
        # Single candidates: the clock, the callback and workers come in between.
        self._single = Capability.BATCH not in self.objective.provides
        self._pace = math.inf  # s that one candidate takes, inf before the first
        self._point: tuple[Array, Evaluation] | None = None
        self._repeats = 0
        self._derivatives = Derivatives(self)

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
        return parts[0] if len(parts) == 1 else joined(parts)

    def at(self, x: Array) -> Evaluation:
        """Evaluation of one candidate (d,); a method that asks for the last one again pays once."""
        x = np.clip(x, self._low, self._high)  # undo rounding beyond the bounds
        if self._point is None or not np.array_equal(x, self._point[0]):
            self._point, self._repeats = (x.copy(), self.evaluate(x[None], inside=True)), 0
        else:
            self._repeats += 1
            if self._repeats > _REPEATS:  # it would go on for ever, as repeats cost no budget
                self._over(Status.STALLED)
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
        timed = self._until < math.inf
        began = self._now() if timed else 0.0
        if self.pool is None:
            found = self._taken(rows, self._guarded(rows), inside)
        else:
            parts = []
            try:
                for i, answer in self.pool.answers(self.objective, rows, self._late):
                    row = rows[i : i + 1]
                    parts.append(self._taken(row, self.answers.checked(row, answer), inside))
            except BrokenExecutor as error:
                raise Stop(Status.INTERRUPTED, f"a worker died ({error})") from None
            if len(parts) < len(rows):
                self._over(Status.SECONDS)
            found = joined(parts)
        if timed:
            self._pace = (self._now() - began) / len(rows)
        return found

    def _taken(self, rows: Array, found: Evaluation, inside: bool) -> Evaluation:
        found, worst = self.violations.measured(found, rows, inside)
        self.remember(rows, found, worst, self.elapsed)
        if self.on_progress is not None or self.callback is not None:
            self._tell()
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
                return joined([self._guarded(row[None]) for row in rows])
            result = error
        return self.answers.checked(rows, result)

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
            self.answers = Answers()
        return bool(function.batch) and self.remaining() > 0

    def derivatives(self, x: Array) -> tuple[Array, Array]:
        """Gradient of the cost (d,) and of each constraint (m, d) at x (d,). Raises NoGradient
        (``optimize.derivatives``) where they are not finite."""
        return self._derivatives.at(x)

    def constructed(self) -> None:
        """Start the clock anew: what went before was loading and building, which is told apart from
        the search."""
        self._loaded.enter_context(one_thread())  # of packages loaded only now
        super().constructed()

    @property
    def resumes(self) -> bool:
        """Whether a saved search is to go on."""
        return self.state is not None and self.state.loaded is not None

    def keep(self, item: Packable) -> bool:
        """The search is ``item`` from now on: it can be saved, and a saved one goes on in it, which
        is what True says."""
        resumes = self.resumes
        if self.state is not None:
            loaded = self.state.loaded or {}
            self.state.keep(item)
            if resumes:
                self.unpack_best(loaded)
        return resumes

    def checkpoint(self, *, now: bool = False) -> None:
        """Save the search: where a while has passed since the last time, or ``now``."""
        if self.state is not None:
            self.state.save(self.pack_best(), now=now)

    # -- finishing

    def finish(
        self, optimizer: str, search: Callable[[], tuple[Status, str]], note: str = ""
    ) -> OptimizeResult:
        """Run ``search`` to its end or the budget's, then judge the best candidate anew. ``note``
        comes first in the message."""
        with terminable(), ExitStack() as self._loaded:
            self._loaded.enter_context(one_thread())
            try:
                status, said = search()
            except Stop as stop:
                status, said = stop.status, stop.said
            except KeyboardInterrupt:
                status, said = Status.INTERRUPTED, ""
            except BaseException:  # sys.exit, say: at least the state is kept
                self.checkpoint(now=True)
                raise
        seconds = self.elapsed
        self.checkpoint(now=True)
        x, fun, violation = self.judged()
        if status not in _ENDED_FROM_OUTSIDE:
            if not np.isfinite(fun):
                status = Status.FAILED
            elif not violation <= FEASIBLE:
                status = Status.INFEASIBLE
        by = "by " + ", then ".join(self.taken) if self.taken else ""
        text = ": ".join(part for part in (note, by, said, status.value) if part)
        bad = self.answers
        if bad.failures:
            text += f" ({bad.failures} evaluations failed; the first: {bad.first})"
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
            history=self.history,
            seconds=seconds,
            failures=bad.failures,
            first_failure=bad.first,
            ngev=self.ngev,
            nhev=self.nhev,
            construct_seconds=self.construct_seconds,
        )
