"""A swarm of cases: every method, in 1, 2 and 30 dimensions, on functions of every kind, keeps bounds,
budgets, seeds and the callback's stop."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability
from trajopt.optimize.base import Budget, OptimizeResult, Status
from trajopt.optimize.search import minimize, optimizer_named, optimizer_names

Array = NDArray[np.float64]

NAMES = [n for n in optimizer_names() if Capability.RESIDUALS not in optimizer_named(n).needs]
KINDS = ("smooth", "kinked", "noisy", "constrained", "slow", "raising", "nan")
PAUSE, SECONDS, SLACK = 0.004, 0.06, 0.05
EVALUATIONS = 70


class Asked:
    """A function of one kind that remembers what it was asked."""

    def __init__(self, kind: str) -> None:
        self.kind, self.seen, self.longest = kind, [], 0.0  # type: ignore[var-annotated]
        self.rng = np.random.default_rng(3)

    def __call__(self, x: Any) -> Any:
        if getattr(x, "dtype", None) != np.float64 or x.ndim != 1:  # symbols, or a batch
            self.seen.append(None)
            raise TypeError("one candidate, please")
        self.seen.append(x.copy())
        began = time.perf_counter()
        if self.kind == "slow":
            time.sleep(PAUSE)
        value = float(((x - 0.3) ** 2).sum())
        if self.kind == "kinked":
            value = float(np.abs(x - 0.3).sum() + np.abs(x).max())
        if self.kind == "noisy":
            value += 0.1 * self.rng.random()
        if self.kind == "raising" and x[0] > 0.8:
            raise RuntimeError("not there")
        if self.kind == "nan" and x[0] > 0.8:
            value = np.nan
        self.longest = max(self.longest, time.perf_counter() - began)
        return value


def searched(name: str, kind: str, d: int, **options: Any) -> tuple[Asked, OptimizeResult]:
    """One search; skips where the method says that it cannot."""
    asked = Asked(kind)
    if kind == "constrained":
        options["constraints"] = [("ineq", lambda x: x[0] - 0.5)]
    try:
        found = minimize(asked, [[-1.0, 2.0]] * d, optimizer=name, seed=4, **options)
    except ArgumentError as refusal:
        if refusal.argument != "optimizer":
            raise
        pytest.skip(str(refusal))
    return asked, found


def inside(asked: Asked) -> bool:
    return all(np.all((x >= -1.0) & (x <= 2.0)) for x in asked.seen if x is not None)


def check(name: str, kind: str, d: int) -> None:
    budget = Budget(EVALUATIONS)
    asked, found = searched(name, kind, d, budget=budget)
    assert len(asked.seen) <= found.nfev <= EVALUATIONS
    assert inside(asked) or name == "pso-thesis-first"  # which may leave the space
    assert np.all((found.x >= -1.0) & (found.x <= 2.0))
    if kind in ("raising", "nan"):
        assert found.x[0] <= 0.8
    if kind != "noisy" and found.violation == 0.0:
        assert found.fun == Asked(kind)(found.x)
    _, same = searched(name, kind, d, budget=budget)
    assert found.x.tobytes() == same.x.tobytes()
    assert found.nfev == same.nfev
    stopped, ended = searched(name, kind, d, budget=budget, callback=lambda *_: True)
    assert ended.status is Status.CALLBACK
    told = [x for x in stopped.seen if x is not None]
    assert len(told) <= ended.failures + 4  # some look for batches first
    if kind == "slow":
        for attempt in range(3):  # the machine may be busy
            asked, found = searched(name, kind, d, budget=Budget(None, seconds=SECONDS))
            assert found.status in (Status.SECONDS, Status.CONVERGED, Status.STALLED)
            if found.seconds <= SECONDS + asked.longest + SLACK:
                break
            assert attempt < 2


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NAMES)
def test_two_dimensions(name: str, kind: str) -> None:
    check(name, kind, 2)


@pytest.mark.parametrize("d", [1, 30])
@pytest.mark.parametrize("name", NAMES)
def test_one_and_thirty_dimensions(name: str, d: int) -> None:
    check(name, "smooth", d)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS[1:])
@pytest.mark.parametrize("d", [1, 30])
@pytest.mark.parametrize("name", NAMES)
def test_all_others(name: str, d: int, kind: str) -> None:
    check(name, kind, d)
