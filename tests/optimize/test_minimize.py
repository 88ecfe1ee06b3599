"""``minimize`` as SciPy's users expect it: gradients, constraints, callbacks, saved searches, functions
and expressions of CasADi."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import LinearConstraint, NonlinearConstraint

from trajopt.errors import ArgumentError
from trajopt.optimize.base import Budget, Status
from trajopt.optimize.search import minimize, optimizer_named, optimizer_names

Array = NDArray[np.float64]

BOX = [[-2.0, 3.0], [-1.5, 2.5]]
SAVING = [
    n for n in optimizer_names() if n != "auto" and getattr(optimizer_named(n), "saves", False)
]
CONSTRAINED = ("slsqp", "trust-constr", "ipopt", "cobyqa")


def square(x: Array) -> float:
    return float((x[0] - 1.0) ** 2 + (x[1] - 2.0) ** 2)


def rosenbrock(x: Array) -> float:
    return float((1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2)


# (1, 2) is the least; x + y <= 1 makes it (0, 1), at a cost of 2
FORMS: dict[str, Any] = {
    "nonlinear": NonlinearConstraint(lambda x: x[0] + x[1], -np.inf, 1.0),
    "nonlinear with jac": NonlinearConstraint(
        lambda x: x[0] + x[1], -np.inf, 1.0, jac=lambda _: [[1.0, 1.0]]
    ),
    "linear": LinearConstraint([[1.0, 1.0]], -np.inf, 1.0),
    "pair": (lambda x: 1.0 - x[0] - x[1], lambda _: np.array([-1.0, -1.0])),
    "pair without": (lambda x: 1.0 - x[0] - x[1], None),
    "kind": ("ineq", lambda x: 1.0 - x[0] - x[1]),
    "equality": ("eq", lambda x: 1.0 - x[0] - x[1], lambda _: [-1.0, -1.0]),
    "function": lambda x: 1.0 - x[0] - x[1],
    "dictionary": {"type": "ineq", "fun": lambda x, a: a - x[0] - x[1], "args": (1.0,)},
    "two": [("ineq", lambda x: 1.0 - x[0] - x[1]), LinearConstraint([[1.0, 0.0]], -5.0, 5.0)],
    "vector": NonlinearConstraint(lambda x: [x[0] + x[1], x[0]], [-9.0, -5.0], [1.0, 5.0]),
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", ["slsqp", "ipopt"])
def test_every_form_of_constraint(form: str, name: str) -> None:
    found = minimize(square, BOX, constraints=FORMS[form], optimizer=name, budget=Budget(600))
    assert found.fun == pytest.approx(2.0, abs=1e-6)
    assert found.violation <= 1e-8
    assert found.x == pytest.approx([0.0, 1.0], abs=1e-4)


@pytest.mark.parametrize(
    "wrong",
    [
        3,
        ("less", square),
        [("eq", 3)],
        NonlinearConstraint(square, 0, 1, keep_feasible=True),
        NonlinearConstraint(square, 0, 1, hess=lambda *_: np.eye(2)),
    ],
)
def test_constraints_that_cannot_be_used_are_named(wrong: Any) -> None:
    with pytest.raises(ArgumentError, match="constraints"):
        minimize(square, BOX, constraints=wrong)


def test_only_bounds_is_said() -> None:
    with pytest.raises(ArgumentError, match="handles constraints"):
        minimize(square, BOX, constraints=FORMS["linear"], optimizer="l-bfgs-b")


def test_jac_and_args() -> None:
    asked: list[float] = []

    def cost(x: Array, a: float, b: float) -> float:
        asked.append(a)
        return a * float((x - b) @ (x - b))

    def gradient(x: Array, a: float, b: float) -> Array:
        return 2 * a * (x - b)

    for jac in (None, gradient):
        asked.clear()
        found = minimize(
            cost, BOX, args=(3.0, 0.5), jac=jac, optimizer="l-bfgs-b", budget=Budget(90)
        )
        assert found.fun < 1e-10
        assert len(asked) <= found.nfev
        assert (found.ngev > 0) == (jac is not None)
    both = minimize(
        lambda x: (square(x), np.array([2 * (x[0] - 1), 2 * (x[1] - 2)])),
        BOX,
        jac=True,
        optimizer="slsqp",
        budget=Budget(50),
    )
    assert both.fun < 1e-12
    with pytest.raises(ArgumentError, match="jac"):
        minimize(square, BOX, jac="3-point")  # type: ignore[arg-type]


@pytest.mark.parametrize("name", optimizer_names())
def test_callback_sees_the_best_and_ends_the_search(name: str) -> None:
    if "RESIDUALS" in str(optimizer_named(name).needs):
        return
    seen: list[tuple[Array, float, float]] = []

    def callback(x: Array, cost: float, violation: float) -> bool:
        seen.append((x, cost, violation))
        return len(seen) == 5

    found = minimize(rosenbrock, BOX, optimizer=name, callback=callback, budget=Budget(500))
    assert found.status is Status.CALLBACK
    assert not found.success
    assert len(seen) == 5
    assert [c for _, c, _ in seen] == sorted((c for _, c, _ in seen), reverse=True)
    assert all(v == 0.0 for _, _, v in seen)
    assert found.fun == seen[-1][1] == rosenbrock(seen[-1][0])


@pytest.mark.parametrize("name", ["pso", "slsqp", "ipopt", "direct", "cma-es"])
def test_a_callback_that_raises_loses_nothing(name: str) -> None:
    def callback(x: Array, cost: float, violation: float) -> None:  # noqa: ARG001
        if cost < 5.0:
            raise RuntimeError("no more ink")

    found = minimize(rosenbrock, BOX, optimizer=name, callback=callback, budget=Budget(2000))
    assert found.status is Status.CALLBACK
    assert "no more ink" in found.message
    assert found.fun < 5.0


# -- saved searches


def batch(x: Array) -> Array:
    return np.asarray(((x - 0.3) ** 2).sum(axis=1) + 0.1 * np.cos(9 * x).sum(axis=1))


@pytest.mark.parametrize("name", SAVING)
def test_saved_and_resumed_is_the_search_in_one_go(name: str, tmp_path: Path) -> None:
    file = tmp_path / "state.npz"
    seen: list[Array] = []

    def recorded(x: Array) -> Array:
        if x.ndim == 2 and len(x) > 3:
            seen.append(x.copy())
        return batch(x)

    box = [[-2.0, 3.0]] * 3
    method: Any = optimizer_named(name)
    if getattr(method, "final_inertia", None) is not None:  # it falls over the budget otherwise
        method = replace(method, horizon=30)
    parts = [
        minimize(recorded, box, optimizer=method, seed=5, state=file, budget=Budget(n))
        for n in (333, 400)
    ]
    resumed = [row.tobytes() for x in seen for row in x]
    seen.clear()
    whole = minimize(recorded, box, optimizer=method, seed=5, budget=Budget(1000))
    straight = [row.tobytes() for x in seen for row in x]
    # the generation that the budget cut is evaluated again
    missing = set(straight[: len(set(resumed)) - 100]) - set(resumed)
    assert not missing
    assert parts[1].fun <= parts[0].fun
    assert whole.fun <= parts[1].fun + 1e-9
    with pytest.raises(ArgumentError, match="state"):
        minimize(recorded, [[-2.0, 4.0]] * 3, optimizer=name, state=file)
    file.write_bytes(b"nonsense")
    with pytest.raises(ArgumentError, match="state"):
        minimize(recorded, box, optimizer=name, state=file)


def test_methods_without_a_state_say_so(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match="only auto, pso"):
        minimize(square, BOX, optimizer="slsqp", state=tmp_path / "s.npz")
    with pytest.raises(ArgumentError, match="folder"):
        minimize(square, BOX, optimizer="pso", state=tmp_path / "no" / "s.npz")


# -- CasADi


def in_symbols() -> dict[str, tuple[Any, Any]]:
    x, y = ca.SX.sym("x", 2), ca.MX.sym("y", 2)
    cost_x = (x[0] - 1) ** 2 + (x[1] - 2) ** 2
    cost_y = ca.sumsqr(y - ca.DM([1, 2]))
    return {
        "functions": (ca.Function("f", [x], [cost_x]), ca.Function("g", [x], [1 - x[0] - x[1]])),
        "expressions SX": (cost_x, 1 - ca.sum1(x)),
        "expressions MX": (cost_y, 1 - ca.sum1(y)),
        "one variable missing": (cost_x, ("ineq", ca.Function("g", [x], [1 - x[0] - x[1]]))),
        "function and lambda": (ca.Function("f", [y], [cost_y]), lambda x: 1 - np.sum(x)),
    }


@pytest.mark.parametrize("kind", list(in_symbols()))
@pytest.mark.parametrize("name", ["ipopt", "slsqp", "trust-constr", "pso"])
def test_functions_and_expressions_of_casadi(kind: str, name: str) -> None:
    cost, constraint = in_symbols()[kind]
    found = minimize(
        cost, BOX, constraints=[constraint], optimizer=name, budget=Budget(2000), seed=1
    )
    assert found.fun == pytest.approx(2.0, abs=1e-6 if name != "pso" else 1e-2)
    if name in ("slsqp", "trust-constr"):
        assert found.ngev > 0


def test_expressions_that_are_not_of_one_vector_are_explained() -> None:
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    with pytest.raises(ArgumentError, match=r"SX\.sym\('x', 2\)"):
        minimize(a**2 + b**2, BOX)
    x = ca.MX.sym("x", 3)
    with pytest.raises(ArgumentError, match="2 variables"):
        minimize(ca.Function("f", [x], [ca.sumsqr(x)]), BOX)


A = np.array([[2.0, 1.0], [1.0, 3.0]])
WRITTEN: dict[str, Any] = {
    "dot": lambda x: np.dot(x - 1, A @ (x - 1)),
    "at": lambda x: (x - 1) @ A @ (x - 1),
    "sum": lambda x: sum((v - 1) ** 2 for v in x),
    "len": lambda x: len(x) * ((x[0] - 1) ** 2 + (x[-1] - 1) ** 2),
    "unpacked": lambda x: (lambda a, b: (a - 1) ** 2 + (b - 1) ** 2)(*x),
    "methods": lambda x: ((x - 1) ** 2).sum(),
    "numpy": lambda x: np.sum(np.square(x - 1)) + np.linalg.norm(x - 1) ** 2,
    "array": lambda x: np.array([x[0] - 1, x[1] - 1]) @ np.asarray(x - 1),
    "floats": lambda x: float(x[0] - 1) ** 2 + float(x[1] - 1) ** 2,  # not in symbols
    "branches": lambda x: (x[0] - 1) ** 2 * (2 if x[0] > 0 else 1) + (x[1] - 1) ** 2,
}


@pytest.mark.parametrize("kind", WRITTEN)
def test_ipopt_takes_functions_as_they_are_written(kind: str) -> None:
    found = minimize(WRITTEN[kind], BOX, optimizer="ipopt", budget=Budget(300))
    assert found.fun < 1e-8
    assert found.nfev <= 300
    assert (found.nhev > 0) == (kind not in ("floats", "branches"))
