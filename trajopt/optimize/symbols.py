"""CasADi's symbols, and programs in them. The only module that imports casadi.

Formulas written with NumPy run on symbols (CasADi's NumPy mode), so physics exists once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError

# Settings of IPOPT that says nothing and raises nothing.
QUIET = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "error_on_fail": False}


def casadi() -> Any:
    """The package, loaded when first used."""
    import casadi as package

    return package


@contextmanager
def numpy_on_symbols(on: bool) -> Iterator[None]:
    """Whether NumPy's functions and shapes hold for symbols inside the block (or the function, as a
    decorator).

    On: ``np.sin(x)`` runs on symbols, and vectors have NumPy's one dimension. Off: vectors are
    columns, and a NumPy vector times a column of symbols goes element by element, as the programs
    of this package are written. CasADi's switch is global, so each block sets what it needs and
    gives back what it found.
    """
    ca = casadi()

    before = ca.GlobalOptions.getNumpyMode()
    ca.GlobalOptions.setNumpyMode(1 if on else 0)
    try:
        yield
    finally:
        ca.GlobalOptions.setNumpyMode(before)


@dataclass(frozen=True)
class Expressions:
    """A cost and constraints (m, 1) in symbols ``x`` (n, 1) and parameters ``p``."""

    x: Any
    p: Any
    cost: Any
    constraints: Any


def expressions(write: Callable[[Any, Any], tuple[Any, Any]], n: int, p: int) -> Expressions:
    """``write``, (x, p) -> (cost, constraints or None), on symbols in CasADi's NumPy mode."""
    ca = casadi()

    x, parameters = ca.MX.sym("x", n), ca.MX.sym("p", p)
    with numpy_on_symbols(True):
        cost, constraints = write(x, parameters)
    rows = ca.MX(0, 1) if constraints is None else ca.MX(constraints)
    return Expressions(x, parameters, ca.MX(cost), rows)


def function_in_symbols(
    functions: Sequence[Callable[[Any], Any]], n: int, before: Callable[[], None]
) -> Expressions:
    """Plain functions of x (n,), the cost first, on symbols: in an array of single symbols, with
    which NumPy and Python do whatever they do with numbers, or else in one vector of CasADi.

    ``before`` is called before they are. Raises what they raise where neither is enough (a
    comparison of values, say).
    """
    ca = casadi()

    def column(found: Any, kind: Any) -> Any:
        if type(found).__module__.startswith("casadi"):
            return ca.vec(kind(found))
        return ca.vertcat(*(kind(v) for v in np.ravel(np.asarray(found, dtype=object))))

    def written(x: Any, given: Any, kind: Any) -> Expressions:
        before()
        with numpy_on_symbols(True):
            cost, *rows = (column(function(given), kind) for function in functions)
        return Expressions(x, kind(0, 1), cost, ca.vertcat(kind(0, 1), *rows))

    x: Any = ca.SX.sym("x", n)
    try:
        return written(x, np.array([x[i] for i in range(n)], dtype=object), ca.SX)
    except Exception:  # whatever NumPy cannot do with an array of objects
        with numpy_on_symbols(True):
            x = ca.MX.sym("x", n)
        return written(x, x, ca.MX)


def values_of(written: Expressions) -> Callable[[Array, Array], tuple[float, Array]]:
    """The expressions as a function (x, p) -> (cost, constraints (m,))."""
    ca = casadi()

    made = ca.Function("values", [written.x, written.p], [written.cost, written.constraints])

    def values(x: Array, p: Array) -> tuple[float, Array]:
        cost, rows = made(x, p)
        return float(cost), np.asarray(rows, dtype=np.float64).ravel()

    return values


@dataclass(frozen=True, eq=False)
class ProgramResult:
    """What IPOPT found: ``x`` (n,), ``cost``, ``solved`` (to its tolerance), its own ``status`` and
    iterations."""

    x: Array
    cost: float
    solved: bool
    status: str
    iterations: int


def variables(count: int) -> Any:
    """A column of ``count`` symbols; slices and arithmetic give expressions."""
    ca = casadi()

    return ca.MX.sym("x", count)


def stacked(parts: Sequence[Any]) -> Any:
    """One column of expressions."""
    ca = casadi()

    return ca.vertcat(*parts)


def total(column: Any) -> Any:
    """Sum of a column of expressions."""
    ca = casadi()

    return ca.sum1(column)


