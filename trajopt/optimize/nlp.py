"""Programs for IPOPT whose values are computed by Python.

Each value is one call, so that it can be counted and the solver stopped there; derivatives are
symbolic, or Python's too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.optimize.symbols import QUIET, Expressions, casadi

_DONE = (
    -1e20
)  # a cost that ends any line search, so that IPOPT comes to its next iteration and ends


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
        ca = casadi()

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
            **QUIET,
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
