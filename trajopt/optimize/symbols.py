"""CasADi's symbols, programs and IPOPT itself. The only module that imports casadi.

Formulas written with NumPy run on symbols (CasADi's NumPy mode), so physics exists once. ``Nlp`` is
a program whose values are computed by Python, one call at a time, so that each can be counted and
the solver stopped at any of them; derivatives are symbolic, or Python's too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError

_QUIET = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes", "error_on_fail": False}
_DONE = (
    -1e20
)  # a cost that ends any line search, so that IPOPT comes to its next iteration and ends


@contextmanager
def numpy_on_symbols(on: bool) -> Iterator[None]:
    """Whether NumPy's functions and shapes hold for symbols inside the block (or the function, as a
    decorator).

    On: ``np.sin(x)`` runs on symbols, and vectors have NumPy's one dimension. Off: vectors are
    columns, and a NumPy vector times a column of symbols goes element by element, as the programs
    of this package are written. CasADi's switch is global, so each block sets what it needs and
    gives back what it found.
    """
    import casadi as ca

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
    import casadi as ca

    x, parameters = ca.MX.sym("x", n), ca.MX.sym("p", p)
    with numpy_on_symbols(True):
        cost, constraints = write(x, parameters)
    rows = ca.MX(0, 1) if constraints is None else ca.MX(constraints)
    return Expressions(x, parameters, ca.MX(cost), rows)


def function_in_symbols(functions: Sequence[Callable[[Any], Any]], n: int) -> Expressions:
    """Plain functions of x (n,), the cost first, on symbols: in an array of single symbols, with
    which NumPy and Python do whatever they do with numbers, or else in one vector of CasADi. Raises
    what they raise where neither is enough (a comparison of values, say)."""
    import casadi as ca

    def column(found: Any, kind: Any) -> Any:
        if type(found).__module__.startswith("casadi"):
            return ca.vec(kind(found))
        return ca.vertcat(*(kind(v) for v in np.ravel(np.asarray(found, dtype=object))))

    def written(x: Any, given: Any, kind: Any) -> Expressions:
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
    import casadi as ca

    made = ca.Function("values", [written.x, written.p], [written.cost, written.constraints])

    def values(x: Array, p: Array) -> tuple[float, Array]:
        cost, rows = made(x, p)
        return float(cost), np.asarray(rows, dtype=np.float64).ravel()

    return values


@dataclass
class Nlp:
    """IPOPT on variables u = (x - low) / width; ``values`` (x, p) -> (cost, constraints) is called
    for each new x. What it, ``slopes`` or ``watch`` raise ends the solver at once, and is raised."""

    values: Callable[[Array, Array], tuple[float, Array]]
    watch: Callable[[Array], None]  # each iterate
    low: Array
    width: Array
    m: int
    written: Expressions | None  # for derivatives
    slopes: Callable[[Array], tuple[Array, Array]] | None  # without: gradient and Jacobian at x
    tolerance: float
    iterations: int
    ended: BaseException | None = None

    def __post_init__(self) -> None:
        import casadi as ca

        self._last: tuple[bytes, float, Array] | None = None
        n, p = len(self.low), 0 if self.written is None else self.written.p.numel()
        self._kept = [
            self._callback(ca, "values", [(n, 1), (p, 1)], [(1, 1), (self.m, 1)], self._values)
        ]
        u, parameters = ca.MX.sym("u", n), ca.MX.sym("p", p)
        cost, constraints = self._kept[0](u, parameters)
        sizes = {"f": 1, "x": n, "lam_x": n, "g": self.m, "lam_g": self.m, "p": p, "lam_p": p}
        iterate = [(sizes.get(ca.nlpsol_out(i), 0), 1) for i in range(ca.nlpsol_n_out())]
        self._kept.append(self._callback(ca, "iterate", iterate, [(1, 1)], self._watch))
        settings: dict[str, Any] = {
            **_QUIET,
            **(self._own(ca, n) if self.written is None else self._symbolic(ca, self.written)),
            "no_nlp_grad": True,
            "calc_lam_p": False,
            "show_eval_warnings": False,
            "iteration_callback": self._kept[1],
            "ipopt.tol": self.tolerance,
            "ipopt.max_iter": self.iterations,
            "ipopt.bound_relax_factor": 0.0,
        }
        nlp = {"x": u, "p": parameters, "f": cost, "g": constraints}
        self.solver = ca.nlpsol("trajopt", "ipopt", nlp, settings)

    def solve(
        self, start: Array, p: Array, lower: Array, upper: Array, limits: Array
    ) -> tuple[Array, dict[str, Any]]:
        """Where IPOPT ended from ``start`` (n,) between ``lower`` and ``upper``, and its account of
        it. ``limits`` (2, m): between what constraints are kept."""
        bounds = {
            "lbx": (lower - self.low) / self.width,
            "ubx": (upper - self.low) / self.width,
            "lbg": limits[0],
            "ubg": limits[1],
        }
        self.ended = self._last = None
        self.account: dict[str, Any] = {}
        try:
            found = self.solver(x0=(start - self.low) / self.width, p=p, **bounds)
        except RuntimeError as error:  # what CasADi makes of what cannot pass it
            if self.ended is None:
                said = str(error).splitlines()[-1]
                return start, {"success": False, "return_status": said, "iter_count": 0}
            raise self.ended from None
        self.account = dict(self.solver.stats())
        if self.ended is not None:
            raise self.ended
        x = self.low + self.width * np.asarray(found["x"], dtype=np.float64).ravel()
        return np.where(np.isfinite(x), x, start), self.account

    def _values(self, u: Array, p: Array) -> list[Any]:
        key = u.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, *self.values(self.low + self.width * u, p)
        return [self._last[1], self._last[2]]

    def _watch(self, *iterate: Array) -> list[Any]:
        self.watch(self.low + self.width * iterate[0])
        return [0]

    def _symbolic(self, ca: Any, written: Expressions) -> dict[str, Any]:
        """Exact derivatives over scaled variables."""
        kind = type(written.x)
        u, factor, weights = (
            kind.sym(name, k) for name, k in (("u", len(self.low)), ("s", 1), ("l", self.m))
        )
        cost, rows = ca.substitute(
            [written.cost, written.constraints],
            [written.x],
            [ca.DM(self.low) + ca.DM(self.width) * u],
        )
        gradient, jacobian = ca.gradient(cost, u), ca.jacobian(rows, u)
        curvature, _ = ca.hessian(factor * cost + ca.dot(weights, rows), u)
        p, extra = written.p, {"cse": True}
        return {
            "grad_f": ca.Function(
                "nlp_grad_f", [u, p], [cost, gradient], ["x", "p"], ["f", "grad_f_x"], extra
            ),
            "jac_g": ca.Function(
                "nlp_jac_g", [u, p], [rows, jacobian], ["x", "p"], ["g", "jac_g_x"], extra
            ),
            "hess_lag": ca.Function(
                "nlp_hess_l",
                [u, p, factor, weights],
                [ca.triu(curvature)],
                ["x", "p", "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
                extra,
            ),
        }

    def _own(self, ca: Any, n: int) -> dict[str, Any]:
        """First derivatives by Python, and IPOPT's own picture of the second."""
        assert self.slopes is not None
        slopes = self.slopes

        def gradient(u: Array, p: Array) -> list[Any]:
            return [self._values(u, p)[0], slopes(self.low + self.width * u)[0] * self.width]

        def jacobian(u: Array, p: Array) -> list[Any]:
            return [self._values(u, p)[1], slopes(self.low + self.width * u)[1] * self.width]

        sizes = [(n, 1), (0, 1)]
        self._kept += [
            self._callback(ca, "nlp_grad_f", sizes, [(1, 1), (n, 1)], gradient),
            self._callback(ca, "nlp_jac_g", sizes, [(self.m, 1), (self.m, n)], jacobian),
        ]
        return {
            "grad_f": self._kept[-2],
            "jac_g": self._kept[-1],
            "ipopt.hessian_approximation": "limited-memory",
        }

    def _callback(
        self,
        ca: Any,
        name: str,
        inputs: list[tuple[int, int]],
        outputs: list[tuple[int, int]],
        function: Callable[..., list[Any]],
    ) -> Any:
        """A function of CasADi that is computed by Python."""
        outer = self
        names = {
            "nlp_grad_f": (["x", "p"], ["f", "grad_f_x"]),
            "nlp_jac_g": (["x", "p"], ["g", "jac_g_x"]),
        }.get(name)

        class Called(ca.Callback):  # type: ignore[misc]
            def __init__(self) -> None:
                ca.Callback.__init__(self)
                self.construct(name, {})

            def get_n_in(self) -> int:
                return len(inputs)

            def get_n_out(self) -> int:
                return len(outputs)

            def get_name_in(self, i: int) -> str:
                return names[0][i] if names else f"i{i}"

            def get_name_out(self, i: int) -> str:
                return names[1][i] if names else f"o{i}"

            def get_sparsity_in(self, i: int) -> Any:
                return ca.Sparsity.dense(*inputs[i])

            def get_sparsity_out(self, i: int) -> Any:
                return ca.Sparsity.dense(*outputs[i])

            def eval(self, arguments: Any) -> list[Any]:
                # Exceptions cannot cross CasADi: they are remembered, and IPOPT is brought to end.
                if outer.ended is None:
                    try:
                        given = (np.asarray(a, dtype=np.float64).ravel() for a in arguments)
                        return function(*given)
                    except BaseException as error:
                        outer.ended = error
                if name == "iterate":
                    return [1]
                if name == "values" and outer._last is not None:
                    return [_DONE, outer._last[2]]
                return [np.full(size, np.nan) for size in outputs]

        return Called()