def smooth_table(grid: Array, values: Array) -> Callable[[Any], Any]:
    """Cubic B-spline through ``values`` (N, K) on ``grid`` (N,): expressions (1, M) -> (K, M)."""
    ca = casadi()

    table = ca.interpolant(
        "table", "bspline", [grid.tolist()], np.ascontiguousarray(values).ravel().tolist()
    )
    return lambda at: table.map(at.shape[1])(at)


def solve_program(
    x: Any,
    cost: Any,
    constraints: Any,
    *,
    start: Array,
    lower: Array,
    upper: Array,
    constraint_lower: Array,
    constraint_upper: Array,
    tolerance: float = 1e-8,
    max_iterations: int = 300,
) -> ProgramResult:
    """Minimise ``cost`` over the symbols ``x`` (n,) between bounds, with constraints between
    theirs, by IPOPT.

    Expressions come from ``variables``, ``stacked`` and ``smooth_table``. Warm start: ``start``
    (n,).
    """
    ca = casadi()

    settings: dict[str, Any] = {
        **QUIET,
        "ipopt.tol": tolerance,
        "ipopt.max_iter": max_iterations,
        "ipopt.mu_strategy": "adaptive",
    }
    solver = ca.nlpsol("program", "ipopt", {"x": x, "f": cost, "g": constraints}, settings)
    found = solver(x0=start, lbx=lower, ubx=upper, lbg=constraint_lower, ubg=constraint_upper)
    stats = solver.stats()
    return ProgramResult(
        np.asarray(found["x"], dtype=np.float64).ravel(),
        float(found["f"]),
        bool(stats["success"]),
        str(stats["return_status"]),
        int(stats["iter_count"]),
    )


def casadi_callable(item: Any, dimension: int, together: Sequence[Any]) -> CasadiFunction:
    """A function or an expression of CasADi as a function of x (d,) that knows its gradient.

    Expressions are in one vector of symbols, the same in all that are given ``together``. Raises
    ArgumentError for others.
    """
    ca = casadi()

    if isinstance(item, ca.Function):
        if item.n_in() != 1 or item.numel_in(0) != dimension:
            expected = f"a CasADi function of one vector of {dimension} variables"
            raise ArgumentError("objective", str(item), expected)
        return CasadiFunction(item)
    everything = ca.veccat(*[v for v in together if not isinstance(v, ca.Function)])
    symbols = ca.symvar(everything)
    if type(item) is ca.MX and len(symbols) == 1 and symbols[0].numel() == dimension:
        return CasadiFunction(ca.Function("f", [symbols[0]], [item]))
    if type(item) is ca.SX and len(symbols) <= dimension:
        # SX.sym("x", 3) makes x_0, x_1 and x_2; one of one entry is just x
        names = {str(s): s for s in symbols}
        stem = str(symbols[0]).rpartition("_")[0] if dimension > 1 else ""
        places = [f"{stem}_{i}" for i in range(dimension)] if stem else [str(symbols[0])]
        if set(names) <= set(places):
            vector = [names.get(place, ca.SX.sym(place)) for place in places]
            return CasadiFunction(ca.Function("f", [ca.vertcat(*vector)], [item]))
    raise ArgumentError(
        "objective",
        str(item),
        f"an expression in one vector of {dimension} symbols, as casadi.SX.sym('x', {dimension}), "
        "or a casadi.Function",
    )


class CasadiFunction:
    """A function of CasADi for numbers (d,), with its ``gradient``, and for symbols."""

    def __init__(self, function: Any) -> None:
        ca = casadi()

        self.function = function
        x = ca.MX.sym("x", function.numel_in(0))
        self._slope = ca.Function("slope", [x], [ca.jacobian(ca.vec(function(x)), x)])

    def __call__(self, x: Any) -> Any:
        if isinstance(x, np.ndarray) and x.dtype != object:
            return np.asarray(self.function(x), dtype=np.float64).ravel()
        ca = casadi()

        return self.function(ca.vertcat(*x) if isinstance(x, np.ndarray) else x)

    def gradient(self, x: Array) -> Array:
        """(m, d): of each output."""
        return np.asarray(self._slope(x).full(), dtype=np.float64)

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self.function.serialize(),)


def _unpickled(text: str) -> CasadiFunction:
    ca = casadi()

    return CasadiFunction(ca.Function.deserialize(text))
