"""What optimizers say of their end, and budgets on objectives that are more than a plain
function."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from trajopt.bench.problems import objective_named
from trajopt.errors import ArgumentError, MissingDependencyError
from trajopt.objectives.base import Evaluation
from trajopt.optimize.base import Budget, Status
from trajopt.optimize.pso import ParticleSwarm
from trajopt.optimize.run import Run
from trajopt.optimize.scipy import ScipyLocal
from trajopt.optimize.search import minimize, optimizer_names
from trajopt.optimize.starts import Starts

BOX = np.array([[-2.0, 3.0], [-1.5, 2.5]])


@dataclass
class Counted:
    """An objective that counts what is asked of it."""

    inner: Any
    asked: list[int] = field(default_factory=list)
    dimension: int = 0
    provides: frozenset[Any] = frozenset()
    constrained: bool = False

    def __post_init__(self) -> None:
        self.dimension, self.provides = self.inner.dimension, self.inner.provides
        self.constrained = self.inner.constrained

    def __getattr__(self, name: str) -> Any:
        if name == "inner":
            raise AttributeError(name)
        return getattr(self.inner, name)

    def evaluate(self, candidates: np.ndarray) -> Evaluation:
        self.asked.append(len(candidates))
        return self.inner.evaluate(candidates)

    def score(self, candidate: np.ndarray) -> Evaluation:
        return self.inner.score(candidate)

    def residuals(self, z: Any, turns: Any, *, exact: bool = False) -> list[Any]:
        if isinstance(z, np.ndarray):
            self.asked.append(1 if z.ndim == 1 else z.shape[1])
        return self.inner.residuals(z, turns, exact=exact)


@pytest.mark.parametrize("name", optimizer_names())
@pytest.mark.parametrize(
    "problem",
    [
        "smdw/scenario_1_lateral/p2",
        "smdw/scenario_1_lateral/p1+p2+heading/limits",
        "asoc/dry_sand",
        "corridor/1/length",
    ],
)
def test_budgets_hold_on_objectives_of_every_kind(name: str, problem: str) -> None:
    inner, bounds = objective_named(problem)
    for limit in (1, 7, 200):
        counted = Counted(inner)
        try:
            found = minimize(counted, bounds, optimizer=name, seed=1, budget=Budget(limit))
        except MissingDependencyError as missing:
            pytest.skip(str(missing))
        except ArgumentError as refusal:
            if refusal.argument == "optimizer":  # not made for this objective, and says so
                return
            raise
        assert found.nfev <= limit
        assert sum(counted.asked) <= found.nfev


def test_ipopt_counts_gradients_and_hessians() -> None:
    objective, bounds = objective_named("asoc/dry_sand")
    found = minimize(objective, bounds, optimizer="ipopt", budget=Budget(300))
    assert found.nhev > 0
    assert found.ngev > 0
    assert found.construct_seconds > 0


def smooth(x: np.ndarray) -> float:
    return float(np.sum((x - 0.3) ** 2))


@pytest.mark.parametrize("method", ["SLSQP", "L-BFGS-B", "Nelder-Mead", "trust-constr"])
def test_scipys_flag_decides(method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from scipy import optimize

    search = ScipyLocal(method, starts=2)
    honest = minimize(smooth, BOX, optimizer=replace(search, tolerance=1e-6), budget=Budget(5000))
    assert honest.status is Status.CONVERGED
    assert "2 of 2 starts converged" in honest.message
    genuine = optimize.minimize

    def failing(*arguments: Any, **options: Any) -> Any:
        result = genuine(*arguments, **options)
        return SimpleNamespace(
            x=result.x + 0.1, nit=result.nit, success=False, message="line search failed"
        )

    monkeypatch.setattr(optimize, "minimize", failing)
    stalled = minimize(smooth, BOX, optimizer=replace(search, tolerance=1e-6), budget=Budget(5000))
    assert stalled.status is Status.STALLED
    assert not stalled.success
    assert "0 of 2 starts converged" in stalled.message
    assert "line search failed" in stalled.message


def test_the_start_that_found_the_best_decides() -> None:
    run = Run(Counted(objective_named("smdw/scenario_1_lateral/p2")[0]), BOX, Budget(10))
    starts = Starts(run)
    run.best_cost, run.best_violation = 2.0, 0.0
    starts.ended(True, "fine")
    run.best_cost = 1.0
    starts.ended(False, "gave up.")
    starts.ended(True, "fine")
    status, text = starts.verdict()
    assert status is Status.STALLED
    assert text == "2 of 3 starts converged; the best said 'gave up'"


def test_the_processor_clock_stands_still_while_waiting() -> None:
    import time

    def slow(x: np.ndarray) -> float:
        time.sleep(0.002)
        return smooth(x)

    wall = minimize(slow, BOX, optimizer="pso", budget=Budget(evaluations=100_000, seconds=0.3))
    assert wall.status is Status.SECONDS
    cpu = minimize(
        slow, BOX, optimizer="pso", budget=Budget(evaluations=150, seconds=0.3, clock="cpu")
    )
    assert cpu.status is Status.EVALUATIONS
    assert cpu.seconds < 0.25
    with pytest.raises(ArgumentError, match=r"budget\.clock"):
        Budget(clock="sundial")  # type: ignore[arg-type]  # wrong on purpose


def test_damaged_files_are_named(tmp_path: Path) -> None:
    from trajopt.optimize.swarm import Swarm

    ParticleSwarm().swarm(BOX, np.random.default_rng(0)).save(tmp_path / "s.npz")
    whole = (tmp_path / "s.npz").read_bytes()
    for damaged in (
        whole[: len(whole) // 2],
        whole[:200] + b"\x00" * 200 + whole[400:],
        b"PK\x03\x04",
    ):
        (tmp_path / "s.npz").write_bytes(damaged)
        with pytest.raises(ArgumentError, match=r"Swarm\.save"):
            Swarm.load(tmp_path / "s.npz")
