"""The compiled swarm against the readable prediction: the same formulas, to 1e-12 of the wheel
travel."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from trajopt.objectives.terminal import TerminalObjective, terminal_objective, with_free
from trajopt.problem.search import Problem, load_problem

pytest.importorskip("numba")

FILES = sorted((Path(__file__).parents[2] / "problems" / "smdw").glob("scenario_*.toml")) + sorted(
    (Path(__file__).parents[2] / "problems" / "smdw").glob("table_*.toml")
)
SPACES = [("p1",), ("p2",), ("p1", "p2"), ("p1", "p2", "duration"), ("p1", "p2", "heading")]


def objective(file: Path, *free: str, enabled: bool = True, **actuator: float) -> TerminalObjective:
    problem = load_problem(file)
    assert isinstance(problem, Problem)
    return terminal_objective(
        with_free(problem.replace(actuator={"enabled": enabled, **actuator}), *free)
    )


@pytest.mark.parametrize("free", SPACES)
@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
@pytest.mark.parametrize("count", [1, 50])
def test_final_states_and_costs_agree_with_the_readable_form(
    file: Path, free: tuple[str, ...], count: int
) -> None:
    asked = objective(file, *free)
    z = np.random.default_rng(count).uniform(*asked.bounds.T, size=(count, asked.dimension))
    end = asked.predict_readable(z.T)
    wanted = np.vstack([end.x, end.y, end.yaw, *end.wheels])
    scale = max(1.0, float(np.max(np.abs(wanted))))
    final = asked.predict(z.T)
    got = np.vstack([final.x, final.y, final.yaw, *final.wheels])
    assert np.max(np.abs(got - wanted)) <= 1e-12 * scale
    cost = asked.evaluate_readable(z).cost
    assert (
        np.max(np.abs(asked.evaluate(z).cost - cost)) <= 3e-11 * scale
    )  # gains up to 12.5 on four angles


@pytest.mark.parametrize(
    "actuator",
    [
        {"saturation": 1e6, "dead_zone": 0.0},
        {"saturation": 30.0, "dead_zone": 0.0},
        {"saturation": 5.0, "dead_zone": 4.9},
    ],
)
def test_extreme_actuators_agree(actuator: dict[str, float]) -> None:
    asked = objective(FILES[0], "p2", **actuator)
    z = np.random.default_rng(1).uniform(*asked.bounds.T, size=(7, 2))
    readable = asked.evaluate_readable(z).cost
    assert np.max(np.abs(asked.evaluate(z).cost - readable)) <= 1e-11 * max(
        1.0, float(np.max(readable))
    )


def test_affine_costs_agree_with_the_prediction() -> None:
    for file in FILES:
        asked = objective(file, "p1", "p2", enabled=False)
        z = np.random.default_rng(2).uniform(*asked.bounds.T, size=(20, 4))
        assert np.max(np.abs(asked.evaluate(z).cost - asked.evaluate_readable(z).cost)) <= 1e-10
