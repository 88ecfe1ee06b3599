"""The limits of one search: evaluations, seconds and a target, for the whole and for stages of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np

from trajopt.kernels import compiling
from trajopt.optimize.base import FEASIBLE, Budget, StageOver, Status, Stop
from trajopt.optimize.process import interrupted
from trajopt.optimize.record import Record

_UNLIMITED = 2**62
_ROUNDING = 8 * float(np.finfo(float).eps)  # to which a known optimum is met


@dataclass
class Limited(Record):
    """A search's record with its budget, and the clock of that."""

    budget: Budget
    construct_seconds: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        self._most = self.budget.evaluations or _UNLIMITED
        self._until = self.budget.seconds or math.inf
        self._started = self._now()
        self._stage = 0, self._started  # evaluations and clock where the last stage began

    def constructed(self) -> None:
        """Start the clock anew: what went before was loading and building, which is told apart from
        the search."""
        evaluations, began = self._stage
        if self.nfev == evaluations:
            lost = self._now() - began
            self.construct_seconds += lost
            self._started += lost
            self._stage = evaluations, self._now()

    def spend(self, evaluations: int) -> None:
        """Count work on the objective that does not go through ``evaluate`` (residuals), before it
        is done.

        Ends the search where the budget does not hold it.
        """
        self._look()
        if evaluations > self.remaining():
            self._over(Status.EVALUATIONS)
        self.nfev += evaluations

    def stage(
        self, search: Callable[[], tuple[Status, str]], share: float
    ) -> tuple[Status, str] | None:
        """A part of a search that may use ``share`` of what is left of the budget; None where that
        ended it."""
        before = self._most, self._until
        self._stage = self.nfev, self._now()
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
        """By the budget's clock, which stands while kernels are compiled."""
        clock = self.budget.clock
        now = time.perf_counter() if clock == "wall" else time.process_time()
        return now - compiling(clock)

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
        if interrupted():
            self.stop(Status.INTERRUPTED)
        target = self.budget.target
        met = target is not None and self.best_cost <= target + _ROUNDING * abs(target)
        if met and self.best_violation <= FEASIBLE:
            self.stop(Status.TARGET)
        if self._late() and not (before and self._kept == 0):  # one is always evaluated
            self._over(Status.SECONDS)
