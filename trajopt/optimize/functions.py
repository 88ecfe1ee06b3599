"""Plain functions as objectives: costs, gradients and constraints as SciPy's users write them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability, Evaluation, Objective
from trajopt.optimize.constraints import (
    Constraint,
    constraint,
    constraint_list,
    numbers,
    of_casadi,
)

_PROBED = 3  # candidates handed over together to see whether a function takes batches, chosen


@dataclass
class FunctionObjective:
    """``function`` of d variables: one candidate (d,) -> number, or, with ``batch``, (n, d) ->
    (n,).

    ``batch`` None is for a run to find out (``settled``). ``gradient_of`` maps a candidate to the
    gradient (d,); True means that ``function`` returns (cost, gradient).
    """

    function: Callable[..., Any]
    dimension: int
    batch: bool | None = False
    arguments: tuple[Any, ...] = ()
    gradient_of: Callable[..., Any] | bool | None = None
    constraints: tuple[Constraint, ...] = ()
    exact = True  # a search sees all there is: the score needs no call of its own
    doubt: bool = field(default=False, repr=False)  # a single candidate failed
    _limits: Array | None = field(default=None, repr=False)

    @property
    def provides(self) -> frozenset[Capability]:
        found = {Capability.BATCH} if self.batch else set()
        if self.gradient_of:
            found.add(Capability.GRADIENT)
        if self.constraints and all(c.jacobian is not None for c in self.constraints):
            found.add(Capability.JACOBIAN)
        return frozenset(found)

    @property
    def constrained(self) -> bool:
        return bool(self.constraints)

    def evaluate(self, candidates: Array) -> Evaluation:
        if self.batch:
            cost = numbers(self.function(candidates, *self.arguments), "the objective")
        else:
            cost = np.array([self.cost(row) for row in candidates])
        free = np.zeros(cost.shape)
        if not self.constraints:
            return Evaluation(cost, free)
        found = [[c.values(row) for c in self.constraints] for row in candidates]
        values = np.array([np.concatenate(row) for row in found])
        if self._limits is None:
            parts = [c.limits(len(v)) for c, v in zip(self.constraints, found[0], strict=True)]
            self._limits = np.concatenate(parts, axis=1)
        if values.shape[1] != self._limits.shape[1]:
            count = self._limits.shape[1]
            raise ValueError(f"constraints returned {values.shape[1]} values, and {count} before")
        return Evaluation(cost, free, values, self._limits)

    def cost(self, x: Array) -> float:
        """Cost of one candidate (d,)."""
        try:
            told = self.function(x, *self.arguments)
            return _number(told[0] if self.gradient_of is True else told)
        except Exception:
            self.doubt = self.batch is None
            raise

    def score(self, candidate: Array) -> Evaluation:
        return self.evaluate(candidate[None])

    def gradient(self, x: Array) -> Array:
        """(d,): gradient of the cost, where one was given."""
        if self.gradient_of is True:
            return numbers(self.function(x, *self.arguments)[1], "the gradient")
        assert callable(self.gradient_of)
        return numbers(self.gradient_of(x, *self.arguments), "the gradient")

    def jacobian(self, x: Array) -> Array:
        """(m, d): gradients of the constraints, where all were given."""
        parts = [
            numbers(c.jacobian(x), "a constraint's Jacobian").reshape(-1, len(x))
            for c in self.constraints
            if c.jacobian is not None
        ]
        return np.concatenate(parts)


def as_objective(
    objective: Any,
    bounds: Array,
    *,
    jac: Any = None,
    constraints: Any = (),
    args: tuple[Any, ...] = (),
    batch: bool | None = None,
) -> Objective:
    """The objective itself, or a plain function (or a function or expression of CasADi) wrapped as
    one. Raises ArgumentError for what cannot be called or used."""
    items = constraint_list(constraints)
    if not isinstance(args, (tuple, list, np.ndarray)):
        raise ArgumentError("args", args, "a tuple of what else the function takes")
    if isinstance(objective, Objective):
        for name, value in (
            ("jac", jac),
            ("constraints", items or None),
            ("args", tuple(args) or None),
        ):
            if value is not None:
                expected = "none: this objective brings its own"
                raise ArgumentError(name, value, expected)
        return objective
    if any(map(of_casadi, [objective, *items])):
        from trajopt.optimize.symbols import casadi_callable

        symbols = [v for v in [objective, *items] if of_casadi(v)]
        objective, *items = (
            casadi_callable(v, len(bounds), symbols) if of_casadi(v) else v
            for v in (objective, *items)
        )
    if not callable(objective):
        expected = "an objective (objectives.base.Objective) or a function"
        raise ArgumentError("objective", objective, expected)
    jac = getattr(objective, "gradient", None) if jac is None else jac
    if not (jac is None or isinstance(jac, bool) or callable(jac)):
        raise ArgumentError("jac", jac, "a function that gives the gradient (d,), True or None")
    found = tuple(constraint(item, len(bounds)) for item in items)
    # A gradient or constraints are given for single candidates: then the cost is too.
    single = bool(jac or found)
    return FunctionObjective(
        objective, len(bounds), False if single else batch, tuple(args), jac or None, found
    )


def settled(
    function: FunctionObjective, rows: Array, allowed: int, late: Callable[[], bool]
) -> int:
    """Find out whether a function takes batches (n, d), by candidates that are to be evaluated
    anyway; how many evaluations that took, at most ``allowed``.

    It does where it maps two or three candidates to as many numbers that agree with what it gives
    for single ones, or where it cannot take single ones at all.
    """
    some = rows[: 2 if function.dimension == _PROBED else _PROBED]
    if len(rows) == 1 and not function.doubt:
        return 0
    if allowed < len(some) + 2 and not (function.doubt and allowed > 1):
        return 0
    try:
        together = numbers(function.function(some.copy(), *function.arguments), "the objective")
    except Exception:  # a scalar function may fail in any way on a matrix
        together = np.zeros(0)
    if together.shape != (len(some),):
        function.batch = False
        return 1
    spent = len(some)
    try:
        for i in () if function.doubt else (0, len(some) - 1):
            function.batch, spent = False, spent + 1
            told = _number(function.function(some[i].copy(), *function.arguments))
            if not np.isclose(told, together[i], rtol=1e-9, atol=1e-12, equal_nan=True) or late():
                return spent
    except Exception:  # a batch function may fail in any way on one point
        pass
    function.batch = True
    return spent


def _number(value: Any) -> float:
    array = numbers(value, "the objective")
    if array.size != 1:
        raise ValueError(
            f"the objective returned shape {array.shape} for one candidate; expected a number"
        )
    return float(array.reshape(()))
