"""Constraints as they are: problems of Hock and Schittkowski with known solutions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from trajopt.optimize.base import Budget, Status
from trajopt.optimize.search import minimize

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Known:
    """A problem of Hock and Schittkowski 1981, and its least cost."""

    cost: Callable[[Array], Any]
    constraints: list[tuple[str, Callable[[Array], Any]]]
    bounds: list[list[float]]
    x0: list[float]
    best: float


def cost_100(x: Array) -> Any:
    return (
        (x[0] - 10) ** 2
        + 5 * (x[1] - 12) ** 2
        + x[2] ** 4
        + 3 * (x[3] - 11) ** 2
        + 10 * x[4] ** 6
        + 7 * x[5] ** 2
        + x[6] ** 4
        - 4 * x[5] * x[6]
        - 10 * x[5]
        - 8 * x[6]
    )


HS71 = Known(
    lambda x: x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2],
    [("ineq", lambda x: x[0] * x[1] * x[2] * x[3] - 25), ("eq", lambda x: np.dot(x, x) - 40)],
    [[1.0, 5.0]] * 4,
    [1.0, 5.0, 5.0, 1.0],
    17.0140173,
)
HS100 = Known(
    cost_100,
    [
        (
            "ineq",
            lambda x: 127 - 2 * x[0] ** 2 - 3 * x[1] ** 4 - x[2] - 4 * x[3] ** 2 - 5 * x[4],
        ),
        ("ineq", lambda x: 282 - 7 * x[0] - 3 * x[1] - 10 * x[2] ** 2 - x[3] + x[4]),
        ("ineq", lambda x: 196 - 23 * x[0] - x[1] ** 2 - 6 * x[5] ** 2 + 8 * x[6]),
        (
            "ineq",
            lambda x: (
                -4 * x[0] ** 2 - x[1] ** 2 + 3 * x[0] * x[1] - 2 * x[2] ** 2 - 5 * x[5] + 11 * x[6]
            ),
        ),
    ],
    [[-10.0, 10.0]] * 7,
    [1.0, 2.0, 0.0, 4.0, 0.0, 1.0, 1.0],
    680.6300573,
)
HS77 = Known(
    lambda x: (
        (x[0] - 1) ** 2 + (x[0] - x[1]) ** 2 + (x[2] - 1) ** 2 + (x[3] - 1) ** 4 + (x[4] - 1) ** 6
    ),
    [
        ("eq", lambda x: x[0] ** 2 * x[3] + np.sin(x[3] - x[4]) - 2 * np.sqrt(2)),
        ("eq", lambda x: x[1] + x[2] ** 4 * x[3] ** 2 - 8 - np.sqrt(2)),
    ],
    [[0.0, 4.0]] * 5,
    [2.0, 2.0, 2.0, 2.0, 2.0],
    0.24150513,
)
HS48 = Known(
    lambda x: (x[0] - 1) ** 2 + (x[1] - x[2]) ** 2 + (x[3] - x[4]) ** 2,
    [("eq", lambda x: sum(x) - 5), ("eq", lambda x: x[2] - 2 * (x[3] + x[4]) + 3)],
    [[-10.0, 10.0]] * 5,
    [3.0, 5.0, -3.0, 2.0, -2.0],
    0.0,
)


@pytest.mark.parametrize("name", ["slsqp", "trust-constr", "ipopt"])
@pytest.mark.parametrize("problem", [HS71, HS100, HS77, HS48], ids=["71", "100", "77", "48"])
@pytest.mark.parametrize("start", [True, False])
def test_gradients_solve_them(name: str, problem: Known, start: bool) -> None:
    found = minimize(
        problem.cost,
        problem.bounds,
        constraints=problem.constraints,
        x0=problem.x0 if start else None,
        optimizer=name,
        budget=Budget(2_500),
    )
    assert found.fun == pytest.approx(problem.best, rel=1e-6, abs=1e-6)
    assert found.violation <= 1e-8


def test_scipys_count_is_about_ours() -> None:
    """SLSQP as by hand: 17.0140 in some 40 evaluations."""
    found = minimize(
        HS71.cost,
        HS71.bounds,
        constraints=HS71.constraints,
        x0=HS71.x0,
        optimizer="slsqp",
        budget=Budget(60, target=17.01402),
    )
    assert found.status is Status.TARGET


@pytest.mark.parametrize("name", ["pso", "cma-es", "differential-evolution"])
def test_populations_keep_inequalities(name: str) -> None:
    found = minimize(
        HS100.cost,
        HS100.bounds,
        constraints=HS100.constraints,
        optimizer=name,
        budget=Budget(20_000),
    )
    assert found.fun == pytest.approx(HS100.best, rel=2e-3)
    assert found.violation <= 1e-8


@pytest.mark.parametrize("name", ["pso", "pso-gbest"])
@pytest.mark.parametrize(("problem", "near"), [(HS71, 1.2), (HS77, 0.05)], ids=["71", "77"])
def test_swarms_keep_equalities(name: str, problem: Known, near: float) -> None:
    """Epsilon levels and repairs: without them 30.9 and 129.8 on problem 71."""
    found = minimize(
        problem.cost,
        problem.bounds,
        constraints=problem.constraints,
        optimizer=name,
        budget=Budget(50_000),
    )
    assert found.violation <= 1e-8
    assert found.fun == pytest.approx(problem.best, abs=near)


def test_violations_are_told_as_they_are() -> None:
    """The result's violation is the worst excess, in the constraint's own unit."""
    far = [("ineq", lambda x: 1e6 * (x[0] - 5.0)), ("ineq", lambda x: x[1] - 3.0)]
    found = minimize(
        lambda x: x[0], [[0.0, 1.0]] * 2, constraints=far, optimizer="pso", budget=Budget(2000)
    )
    assert found.status is Status.INFEASIBLE
    assert found.violation == pytest.approx(4e6, rel=1e-3)
    assert found.x == pytest.approx([1.0, 1.0], abs=1e-3)
