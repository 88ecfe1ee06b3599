"""Saved searches: of what they are, and that they go on as if they had never been stopped."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from trajopt.errors import ArgumentError
from trajopt.optimize.base import Budget
from trajopt.optimize.functions import FunctionObjective
from trajopt.optimize.search import minimize
from trajopt.optimize.swarm import Swarm

BOX = [[-2.0, 3.0], [-1.5, 2.5]]
CUBE = [[-2.0, 3.0]] * 3
Array = NDArray[np.float64]


def square(x: Array) -> float:
    return float(x @ x)


def other(x: Array) -> float:
    return float(((x - 0.5) ** 2).sum())


def test_a_state_of_another_problem_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "state.npz"
    limited = [("ineq", lambda x: x[0])]
    minimize(square, BOX, optimizer="pso", state=file, budget=Budget(100))
    more = minimize(square, BOX, optimizer="pso", state=file, budget=Budget(100))
    assert more.nfev == 100
    for function, constraints in ((other, ()), (lambda x: square(x), ()), (square, limited)):
        with pytest.raises(ArgumentError, match="objective"):
            minimize(function, BOX, optimizer="pso", constraints=constraints, state=file)
    with pytest.raises(ArgumentError, match="optimizer"):
        minimize(square, BOX, optimizer="pso-gbest", state=file)
    with pytest.raises(ArgumentError, match="bounds"):
        minimize(square, [[-2.0, 3.0], [-1.5, 2.6]], optimizer="pso", state=file)


def test_exit_keeps_the_state(tmp_path: Path) -> None:
    file, calls = tmp_path / "state.npz", []

    def leaves(x: Array) -> float:
        calls.append(x)
        if len(calls) == 150:
            sys.exit(3)
        return square(x)

    with pytest.raises(SystemExit):
        minimize(leaves, BOX, optimizer="pso", state=file, budget=Budget(1000))
    assert file.exists()
    found = minimize(leaves, BOX, optimizer="pso", state=file, budget=Budget(100))
    assert found.nfev == 100


@pytest.mark.parametrize("stop", [15, 150, 299])
def test_resumed_with_the_rest_of_its_budget_a_search_is_the_one_in_one_go(
    stop: int, tmp_path: Path
) -> None:
    """The inertia goes on falling where it was: particles and generations are those of one search."""
    d, n, generations = 3, 15, 20
    seen: list[Array] = []

    def batch(x: Array) -> Array:
        seen.append(x.copy())
        return np.asarray(((x - 0.3) ** 2).sum(axis=1) + np.abs(np.sin(9 * x)).sum(axis=1))

    def run(most: int, state: Path | None, callback: Any = None) -> Any:
        objective, box = FunctionObjective(batch, d, batch=True), [[-2.0, 3.0]] * d
        options: Any = {"budget": Budget(most), "state": state, "callback": callback}
        return minimize(objective, box, optimizer="pso", seed=5, **options)

    whole = run(n * generations, None)
    straight = np.concatenate(seen)
    seen.clear()
    file = tmp_path / "state.npz"
    run(n * generations, file, lambda *_: sum(map(len, seen)) >= stop)
    first = np.concatenate(seen)
    seen.clear()
    kept = len(first) - n  # the generation in which it was stopped is evaluated again
    rest = run(n * generations - kept, file)
    together = np.concatenate([first[:kept], *seen])
    np.testing.assert_array_equal(together, straight)
    assert rest.x.tobytes() == whole.x.tobytes()


def test_an_ended_search_settles_further_when_resumed(tmp_path: Path) -> None:
    """With the inertia of a beginner it would fly apart: it goes on between, and ends lower."""
    file = tmp_path / "state.npz"
    inertias: list[float] = []
    learn = Swarm.learn

    def remembered(self: Swarm, *answers: Array) -> None:
        inertias.append(self._inertia())
        learn(self, *answers)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(Swarm, "learn", remembered)
        costs = [
            minimize(
                *(square, CUBE),
                optimizer="pso",
                state=file,
                budget=Budget(1500),
            ).fun
            for _ in range(3)
        ]
    first, second, third = np.array_split(np.array(inertias), 3)
    assert first[0] > 0.79
    assert second[: len(second) // 9].max() < 0.66  # half of the two budgets together
    assert third[: len(third) // 9].max() < 0.61
    for part in (first, second, third):
        assert part[-1] < 0.53
    assert costs[2] <= costs[1] <= costs[0]
