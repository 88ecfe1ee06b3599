"""What a search has seen: counts, the best candidate, its history."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.objectives.base import Evaluation, Objective
from trajopt.optimize.answers import Answers
from trajopt.optimize.base import History, best_index, better
from trajopt.optimize.violations import Violations

_KEPT_SAMPLES = 50_000  # explored candidates kept for pictures


@dataclass
class Record:
    """Mutable by nature; the part of a run that counts and remembers."""

    objective: Objective
    bounds: Array
    nfev: int = field(default=0, kw_only=True)
    nit: int = field(default=0, kw_only=True)
    ngev: int = field(default=0, kw_only=True)
    nhev: int = field(default=0, kw_only=True)
    best_x: Array | None = field(default=None, kw_only=True)
    best_cost: float = field(default=np.inf, kw_only=True)
    best_violation: float = field(default=np.inf, kw_only=True)

    def __post_init__(self) -> None:
        self._low, self._high = np.ascontiguousarray(self.bounds.T)
        self.width = self._high - self._low
        self.answers, self.violations = Answers(), Violations(self.bounds)
        self.improvements: list[tuple[int, float, float, float]] = []
        self._rank = np.inf  # the best candidate's violation as Deb's rule sees it
        self._proposals: list[Array] = []
        self._samples: list[Array] = []
        self._kept = 0

    @property
    def limits(self) -> Array | None:
        """(2, m): between what constraints are kept, once one was computed."""
        return self.violations.limits

    def propose(self, candidate: Array) -> None:
        """Enter a candidate (d,) into the final judgement, whatever its cost on the search grid
        is."""
        self._proposals.append(np.clip(candidate, self._low, self._high))

    def remember(self, rows: Array, found: Evaluation, worst: Array, seconds: float) -> None:
        """Count evaluated candidates (n, d), with the worst excess of each, and keep the best."""
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
            row = before + i + 1, seconds, self.best_cost, self.best_violation
            self.improvements.append(row)

    @property
    def history(self) -> History:
        """All improvements, and the first candidates explored."""
        rows = np.array(self.improvements, dtype=np.float64).reshape(-1, 4)
        empty = np.zeros((0, len(self.bounds)))
        samples = np.concatenate(self._samples) if self._samples else empty
        count, seconds, cost, violation = rows.T
        return History(count.astype(np.int64), seconds, cost, violation, samples)

    def pack_best(self) -> dict[str, Any]:
        """The best candidate as it is saved."""
        if self.best_x is None:
            return {}
        return {
            "best_x": self.best_x,
            "best_cost": self.best_cost,
            "best_violation": self.best_violation,
            "best_rank": self._rank,
            "best_scale": self.violations.scale,
        }

    def unpack_best(self, kept: Mapping[str, Any]) -> None:
        """Go on from the best candidate that was saved, if any."""
        if "best_x" not in kept:
            return
        self.best_x, self._rank = np.array(kept["best_x"]), float(kept["best_rank"])
        self.best_cost, self.best_violation = kept["best_cost"], kept["best_violation"]
        self.violations.scale = np.array(kept["best_scale"])
        self.improvements.append((0, 0.0, self.best_cost, self.best_violation))

    def judged(self) -> tuple[Array, float, float]:
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
                self.answers.count(1, f"{type(error).__name__}: {error}")
                continue
            if better(scored.cost[0], scored.violation[0], best[1], best[2]):
                best = x, float(scored.cost[0]), float(scored.violation[0])
        return best
