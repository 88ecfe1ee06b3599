"""What objectives answer, checked: everything that is not a finite number is "infeasible"."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, BoolArray
from trajopt.objectives.base import Evaluation


@dataclass
class Answers:
    """Counts what could not be used, and keeps the reason of the first."""

    failures: int = 0
    first: str = ""

    def checked(self, rows: Array, answer: Evaluation | BaseException) -> Evaluation:
        """``answer`` to candidates (n, d), infinite where it is not finite or was raised."""
        n = len(rows)
        try:
            if isinstance(answer, BaseException):
                raise answer
            cost = np.asarray(answer.cost, dtype=np.float64)
            violation = np.asarray(answer.violation, dtype=np.float64)
            if cost.shape != (n,) or violation.shape != cost.shape:
                raise ValueError(f"the objective returned shape {cost.shape} for {n} candidates")
            values = answer.constraints
        except Exception as error:
            self.count(n, f"{type(error).__name__}: {error}")
            return Evaluation(np.full(n, np.inf), np.full(n, np.inf))
        finite = np.isfinite(cost) & np.isfinite(violation)
        if np.count_nonzero(finite) == n and (values is None or np.isfinite(values).all()):
            return answer  # the usual case, quick
        if values is not None:
            finite &= np.isfinite(values).all(axis=1)
        return self._without(rows, answer, ~finite)

    def count(self, failures: int, reason: str) -> None:
        self.failures += failures
        self.first = self.first or reason

    def _without(self, rows: Array, answer: Evaluation, bad: BoolArray) -> Evaluation:
        i = int(np.argmax(bad))
        values, reason = answer.constraints, f"cost {answer.cost[i]}"
        if values is not None:
            reason += f", constraints {values[i]}"
            values = np.where(bad[:, None], np.nan, values)
        self.count(int(bad.sum()), f"{reason} at {rows[i].tolist()}")
        cost, violation = (np.where(bad, np.inf, v) for v in (answer.cost, answer.violation))
        return Evaluation(cost, violation, values, answer.limits)


def joined(parts: list[Evaluation]) -> Evaluation:
    """Evaluations of several batches as one; constraints that are missing are NaN."""
    if len(parts) == 1:
        return parts[0]
    cost, violation = (
        np.concatenate([getattr(p, name) for p in parts]) for name in ("cost", "violation")
    )
    limits = next((p.limits for p in parts if p.limits is not None), None)
    if limits is None:
        return Evaluation(cost, violation)
    m = limits.shape[1]
    values = [
        np.full((len(p.cost), m), np.nan) if p.constraints is None else p.constraints for p in parts
    ]
    return Evaluation(cost, violation, np.concatenate(values), limits)
