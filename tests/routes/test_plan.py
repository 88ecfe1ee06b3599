"""Routes among obstacles: free by an independent check, timed within limits, or refused with proof."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely

from benchmarks.routes.check import independent_clearance
from trajopt.pipeline import solve
from trajopt.problem import Problem
from trajopt.solution import Solution

ROOM: dict[str, Any] = {
    "title": "a room with a partition",
    "robot": {"name": "small-differential"},
    "start": {"pose": [0.8, 0.8, 0.0]},
    "goal": {"pose": [5.2, 1.0, 0.0]},
    "space": {"x": [0.0, 6.0], "y": [0.0, 4.0]},
    "obstacles": [
        {"name": "partition", "kind": "wall", "height": 1.0, "start": [3.0, 0.0], "end": [3.0, 2.4],
         "thickness": 0.1},
    ],
    "ground": {"friction": 0.5},
    "limits": {"speed": 1.0, "acceleration": 0.8, "deceleration": 0.8, "clearance": 0.05},
}  # fmt: skip


def solids_of(tables: dict[str, Any]) -> list[shapely.Geometry]:
    """The room's wall and what is outside of its space, built from the tables alone."""
    found: list[shapely.Geometry] = []
    for wall in tables["obstacles"]:
        line = shapely.LineString([wall["start"], wall["end"]])
        found.append(line.buffer(wall["thickness"] / 2, cap_style="flat"))
    (x0, x1), (y0, y1) = tables["space"]["x"], tables["space"]["y"]
    room = shapely.box(x0, y0, x1, y1)
    return [*found, room.buffer(5.0).difference(room)]


@pytest.fixture(scope="module")
def solution() -> Solution:
    return solve(Problem.model_validate(ROOM))


def test_the_route_holds(solution: Solution) -> None:
    assert solution.holds, solution.faults
    assert solution.trajectory is not None
    end = solution.trajectory.at([0.0, solution.duration])
    assert end.pose == pytest.approx(np.array([[0.8, 0.8, 0.0], [5.2, 1.0, 0.0]]), abs=1e-6)
    assert end.twist == pytest.approx(np.zeros((2, 3)), abs=1e-9)


def test_the_outline_is_free_by_an_independent_check(solution: Solution) -> None:
    assert solution.path is not None
    assert solution.clearance is not None
    found = independent_clearance(solution.path, solution.problem.robot, solids_of(ROOM))
    assert found >= 0.05 - 1e-6
    assert solution.clearance.bound <= found + 1e-6
    assert solution.clearance.distance == pytest.approx(found, abs=2e-3)


def test_what_is_reported_is_the_better(solution: Solution) -> None:
    assert solution.route is not None
    assert solution.route.best is not None
    found = {a.method: a.cost("duration") for a in solution.route.attempts}
    assert solution.duration == min(found.values())
    assert solution.route.best.method in solution.status
    assert found["one program"] <= found["two stages"]


def test_a_gap_too_narrow_is_proven() -> None:
    """The robot is 0.425 m wide: 1 cm less cannot be passed."""
    gap = {**ROOM["obstacles"][0], "end": [3.0, 4.0 - 0.415]}
    tables = {**ROOM, "obstacles": [gap], "limits": {**ROOM["limits"], "clearance": None}}
    found = solve(Problem.model_validate(tables))
    assert not found.holds
    assert found.trajectory is None
    assert "no route exists" in found.status


def test_ends_that_are_not_free_are_named() -> None:
    tables = {**ROOM, "goal": {"pose": [3.0, 1.0, 0.0]}}
    assert "at the goal" in solve(Problem.model_validate(tables)).status
