"""The least time to a goal pose through wheels of limited speed: closed forms, and motions that do it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from trajopt.objectives.reach import least_time
from trajopt.objectives.terminal import terminal_objective
from trajopt.optimize.base import Budget
from trajopt.pipeline import solve
from trajopt.problem import load_problem

FILE = Path(__file__).parents[2] / "problems" / "smdw" / "table_5_3_1s.toml"
R, HALF = 0.098, 0.692  # LOC8: wheel radius, half-track and half-base together, m
INVERSE = np.array([[1, -1, -HALF], [1, 1, HALF], [1, 1, -HALF], [1, -1, HALF]]) / R
V = 30.0 * R  # m/s, of the rims


def bound(goal: list[float], given: float = 1e-3, start: tuple[float, ...] = (0, 0, 0)) -> float:
    return least_time(INVERSE, 30.0, np.array(start), np.array(goal), given)


@pytest.mark.parametrize(
    ("goal", "way"),
    [
        ([2.0, 0.0, 0.0], 2.0),  # along an axis
        ([0.0, -1.0, 0.0], 1.0),
        ([0.0, 0.0, 1.5], 1.5 * HALF),
        ([0.0, 0.0, -1.5], 1.5 * HALF),
        ([2.0, 0.0, 1.5], 2.0 + 1.5 * HALF),  # straight ahead, then turning
        ([2.0, 0.0, -1.5], 2.0 + 1.5 * HALF),
    ],
)
def test_closed_forms(goal: list[float], way: float) -> None:
    assert bound(goal) == pytest.approx(way / V, rel=2e-3)
    assert bound(goal) <= way / V * (1 + 1e-9)


@pytest.mark.parametrize("yaw", [0.0, 0.4, -0.7])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_turning_towards_the_way_pays_where_it_is_far(side: float, yaw: float) -> None:
    """Across at 30 deg: |vx| + |vy| is 1.366, or turn by 30 deg and back; whatever way it all lies."""
    far, near = 10.0, 0.1
    angle = yaw + side * np.pi / 6
    across = far * np.array([np.cos(angle), np.sin(angle)])
    start = (0.0, 0.0, yaw)
    best = (far + np.pi / 3 * HALF) / V
    assert bound([*across, yaw], start=start) == pytest.approx(best, rel=5e-3)
    assert bound([*across, yaw], start=start) <= best * (1 + 1e-9)
    assert bound([*across, yaw], 1.001 * best, start) == 0.0  # that motion takes no more
    assert (
        bound([*across, yaw], 1.001 * far / V, start) > 0.0
    )  # without the turns it does not get there
    assert bound([*across * near / far, yaw], start=start) == pytest.approx(
        near * (np.sqrt(3) + 1) / 2 / V,
        rel=1.2e-2,  # the steps of p and q
    )


def test_no_motion_is_faster_than_its_bound() -> None:
    """Random motions of random wheel speeds: none gets to where it ends before the bound."""
    rng = np.random.default_rng(0)
    forward = np.linalg.pinv(INVERSE)
    for _ in range(40):
        body = forward @ rng.uniform(-1.0, 1.0, 4)
        pose, seconds = np.zeros(3), 0.0
        for _ in range(rng.integers(1, 5)):
            body = forward @ rng.uniform(-1.0, 1.0, 4)
            body *= 30.0 / np.abs(INVERSE @ body).max()
            lasts = rng.uniform(0.05, 0.4)
            for step in np.full(400, lasts / 400):
                c, s = np.cos(pose[2] + body[2] * step / 2), np.sin(pose[2] + body[2] * step / 2)
                pose += step * np.array(
                    [c * body[0] - s * body[1], s * body[0] + c * body[1], body[2]]
                )
            seconds += lasts
        assert bound(list(pose), seconds * 0.2) <= seconds * (1 + 1e-4)


def test_what_cannot_be_is_told_with_what_would_do() -> None:
    """2 m and 67.5 deg in 0.9 s at 30 rad/s. In 1 s it can be: 1.3066 m along the first heading, the
    turn, and 0.7929 m across take 0.9914 s."""
    problem = load_problem(FILE)
    assert terminal_objective(problem).impossible() == ""
    short = problem.replace({"actuator.duration": 0.9})
    told = terminal_objective(short).impossible()
    assert "0.98" in told
    assert "32.7" in told
    found = solve(short, optimizer="pso", budget=Budget(200))
    assert told in found.status
    enough = problem.replace({"actuator.duration": 0.9, "actuator.saturation": 40.0})
    assert terminal_objective(enough).impossible() == ""
