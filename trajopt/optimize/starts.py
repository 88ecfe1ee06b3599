"""Where local searches start, and what came of each start."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.optimize.base import Status, better
from trajopt.optimize.run import Run

_NEARBY = 0.1  # of the width: standard deviation of starts near the best so far, chosen


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
