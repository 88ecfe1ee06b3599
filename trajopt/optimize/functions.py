"""Plain Python functions as objectives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability, Evaluation, Objective, SymbolicProblem


@dataclass(frozen=True)
class FunctionObjective:
    """``function`` of d variables: one candidate (d,) -> number, or, with ``batch``, (n, d) ->
    (n,)."""

    function: Callable[[Any], Any]
    dimension: int
    batch: bool = False

    @property
    def provides(self) -> frozenset[Capability]:
        # A scalar function may also run on symbols; the symbolic optimizer finds out and says so if
        # not.
        return frozenset({Capability.BATCH} if self.batch else {Capability.SYMBOLIC})

    def evaluate(self, candidates: Array) -> Evaluation:
        if self.batch:
            cost = np.asarray(self.function(candidates), dtype=np.float64)
        else:
            cost = np.array([_number(self.function(row)) for row in candidates])
        return Evaluation(cost, np.zeros(cost.shape))

    def score(self, candidate: Array) -> Evaluation:
        return self.evaluate(candidate[None])

    @property
    def constrained(self) -> bool:
        return False

    def symbolic(self, z: Any, parameters: Any) -> SymbolicProblem:  # noqa: ARG002 - the protocol's signature
        """The function on a symbolic vector (d,)."""
        return SymbolicProblem(self.function(z), None, np.zeros(0), np.zeros(0))

    def parameters_at(self, start: Array) -> Array:  # noqa: ARG002
        return np.zeros(0)

    def slacks_at(self, start: Array) -> Array:  # noqa: ARG002
        return np.zeros(0)


def as_objective(objective: Objective | Callable[[Any], Any], bounds: Array) -> Objective:
    """The objective itself, or a plain function wrapped as one.

    A function counts as a batch function when it maps three different points (3, d) to three
    numbers (3,) that agree with what it gives for single points, or when it cannot take single
    points at all. Raises ArgumentError for what cannot be called.
    """
    if isinstance(objective, Objective):
        return objective
    if not callable(objective):
        raise ArgumentError(
            "objective", objective, "an objective (objectives.base.Objective) or a function"
        )
    d = len(bounds)
    return FunctionObjective(objective, d, batch=_is_batch(objective, bounds))


def _is_batch(function: Callable[[Any], Any], bounds: Array) -> bool:
    n = len(bounds) + 2  # differs from d, so that a function that sums over the wrong axis shows it
    inside = bounds[:, 0] + (bounds[:, 1] - bounds[:, 0]) * np.linspace(0.3, 0.7, n)[:, None]
    try:
        together = np.asarray(function(inside.copy()), dtype=np.float64)
    except Exception:  # a scalar function may fail in any way on a matrix
        return False
    if together.shape != (n,):
        return False
    try:
        single = [_number(function(row.copy())) for row in inside]
    except Exception:  # a batch function may fail in any way on one point
        return True
    return bool(np.allclose(single, together, rtol=1e-9, atol=1e-12, equal_nan=True))


def _number(value: Any) -> float:
    if np.iscomplexobj(value):
        raise ValueError(f"the objective returned the complex number {value}; expected a real one")
    array = np.asarray(value, dtype=np.float64)
    if array.size != 1:
        raise ValueError(
            f"the objective returned shape {array.shape} for one candidate; expected a number"
        )
    return float(array.reshape(()))
