"""Plain functions as objectives: costs, gradients and constraints as SciPy's users write them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability, Evaluation, Objective

_PROBED = 3  # candidates handed over together to see whether a function takes batches, chosen
_FORMS = (
    "SciPy's NonlinearConstraint or LinearConstraint, a pair of functions (g, its Jacobian or None) "
    'for g(x) >= 0, or ("ineq" or "eq", g) or ("eq", g, Jacobian)'
)


@dataclass(frozen=True)
class Constraint:
    """``lower`` <= function(x) <= ``upper``, one or several numbers; ``jacobian`` (k, d) where it
    is known."""

    function: Callable[[Any], Any]
    lower: Any = 0.0
    upper: Any = np.inf
    jacobian: Callable[[Any], Any] | None = None

    def values(self, x: Array) -> Array:
        """(k,)"""
        return _numbers(self.function(x), "a constraint").ravel()

    def limits(self, count: int) -> Array:
        """(2, k)"""
        return np.stack([np.broadcast_to(np.ravel(v), count) for v in (self.lower, self.upper)])


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
            cost = _numbers(self.function(candidates, *self.arguments), "the objective")
        else:
            cost = np.array([self.cost(row) for row in candidates])
        free = np.zeros(cost.shape)
        if not self.constraints:
            return Evaluation(cost, free)
        found = [[c.values(row) for c in self.constraints] for row in candidates]
        values = np.array([np.concatenate(row) for row in found])
        if self._limits is None or self._limits.shape[1] != values.shape[1]:
            parts = [c.limits(len(v)) for c, v in zip(self.constraints, found[0], strict=True)]
            self._limits = np.concatenate(parts, axis=1)
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
            return _numbers(self.function(x, *self.arguments)[1], "the gradient")
        assert callable(self.gradient_of)
        return _numbers(self.gradient_of(x, *self.arguments), "the gradient")

    def jacobian(self, x: Array) -> Array:
        """(m, d): gradients of the constraints, where all were given."""
        parts = [
            _numbers(c.jacobian(x), "a constraint's Jacobian").reshape(-1, len(x))
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
    items = _constraint_list(constraints)
    if isinstance(objective, Objective):
        for name, value in (("jac", jac), ("constraints", items or None), ("args", args or None)):
            if value is not None:
                expected = "none: this objective brings its own"
                raise ArgumentError(name, value, expected)
        return objective
    if any(map(_of_casadi, [objective, *items])):
        from trajopt.optimize.symbols import casadi_callable

        symbols = [v for v in [objective, *items] if _of_casadi(v)]
        objective, *items = (
            casadi_callable(v, len(bounds), symbols) if _of_casadi(v) else v
            for v in (objective, *items)
        )
    if not callable(objective):
        expected = "an objective (objectives.base.Objective) or a function"
        raise ArgumentError("objective", objective, expected)
    jac = getattr(objective, "gradient", None) if jac is None else jac
    if not (jac is None or isinstance(jac, bool) or callable(jac)):
        raise ArgumentError("jac", jac, "a function that gives the gradient (d,), True or None")
    found = tuple(_constraint(item) for item in items)
    # A gradient or constraints are given for single candidates: then the cost is too.
    single = bool(jac or found)
    return FunctionObjective(
        objective, len(bounds), False if single else batch, args, jac or None, found
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
        together = _numbers(function.function(some.copy(), *function.arguments), "the objective")
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


def _constraint_list(given: Any) -> list[Any]:
    """The constraints in what was given: one or several."""
    if given is None:
        return []
    one = callable(given) or _of_scipy(given) or _of_casadi(given) or isinstance(given, Mapping)
    if isinstance(given, tuple) and given and not one:
        # one pair, not a sequence of constraints
        text = isinstance(given[0], str)
        one = text or (len(given) == 2 and callable(given[0]) and _is_jacobian(given[1]))
    if not (one or isinstance(given, Iterable)):
        raise ArgumentError("constraints", given, f"one or several of {_FORMS}")
    return [given] if one else list(given)


def _is_jacobian(second: Any) -> bool:
    """Two functions are one constraint and its Jacobian: lists hold several constraints."""
    return second is None or (callable(second) and not _of_casadi(second))


def _constraint(item: Any) -> Constraint:
    """One constraint from any of its forms."""
    if isinstance(item, Constraint):
        return item
    if _of_scipy(item):
        return _from_scipy(item)
    if isinstance(item, Mapping):
        item = (item.get("type"), _with_args(item, "fun"), _with_args(item, "jac"))
    if callable(item):
        return Constraint(item, jacobian=getattr(item, "gradient", None))
    if isinstance(item, tuple) and len(item) in (2, 3):
        kind, function, jacobian = (
            (*item, None)[:3] if isinstance(item[0], str) else ("ineq", *item)[:3]
        )
        if (
            kind in ("ineq", "eq")
            and callable(function)
            and (jacobian is None or callable(jacobian))
        ):
            own = getattr(function, "gradient", None) if jacobian is None else jacobian
            return Constraint(function, 0.0, 0.0 if kind == "eq" else np.inf, own)
    raise ArgumentError("constraints", item, _FORMS)


def _with_args(item: Mapping[str, Any], key: str) -> Any:
    function, args = item.get(key), tuple(item.get("args", ()))
    return (lambda x: function(x, *args)) if args and callable(function) else function


def _from_scipy(item: Any) -> Constraint:
    if np.any(item.keep_feasible):
        expected = "False: searches may pass through infeasible candidates"
        raise ArgumentError("constraints.keep_feasible", item.keep_feasible, expected)
    if hasattr(item, "A"):
        matrix = np.atleast_2d(item.A.toarray() if hasattr(item.A, "toarray") else item.A)
        return Constraint(lambda x: matrix @ x, item.lb, item.ub, lambda _: matrix)
    if not callable(item.jac) and not isinstance(item.jac, str):
        raise ArgumentError("constraints.jac", item.jac, "a function, or left out")
    if callable(item.hess):
        expected = "left out: second derivatives of constraints are approximated"
        raise ArgumentError("constraints.hess", item.hess, expected)
    jacobian = item.jac if callable(item.jac) else getattr(item.fun, "gradient", None)
    return Constraint(item.fun, item.lb, item.ub, jacobian)


def _of_scipy(item: Any) -> bool:
    module = sys.modules.get("scipy.optimize")
    return module is not None and isinstance(
        item, (module.NonlinearConstraint, module.LinearConstraint)
    )


def _of_casadi(item: Any) -> bool:
    return type(item).__module__.startswith("casadi") and not isinstance(item, type)


def _number(value: Any) -> float:
    array = _numbers(value, "the objective")
    if array.size != 1:
        raise ValueError(
            f"the objective returned shape {array.shape} for one candidate; expected a number"
        )
    return float(array.reshape(()))


def _numbers(value: Any, who: str) -> Array:
    """As an array of real numbers. Raises ValueError for None, text, masked values and the like."""
    if type(value) is float:  # the usual case, and quick
        return np.float64(value)  # type: ignore[return-value]
    if value is None:
        raise ValueError(f"{who} returned None; does it end without 'return'?")
    if np.ma.is_masked(value):
        raise ValueError(f"{who} returned a masked value: {value!r}")
    array = np.asarray(value)
    if array.dtype == object:
        if any(v is None for v in array.ravel()):
            raise ValueError(f"{who} returned None among its values")
        array = array.astype(np.float64)
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{who} returned {value!r} ({array.dtype}); expected real numbers")
    return np.asarray(array, dtype=np.float64)
