"""What users get wrong, or do and are right to: each is used, or refused by name."""

from __future__ import annotations

import sys
import warnings
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import LinearConstraint, NonlinearConstraint
from scipy.sparse import csr_matrix

from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability
from trajopt.optimize.base import Budget, Status
from trajopt.optimize.functions import FunctionObjective
from trajopt.optimize.search import minimize, optimizer_named, optimizer_names
from trajopt.optimize.swarm import Swarm

Array = NDArray[np.float64]

BOX = [[-2.0, 3.0], [-1.5, 2.5]]
NAMES = [n for n in optimizer_names() if Capability.RESIDUALS not in optimizer_named(n).needs]


def rosenbrock(x: Array) -> float:
    return float((1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2)


def square(x: Array) -> float:
    return float(x @ x)


# -- answers

NUMBERS = [True, np.True_, 3, np.float32(2), np.array(1.5), np.array([[1.5]]), [1.5], (1.5,)]
NUMBERS += [Decimal("1.5"), Fraction(3, 2), 1e308, -1e308]


@pytest.mark.parametrize("answer", NUMBERS, ids=repr)
@pytest.mark.parametrize("name", ["pso", "slsqp"])
def test_every_kind_of_number_is_a_cost(answer: Any, name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # numbers near overflow are no reason to warn
        found = minimize(lambda _: answer, BOX, optimizer=name, budget=Budget(60))
    assert found.fun == float(np.squeeze(np.asarray(answer, dtype=np.float64)))
    assert found.failures == 0


@pytest.mark.parametrize(
    "answer",
    [
        np.inf,
        -np.inf,
        1 + 0j,
        b"1.5",
        [[1, 2], [3]],
        object(),
        ValueError("x"),
        np.datetime64("NaT"),
    ],
    ids=repr,
)
def test_what_is_no_number_is_none(answer: Any) -> None:
    found = minimize(lambda _: answer, BOX, optimizer="pso", budget=Budget(60))
    assert found.status is Status.FAILED
    assert found.failures == 59  # and one call that looked for batches


@pytest.mark.parametrize("error", [StopIteration, MemoryError, RecursionError, AssertionError])
@pytest.mark.parametrize("name", ["pso", "slsqp", "ipopt", "direct"])
def test_whatever_an_objective_raises_is_survived(error: type[Exception], name: str) -> None:
    def raises(x: Array) -> float:
        if x[0] > 1.5:
            raise error("there")
        return rosenbrock(x)

    found = minimize(raises, BOX, optimizer=name, budget=Budget(300))
    assert found.fun < 1.0
    assert found.x[0] <= 1.5
    if found.failures:
        assert error.__name__ in found.first_failure


# -- bounds and starts


@pytest.mark.parametrize(
    "bounds",
    [
        [[1.0, 1.0], [0.0, 2.0]],
        [[1.0, 1.0 + 1e-15], [0.0, 2.0]],
        [[0.0, 5e-324]] * 2,
        [[-1.7e308, 1.7e308]] * 2,
        [(None, 3.0), (0.0, 1.0)],
        [[False, True]] * 2,
        [],
        [-2.0, 3.0],
        "auto",
    ],
    ids=repr,
)
def test_bounds_that_hold_nothing_are_refused(bounds: Any) -> None:
    with pytest.raises(ArgumentError, match="bounds"):
        minimize(rosenbrock, bounds)


@pytest.mark.parametrize("name", NAMES)
def test_whole_numbers_narrow_and_far_bounds(name: str) -> None:
    """Bounds of whole numbers are numbers; a box of 1e-7 at 1e3 is searched as any other."""
    whole = minimize(square, np.array([[-2, 3], [-1, 2]]), optimizer=name, budget=Budget(150))
    same = minimize(square, [[-2.0, 3.0], [-1.0, 2.0]], optimizer=name, budget=Budget(150))
    assert whole.x.tobytes() == same.x.tobytes()

    def narrow(x: Array) -> float:
        return float((((x - 1e3) * 1e7 - 0.3) ** 2).sum())

    found = minimize(narrow, [[1e3, 1e3 + 1e-7]] * 2, optimizer=name, budget=Budget(300))
    assert found.fun < 0.1
    assert found.failures == 0


@pytest.mark.parametrize("name", NAMES)
def test_starts_at_corners(name: str) -> None:
    for corner in ([-2.0, -1.5], [3.0, 2.5], [3, -1.5]):
        found = minimize(square, BOX, x0=corner, optimizer=name, budget=Budget(300), seed=2)
        assert found.fun < 0.5
        assert found.failures == 0


@pytest.mark.parametrize(
    "x0", [[1.0], [[1.0, 1.0]], 1.0, "11", [1j, 1], [None, 1], [np.nan, 1.0], [9.0, 0.0]], ids=repr
)
def test_starts_that_are_none_are_refused(x0: Any) -> None:
    with pytest.raises(ArgumentError, match="x0"):
        minimize(rosenbrock, BOX, x0=x0)


# -- arguments and callbacks


def shifted(x: Array, a: float, b: float = 1.0) -> float:
    return float(((x - a) ** 2).sum()) * b


@pytest.mark.parametrize("args", [(1.0,), [1.0, 2.0], np.array([1.0])], ids=repr)
def test_args_are_a_sequence(args: Any) -> None:
    found = minimize(shifted, BOX, args=args, optimizer="slsqp", budget=Budget(200))
    assert found.fun < 1e-9


@pytest.mark.parametrize("args", [1.0, "a", {"a": 1}, None], ids=repr)
def test_args_that_are_none_are_refused(args: Any) -> None:
    with pytest.raises(ArgumentError, match="args"):
        minimize(shifted, BOX, args=args)


@pytest.mark.parametrize("seed", [True, None, 1.0, -1, "3", np.random.default_rng(0)], ids=repr)
def test_seeds_are_whole_numbers(seed: Any) -> None:
    with pytest.raises(ArgumentError, match="seed"):
        minimize(square, BOX, seed=seed)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("where", ["callback", "progress"])
@pytest.mark.parametrize(
    ("error", "status"),
    [
        (ZeroDivisionError, Status.CALLBACK),
        (StopIteration, Status.CALLBACK),
        (KeyboardInterrupt, Status.INTERRUPTED),
    ],
)
def test_what_callbacks_raise_ends_the_search(
    name: str, where: str, error: type[BaseException], status: Status
) -> None:
    calls: list[Any] = []

    def raises(*told: Any) -> None:
        calls.append(told)
        if len(calls) == 3:
            raise error

    options: Any = {where: raises}
    found = minimize(square, BOX, optimizer=name, budget=Budget(200), **options)
    assert found.status is status
    assert len(calls) == 3
    assert np.isfinite(found.fun)


def test_a_callback_cannot_change_the_search_and_a_wrong_one_is_said() -> None:
    def spoils(x: Array, *_: float) -> None:
        x.fill(9.0)

    plain = minimize(square, BOX, optimizer="pso", budget=Budget(200))
    spoiled = minimize(square, BOX, optimizer="pso", budget=Budget(200), callback=spoils)
    assert plain.x.tobytes() == spoiled.x.tobytes()
    one: Any = lambda x: None  # noqa: ARG005, E731
    found = minimize(square, BOX, optimizer="pso", budget=Budget(200), callback=one)
    assert found.status is Status.CALLBACK
    assert "TypeError" in found.message
    wrong: Any = 3
    with pytest.raises(ArgumentError, match="callback"):
        minimize(square, BOX, callback=wrong)


# -- budgets


@pytest.mark.parametrize("name", NAMES)
def test_the_smallest_budgets(name: str) -> None:
    for most in (1, 2, 3):
        found = minimize(square, BOX, optimizer=name, budget=Budget(most))
        assert found.status is Status.EVALUATIONS
        assert found.nfev == most
        assert np.isfinite(found.fun)
    found = minimize(rosenbrock, BOX, optimizer=name, budget=Budget(None, seconds=1e-9))
    assert found.status is Status.SECONDS
    assert np.isfinite(found.fun)  # one candidate is always evaluated
    assert found.nfev <= 2  # and perhaps a call that looks for batches
    met = minimize(square, BOX, optimizer=name, budget=Budget(100, target=1e9))
    assert met.status is Status.TARGET
    never = minimize(square, BOX, optimizer=name, budget=Budget(100, target=-np.inf))
    assert never.status in (Status.EVALUATIONS, Status.CONVERGED, Status.STALLED)


def test_a_search_within_a_search() -> None:
    def inner(x: Array) -> float:
        found = minimize(
            lambda y: float((y[0] - x[0]) ** 2), [[-1.0, 1.0]], optimizer="slsqp", budget=Budget(20)
        )
        return found.fun + float(x[1] ** 2)

    assert minimize(inner, BOX, optimizer="slsqp", budget=Budget(60)).fun < 1e-8


# -- constraints

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
    ids=repr,
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


# -- saved searches


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
