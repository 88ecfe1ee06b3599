"""Routes: what searches see against the path itself, brute force and the exact time scaling."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from trajopt.objectives.route import RESERVE, Corridor, RouteObjective
from trajopt.optimize.base import Budget
from trajopt.optimize.search import minimize
from trajopt.systems.powerbot.bench_problems import (
    LENGTH,
    RADIUS,
    WALLS,
    moved_knots,
    random_corridor,
)

EXPERIMENT = Path(__file__).parents[2] / "problems" / "powerbot" / "experiment_1.toml"


def calm(objective: RouteObjective, count: int, seed: int = 0) -> np.ndarray:
    """Candidates near the middle of the bounds: no wild bends."""
    low, high = objective.bounds.T
    return (low + high) / 2 + 0.2 * (high - low) * (
        np.random.default_rng(seed).random((count, len(low))) - 0.5
    )


def test_lengths_are_those_of_the_path() -> None:
    objective = random_corridor(1, "length")
    z = calm(objective, 6)
    for x, cost in zip(z, objective.evaluate(z).cost, strict=True):
        assert cost == pytest.approx(objective.path(x).length, rel=1e-9)
        assert objective.score(x).cost[0] == pytest.approx(cost, rel=1e-9)


@pytest.mark.parametrize("objective", [random_corridor(2, "duration"), moved_knots(EXPERIMENT)])
def test_durations_of_swarms_are_near_those_of_time_scaling(objective: RouteObjective) -> None:
    z = calm(objective, 5)
    costs = objective.evaluate(z).cost
    for x, cost in zip(z, costs, strict=True):
        assert cost == pytest.approx(objective.score(x).cost[0], rel=5e-3)
        assert objective.evaluate(x[None]).cost[0] == pytest.approx(
            cost, rel=1e-12
        )  # alone as in the swarm


def test_straight_and_free_is_the_shortest() -> None:
    objective = replace(random_corridor(3, "length"), corridor=Corridor())
    assert not objective.constrained
    start, goal = objective.values[0], objective.values[-1]
    found = minimize(objective, objective.bounds, optimizer="ipopt", budget=Budget(2000))
    assert found.fun == pytest.approx(float(np.hypot(*(goal - start))), rel=1e-9)


def test_a_straight_start_to_goal_takes_the_time_of_the_book() -> None:
    """Accelerate at a, cruise at v, brake at a: L / v + v / a."""
    objective = replace(random_corridor(3, "duration"), corridor=Corridor())
    straight = objective.values.copy()
    straight[:, 1] = 0.0
    objective = replace(objective, values=straight)
    x = straight[1:-1].ravel()
    wanted = LENGTH / 2.1 + 2.1 / 0.55
    assert objective.score(x).cost[0] == pytest.approx(
        wanted, rel=1e-5
    )  # the slow-down of time scaling
    assert objective.evaluate(x[None]).cost[0] == pytest.approx(wanted, rel=2e-3)


@pytest.mark.parametrize("seed", [1, 2, 5])
def test_violation_is_the_depth_by_brute_force(seed: int) -> None:
    objective = random_corridor(seed, "length")
    for x in calm(objective, 8, seed):
        path = objective.path(x)
        p = path.position(np.linspace(path.start, path.end, 4001))[:, :2]
        rooms = [np.hypot(*(p - o[:2]).T) - o[2] - RADIUS for o in objective.corridor.obstacles]
        rooms += [p[:, 1] - WALLS[0] - RADIUS, WALLS[1] - RADIUS - p[:, 1]]
        depth = max(0.0, -float(np.min(rooms)))
        assert objective.score(x).violation[0] == pytest.approx(depth, abs=1e-3)
        near = 2e-4 + 1e-3 * depth
        seen = objective.evaluate(x[None])
        assert seen.violation[0] == pytest.approx(depth + RESERVE, abs=near) or not depth
        assert seen.constraints is not None
        assert seen.constraints[0].min() == pytest.approx(float(np.min(rooms)), abs=near)


@pytest.mark.parametrize("seed", range(1, 7))
def test_every_corridor_can_be_driven(seed: int) -> None:
    objective = random_corridor(seed, "length")
    found = minimize(objective, objective.bounds, optimizer="pso", seed=0, budget=Budget(10_000))
    assert found.violation == 0.0
    assert found.fun < 1.5 * LENGTH
    assert random_corridor(seed, "length").corridor == objective.corridor  # the seed decides


def test_gradients_are_those_of_differences() -> None:
    objective = random_corridor(4, "length")
    h = 1e-6 * np.eye(objective.dimension)
    for x in calm(objective, 3):
        ahead, behind = objective.evaluate(x + h), objective.evaluate(x - h)
        assert ahead.constraints is not None
        assert behind.constraints is not None
        slopes = (ahead.cost - behind.cost) / 2e-6
        np.testing.assert_allclose(objective.gradient(x), slopes, atol=1e-7)
        rows = (ahead.constraints - behind.constraints).T / 2e-6
        np.testing.assert_allclose(objective.jacobian(x), rows, atol=1e-7)


@pytest.mark.parametrize(("corridor", "length"), [(1, 12.6568), (2, 12.4656)])
@pytest.mark.parametrize("seed", range(3))
def test_corridors_are_solved_as_well_as_by_hand(corridor: int, length: float, seed: int) -> None:
    """SLSQP by hand, one constraint an obstacle and wall: 12.6568 and 12.4655 m."""
    objective = random_corridor(corridor, "length")
    budget = Budget(3_000, target=length)
    for name in ("slsqp", "ipopt") if seed == 0 else ("slsqp",):
        found = minimize(objective, objective.bounds, optimizer=name, seed=seed, budget=budget)
        assert found.fun <= length
        assert found.violation == 0.0
    swarm = minimize(objective, objective.bounds, seed=seed, optimizer="pso")
    assert swarm.fun <= 1.001 * length
    assert swarm.violation == 0.0


@pytest.mark.parametrize(("corridor", "length"), [(1, 12.67), (2, 12.4656)])
def test_trust_constr_solves_corridors(corridor: int, length: float) -> None:
    """Its inner steps end before the optimum of the first corridor, 0.1 % above."""
    objective = random_corridor(corridor, "length")
    budget = Budget(3_000, target=length)
    found = minimize(objective, objective.bounds, optimizer="trust-constr", budget=budget)
    assert found.fun <= length
    assert found.violation == 0.0


def test_starts_pass_each_obstacle_on_either_side() -> None:
    objective = random_corridor(2, "length")
    starts = objective.starts()
    assert starts.shape == (16, objective.dimension)
    assert (starts >= objective.bounds[:, 0]).all()
    assert (starts <= objective.bounds[:, 1]).all()
    sides = set()
    for x in starts:
        path = objective.path(x)
        p = path.position(np.linspace(path.start, path.end, 2001))
        above = [np.interp(a, p[:, 0], p[:, 1]) > b for a, b, _ in objective.corridor.obstacles]
        sides.add(tuple(above))
    assert len(sides) >= 12


def test_a_route_without_a_direction_costs_inf_and_harms_no_other() -> None:
    objective = random_corridor(1, "duration")
    z = calm(objective, 3)
    standing = replace(objective, values=np.zeros_like(objective.values))
    still = np.zeros((1, objective.dimension))
    costs = standing.evaluate(np.vstack([z[:1], still, z[1:2]])).cost
    assert np.isinf(costs[1])
    assert np.isfinite(costs[[0, 2]]).all()
    assert np.isinf(standing.score(still[0]).cost[0])