def casadi_callable(item: Any, dimension: int, together: Sequence[Any]) -> CasadiFunction:
    """A function or an expression of CasADi as a function of x (d,) that knows its gradient.

    Expressions are in one vector of symbols, the same in all that are given ``together``. Raises
    ArgumentError for others.
    """
    import casadi as ca

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
        import casadi as ca

        self.function = function
        x = ca.MX.sym("x", function.numel_in(0))
        self._slope = ca.Function("slope", [x], [ca.jacobian(ca.vec(function(x)), x)])

    def __call__(self, x: Any) -> Any:
        if isinstance(x, np.ndarray) and x.dtype != object:
            return np.asarray(self.function(x), dtype=np.float64).ravel()
        import casadi as ca

        return self.function(ca.vertcat(*x) if isinstance(x, np.ndarray) else x)

    def gradient(self, x: Array) -> Array:
        """(m, d): of each output."""
        return np.asarray(self._slope(x).full(), dtype=np.float64)

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self.function.serialize(),)


def _unpickled(text: str) -> CasadiFunction:
    import casadi as ca

    return CasadiFunction(ca.Function.deserialize(text))


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
    import casadi as ca

    return ca.MX.sym("x", count)


def stacked(parts: Sequence[Any]) -> Any:
    """One column of expressions."""
    import casadi as ca

    return ca.vertcat(*parts)


def matrix(values: Array) -> Any:
    """A matrix of numbers that multiplies expressions; zeros are left out."""
    import casadi as ca

    return ca.sparsify(ca.DM(values))


def total(column: Any) -> Any:
    """Sum of a column of expressions."""
    import casadi as ca

    return ca.sum1(column)


def smooth_table(grid: Array, values: Array) -> Callable[[Any], Any]:
    """Cubic B-spline through ``values`` (N, K) on ``grid`` (N,): expressions (1, M) -> (K, M)."""
    import casadi as ca

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
    import casadi as ca

    settings: dict[str, Any] = {
        **_QUIET,
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
