"""The compiled swarm against the readable prediction: the same formulas, to 1e-12 of the wheel
travel."""

from __future__ import annotations

import numpy as np
import pytest
from smdw_problems import SMDW, smdw_problem

from trajopt.objectives.terminal import TerminalObjective, terminal_objective, with_free
from trajopt.systems.smdw.thesis import through_drives

pytest.importorskip("numba")

SPACES = [("p1",), ("p2",), ("p1", "p2"), ("p1", "p2", "duration"), ("p1", "p2", "heading")]


def objective(name: str, *free: str, ideal: bool = False, **drives: float) -> TerminalObjective:
    problem = smdw_problem(name)
    if not ideal:
        changes = {f"actuator.{key}": value for key, value in drives.items()}
        problem = through_drives(problem).replace(changes)
    return terminal_objective(with_free(problem, *free))


@pytest.mark.parametrize("free", SPACES)
@pytest.mark.parametrize("name", SMDW)
@pytest.mark.parametrize("count", [1, 50])
def test_final_states_and_costs_agree_with_the_readable_form(
    name: str, free: tuple[str, ...], count: int
) -> None:
    asked = objective(name, *free)
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
    "drives",
    [
        {"saturation": 1e6, "dead_zone": 0.0},
        {"saturation": 30.0, "dead_zone": 0.0},
        {"saturation": 5.0, "dead_zone": 4.9},
    ],
)
def test_extreme_actuators_agree(drives: dict[str, float]) -> None:
    asked = objective(SMDW[0], "p2", **drives)
    z = np.random.default_rng(1).uniform(*asked.bounds.T, size=(7, 2))
    readable = asked.evaluate_readable(z).cost
    assert np.max(np.abs(asked.evaluate(z).cost - readable)) <= 1e-11 * max(
        1.0, float(np.max(readable))
    )


def test_affine_costs_agree_with_the_prediction() -> None:
    for name in SMDW:
        asked = objective(name, "p1", "p2", ideal=True)
        z = np.random.default_rng(2).uniform(*asked.bounds.T, size=(20, 4))
        assert np.max(np.abs(asked.evaluate(z).cost - asked.evaluate_readable(z).cost)) <= 1e-10
