"""Constraints as users write them, rightly and wrongly: each is used, or refused by name."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import LinearConstraint, NonlinearConstraint
from scipy.sparse import csr_matrix

from trajopt.errors import ArgumentError
from trajopt.optimize.base import Budget, Status
from trajopt.optimize.search import minimize


def told(value: object) -> str:
    """Without addresses: all workers of a test run must name a test alike."""
    return re.sub(r" at 0x\w+", "", repr(value))


Array = NDArray[np.float64]


def square(x: Array) -> float:
    return float(x @ x)


CUBE = [[-2.0, 3.0]] * 3
KEPT: dict[str, tuple[Any, float]] = {
    "dictionary with args": (
        {"type": "ineq", "fun": lambda x, a: x[0] - a, "args": (1,)},
        1.0,
    ),
    "tuple of dictionaries": (
        ({"type": "ineq", "fun": lambda x: x[0] - 1}, {"type": "eq", "fun": lambda x: x[1] - 0.5}),
        1.25,
    ),
    "vector": (("ineq", lambda x: x - 1), 3.0),
    "column": (("ineq", lambda x: (x - 1)[:, None]), 3.0),
    "list": (("ineq", lambda x: [x[0] - 1, x[1] - 1]), 2.0),
    "one row": (LinearConstraint([1, 1, 1], 1, np.inf), 1 / 3),
    "sparse rows": (LinearConstraint(csr_matrix([[1.0, 1.0, 1.0]]), 1, np.inf), 1 / 3),
    "one lower, three upper": (NonlinearConstraint(lambda x: x, 1, [2, 2, 2]), 3.0),
    "no limit at all": (NonlinearConstraint(lambda x: x[0], -np.inf, np.inf), 0.0),
    "two sided": (NonlinearConstraint(lambda x: x[0], 1.0, 1.5), 1.0),
    "none returned": (("ineq", lambda _: []), 0.0),
    "as many as variables": (("eq", lambda x: x - np.array([0.5, 1.0, -1.0])), 2.25),
}


@pytest.mark.parametrize("kind", KEPT)
@pytest.mark.parametrize("name", ["slsqp", "trust-constr", "ipopt", "cobyqa", "pso"])
def test_shapes_of_constraints(kind: str, name: str) -> None:
    constraints, least = KEPT[kind]
    budget = Budget(300 if name == "cobyqa" else 3000)
    found = minimize(square, CUBE, constraints=constraints, optimizer=name, budget=budget)
    assert found.violation <= 1e-8
    near = 0.3 if name == "pso" and kind == "tuple of dictionaries" else 0.02
    assert found.fun == pytest.approx(least, abs=near if name == "pso" else 1e-5)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (LinearConstraint([[1, 1]], 1, np.inf), "constraints.A"),
        (NonlinearConstraint(square, 2, 1), "constraints.lb"),
        (NonlinearConstraint(square, np.nan, 1), "constraints.lb"),
        (NonlinearConstraint(square, 1, np.inf, keep_feasible=True), "keep_feasible"),
        ({"type": "ineq", "fun": square, "tol": 1e-3}, "constraints.tol"),
        ({"type": "gt", "fun": square}, "constraints"),
        ({"type": "ineq"}, "constraints"),
        ("ineq", "constraints"),
        (3, "constraints"),
    ],
    ids=told,
)
def test_constraints_that_cannot_be_used_are_refused(wrong: Any, named: str) -> None:
    with pytest.raises(ArgumentError, match=named):
        minimize(square, CUBE, constraints=wrong)


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda _: 1 / 0, "ZeroDivisionError"),
        (lambda _: np.nan, "nan"),
        (lambda _: np.inf, "inf"),
        (lambda _: None, "None"),
        (lambda _: "a", "real numbers"),
        (lambda x: x[0] > 1, "True or False"),
        (lambda x: np.ones(1 if x[0] > 0.45 else 2), "before"),
    ],
)
@pytest.mark.parametrize("name", ["slsqp", "trust-constr", "ipopt", "cobyqa", "pso"])
def test_answers_of_constraints_that_are_none(function: Any, said: str, name: str) -> None:
    found = minimize(
        square, CUBE, constraints=("ineq", function), optimizer=name, budget=Budget(200)
    )
    assert found.failures > 0
    assert said in found.first_failure
    assert found.status is Status.FAILED or said == "before"


def test_limits_of_another_number_than_values_are_named() -> None:
    constraint = NonlinearConstraint(lambda x: x, [1, 1], np.inf)
    found = minimize(square, CUBE, constraints=constraint, optimizer="slsqp", budget=Budget(60))
    assert "3 values, which has 2 limits" in found.first_failure


def test_more_equalities_than_variables(capfd: pytest.CaptureFixture[str]) -> None:
    constraint = ("eq", lambda x: np.append(x, x.sum()))
    for name in ("slsqp", "ipopt", "pso", "trust-constr"):
        found = minimize(square, CUBE, constraints=constraint, optimizer=name, budget=Budget(1500))
        assert found.fun < 1e-6 or not found.success
    told = capfd.readouterr()
    assert told.out + told.err == ""
