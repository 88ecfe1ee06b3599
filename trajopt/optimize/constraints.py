"""Constraints in all the forms in which users write them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError

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
        found = self.function(x)
        if np.asarray(found).dtype == np.bool_:
            raise ValueError("a constraint returned True or False; expected numbers")
        return numbers(found, "a constraint").ravel()

    def limits(self, count: int) -> Array:
        """(2, k)"""
        limits = [np.ravel(v) for v in (self.lower, self.upper)]
        if any(len(v) not in (1, count) for v in limits):
            long = max(map(len, limits))
            raise ValueError(f"a constraint returned {count} values, which has {long} limits")
        return np.stack([np.broadcast_to(v, count) for v in limits])


def constraint_list(given: Any) -> list[Any]:
    """The constraints in what was given: one or several."""
    if given is None:
        return []
    one = callable(given) or _of_scipy(given) or of_casadi(given) or isinstance(given, Mapping)
    if isinstance(given, tuple) and given and not one:
        # one pair, not a sequence of constraints
        text = isinstance(given[0], str)
        one = text or (len(given) == 2 and callable(given[0]) and _is_jacobian(given[1]))
    if not (one or isinstance(given, Iterable)):
        raise ArgumentError("constraints", given, f"one or several of {_FORMS}")
    return [given] if one else list(given)


def _is_jacobian(second: Any) -> bool:
    """Two functions are one constraint and its Jacobian: lists hold several constraints."""
    return second is None or (callable(second) and not of_casadi(second))


def constraint(item: Any, d: int) -> Constraint:
    """One constraint on ``d`` variables from any of its forms."""
    if isinstance(item, Constraint):
        return item
    if _of_scipy(item):
        return _from_scipy(item, d)
    if isinstance(item, Mapping):
        for key in item.keys() - {"type", "fun", "jac", "args"}:
            raise ArgumentError(f"constraints.{key}", item[key], "left out: type, fun, jac, args")
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


def _from_scipy(item: Any, d: int) -> Constraint:
    if np.any(item.keep_feasible):
        expected = "False: searches may pass through infeasible candidates"
        raise ArgumentError("constraints.keep_feasible", item.keep_feasible, expected)
    if not np.all(np.asarray(item.lb) <= np.asarray(item.ub)):
        raise ArgumentError("constraints.lb", item.lb, f"limits up to ub, {item.ub}")
    if hasattr(item, "A"):
        matrix = np.atleast_2d(item.A.toarray() if hasattr(item.A, "toarray") else item.A)
        if matrix.shape[1] != d:
            raise ArgumentError("constraints.A", matrix.shape, f"{d} columns, one a variable")
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


def of_casadi(item: Any) -> bool:
    return type(item).__module__.startswith("casadi") and not isinstance(item, type)


def numbers(value: Any, who: str) -> Array:
    """As an array of real numbers. Raises ValueError for None, text, masked values and the like."""
    if type(value) is float:  # the usual cases, and quick
        return np.float64(value)  # type: ignore[return-value]
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    if value is None:
        raise ValueError(f"{who} returned None; does it end without 'return'?")
    if np.ma.is_masked(value):
        raise ValueError(f"{who} returned a masked value: {value!r}")
    array = np.asarray(value)
    if array.dtype == object:
        if any(v is None for v in array.ravel()):
            raise ValueError(f"{who} returned None among its values")
        with suppress(TypeError, ValueError):
            array = array.astype(np.float64)
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{who} returned {value!r}; expected real numbers")
    return np.asarray(array, dtype=np.float64)
