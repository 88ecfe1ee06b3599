"""What "auto" takes, and that it is no worse than the methods it takes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from trajopt.objectives.terminal import terminal_objective, with_free
from trajopt.optimize.base import Budget, Status
from trajopt.optimize.search import minimize
from trajopt.problem import load_problem

Array = NDArray[np.float64]

PROBLEMS = Path(__file__).parents[2] / "problems" / "smdw"


def rosenbrock(x: Array) -> float:
    return float(np.sum(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2))


def rastrigin(x: Array) -> float:
    y = x - 0.7
    return float(10 * len(x) + np.sum(y * y - 10 * np.cos(2 * np.pi * y)))


@pytest.mark.parametrize(
    ("function", "d", "near"), [(rosenbrock, 4, 1e-8), (rastrigin, 3, 1e-8)], ids=["smooth", "many"]
)
def test_plain_functions(function: Any, d: int, near: float) -> None:
    """Smooth ones by gradients; many minima by restarts of growing populations."""
    for seed in range(2):
        found = minimize(function, [[-5.0, 5.0]] * d, seed=seed, budget=Budget(20_000, target=near))
        assert found.status is Status.TARGET
        assert found.message.startswith("by l-bfgs-b")


def test_gradients_and_constraints_are_used() -> None:
    found = minimize(
        lambda x: (rosenbrock(x), 2 * x), [[-5.0, 5.0]] * 2, jac=True, budget=Budget(200)
    )
    assert "by slsqp" in found.message
    found = minimize(
        lambda x: float((x - 1) @ (x - 1)),
        [[-5.0, 5.0]] * 2,
        constraints=[("ineq", lambda x: 1.0 - x[0] - x[1]), ("eq", lambda x: x[0] - x[1])],
        budget=Budget(3000),
    )
    assert found.message.startswith("by slsqp, then pso")
    assert found.x == pytest.approx([0.5, 0.5], abs=1e-5)
    assert found.violation <= 1e-8


def test_exact_where_that_can_be() -> None:
    for name, free in (("table_5_3", ("p1", "p2")), ("table_5_3_1s", ("p1", "p2"))):
        problem = load_problem(PROBLEMS / f"{name}.toml")
        ideal = problem.replace({"actuator": None, "infeasible": None})
        objective = terminal_objective(with_free(ideal, *free))
        found = minimize(objective, objective.bounds)
        assert found.fun < 1e-9
        assert found.message.startswith("by lattice")
        assert "then" not in found.message


def test_where_nothing_is_exact_the_best_of_all_is_found() -> None:
    """Lattice alone: 9.21; IPOPT from 20 starts: 0.73."""
    problem = load_problem(PROBLEMS / "table_5_3_1s.toml")
    objective = terminal_objective(with_free(problem, "p1", "p2", "heading"))
    found = minimize(objective, objective.bounds, budget=Budget(8_000))
    assert "by lattice, then newton, then ipopt+newton, then pso" in found.message
    assert found.fun < 1.5


def test_where_no_motion_can_be_exact_none_is_looked_for() -> None:
    problem = load_problem(PROBLEMS / "table_5_3_1s.toml", {"actuator.duration": 0.9})
    objective = terminal_objective(problem)
    found = minimize(objective, objective.bounds, budget=Budget(300))
    assert found.message.startswith("no motion reaches the goal pose in 0.9 s")
    assert "by ipopt+newton" in found.message


def test_a_saved_search_goes_on_in_the_last_method(tmp_path: Path) -> None:
    file = tmp_path / "state.npz"
    box = [[-5.0, 5.0]] * 3
    first = minimize(rastrigin, box, state=file, budget=Budget(600))
    second = minimize(rastrigin, box, state=file, budget=Budget(600))
    assert first.message.startswith("by l-bfgs-b, then cma-es")
    assert second.message.startswith("by cma-es")
    assert second.fun <= first.fun
