"""What users get wrong, or do and are right to: each is used, or refused by name."""

from __future__ import annotations

import re
import warnings
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability
from trajopt.optimize.base import Budget, Status
from trajopt.optimize.search import minimize, optimizer_named, optimizer_names


def told(value: object) -> str:
    """Without addresses: all workers of a test run must name a test alike."""
    return re.sub(r" at 0x\w+", "", repr(value))


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


@pytest.mark.parametrize("answer", NUMBERS, ids=told)
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
    ids=told,
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
    ids=told,
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
    "x0", [[1.0], [[1.0, 1.0]], 1.0, "11", [1j, 1], [None, 1], [np.nan, 1.0], [9.0, 0.0]], ids=told
)
def test_starts_that_are_none_are_refused(x0: Any) -> None:
    with pytest.raises(ArgumentError, match="x0"):
        minimize(rosenbrock, BOX, x0=x0)


# -- arguments and callbacks


def shifted(x: Array, a: float, b: float = 1.0) -> float:
    return float(((x - a) ** 2).sum()) * b


@pytest.mark.parametrize("args", [(1.0,), [1.0, 2.0], np.array([1.0])], ids=told)
def test_args_are_a_sequence(args: Any) -> None:
    found = minimize(shifted, BOX, args=args, optimizer="slsqp", budget=Budget(200))
    assert found.fun < 1e-9


@pytest.mark.parametrize("args", [1.0, "a", {"a": 1}, None], ids=told)
def test_args_that_are_none_are_refused(args: Any) -> None:
    with pytest.raises(ArgumentError, match="args"):
        minimize(shifted, BOX, args=args)


@pytest.mark.parametrize("seed", [True, None, 1.0, -1, "3", np.random.default_rng(0)], ids=told)
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
