"""The planner's promises, recomputed from outside: exact wheels, free ground, contact at the wanted
place."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from trajopt.errors import ArgumentError, ProblemError
from trajopt.objectives.clearance import ClearObjective
from trajopt.objectives.terminal import TerminalObjective
from trajopt.optimize.search import minimize
from trajopt.pipeline import solve
from trajopt.problem import Problem, load_problem
from trajopt.systems.smdw.climbing import Motion, collision_reach
from trajopt.systems.smdw.configurations import (
    approach_target,
    configurations,
    configurations_of,
    wheel_of,
)
from trajopt.systems.smdw.entry import WHEELS, free_ground, step_of
from trajopt.systems.smdw.planner import Maneuver, Plan, Refused, plan_climb, plan_configuration
from trajopt.world.free_ground import FreeGround, path_margin

PROBLEMS = Path(__file__).parents[3] / "problems" / "smdw"
FILES = ("step_5cm.toml", "step_3_5cm.toml")


@pytest.fixture(scope="module", params=FILES)
def maneuver(request: pytest.FixtureRequest) -> Maneuver:
    return plan_climb(load_problem(PROBLEMS / request.param))


def test_the_theses_three_configurations_have_plans(maneuver: Maneuver) -> None:
    names = [p.configuration.name for p in maneuver.plans]
    assert {"lateral left", "forward -35 deg", "forward -45 deg"} <= set(names)
    assert len(names) == 6
    assert [p.duration for p in maneuver.plans] == sorted(p.duration for p in maneuver.plans)


def test_final_wheel_angles_are_exact_by_plain_quadrature(maneuver: Maneuver) -> None:
    """The wheel integral along the spline, by scipy.quad on the textbook Mecanum formula."""
    radius, length = 0.098, 0.692
    for plan in maneuver.plans:
        path = plan.path

        def rate(u: float, wheel: int, path=path) -> float:
            d, yaw = path.position([u], 1)[0], path.yaw([u])[0]
            vx = math.cos(yaw) * d[0] + math.sin(yaw) * d[1]
            vy = -math.sin(yaw) * d[0] + math.cos(yaw) * d[1]
            w = path.yaw([u], 1)[0]
            across, turn = ((-1, -1), (1, 1), (1, -1), (-1, 1))[wheel]
            return (vx + across * vy + turn * length * w) / radius

        for name in plan.configuration.critical:
            i = WHEELS.index(name)
            angle = sum(quad(rate, a, a + 1, args=(i,), epsabs=1e-11)[0] for a in (1.0, 2.0, 3.0))
            error = angle - plan.target.wheels[i]
            assert abs(error - 2 * math.pi * round(error / (2 * math.pi))) < 1e-6
        assert plan.wheel_error < 1e-6


def test_footprint_stays_on_free_ground(maneuver: Maneuver) -> None:
    ground = free_ground(maneuver.problem)
    edge = step_of(maneuver.problem).place[0]
    for plan in maneuver.plans:
        state = plan.trajectory.at(np.linspace(0, plan.duration, 1500))
        corners = np.array(ground.footprint)
        cos, sin = np.cos(state.pose[:, 2]), np.sin(state.pose[:, 2])
        x = state.pose[:, :1] + np.outer(cos, corners[:, 0]) - np.outer(sin, corners[:, 1])
        y = state.pose[:, 1:2] + np.outer(sin, corners[:, 0]) + np.outer(cos, corners[:, 1])
        assert x.min() >= ground.x[0]
        assert x.max() <= min(edge, ground.x[1])
        assert y.min() >= ground.y[0]
        assert y.max() <= ground.y[1]
        assert min(plan.trajectory.margins().values()) >= -1e-9
        assert 0 <= plan.room <= maneuver.problem.climb.gap + 1e-9


def test_rolling_on_from_the_target_meets_the_step_in_the_middle_of_the_window(
    maneuver: Maneuver,
) -> None:
    """Drive the remaining travel by hand: phase, distance to the edge, and place along it."""
    problem = maneuver.problem
    for plan in maneuver.plans:
        c, target = plan.configuration, plan.target
        x, y, yaw = target.pose
        spin = np.sign(problem.robot.inverse @ [*c.direction, 0.0])
        places = {
            "front-left": (0.376, 0.316),
            "front-right": (0.376, -0.316),
            "rear-left": (-0.376, 0.316),
            "rear-right": (-0.376, -0.316),
        }
        met = []
        for name, travel in zip(c.critical, target.travel, strict=True):
            i = WHEELS.index(name)
            assert travel > 0
            dx, dy = c.direction
            px = x + travel * (math.cos(yaw) * dx - math.sin(yaw) * dy)
            py = y + travel * (math.sin(yaw) * dx + math.cos(yaw) * dy)
            wx, wy = places[name]
            along = math.cos(yaw) * wx - math.sin(yaw) * wy
            reach = collision_reach(
                wheel_of(problem), c.window.middle, c.motion, c.alpha, step_of(problem).height
            )
            assert px + along + reach == pytest.approx(step_of(problem).place[0], abs=1e-9)
            met.append(py + math.sin(yaw) * wx + math.cos(yaw) * wy)
            phase = spin[i] * target.wheels[i] + travel / 0.098
            beyond = (phase - c.window.middle) / math.pi
            assert beyond == pytest.approx(round(beyond), abs=1e-9)
            outer_faces_step = name.endswith("left") == c.faces_left
            assert round(beyond) % 2 == (0 if outer_faces_step else 1)
        place = np.mean(met) if c.motion.lateral else met[0]
        assert place == pytest.approx(step_of(problem).place[1], abs=1e-9)


def test_turns_stay_within_a_quarter() -> None:
    problem = load_problem(PROBLEMS / FILES[0])
    for start in (-1.0, 0.0, 0.7):
        found = configurations(wheel_of(problem), step_of(problem), start)
        assert found
        assert all(abs(c.yaw - start) <= math.pi / 2 + 1e-9 for c in found)
    assert {c.motion for c in configurations(wheel_of(problem), step_of(problem), 1.0)} >= {
        Motion.RIGHT
    }
    assert Motion.LEFT not in {
        c.motion for c in configurations(wheel_of(problem), step_of(problem), 1.0)
    }


def test_a_step_turned_in_the_world_turns_the_plans() -> None:
    straight = load_problem(PROBLEMS / FILES[0])
    turned = straight.replace(
        {
            "obstacles.step.direction": math.pi / 2,
            "obstacles.step.place": [-0.76, 2.856],
            "space.x": [-1.5, 1.5],
            "space.y": [-0.6, 2.856],
            "start.pose": [0.0, 0.0, math.pi / 2],
        }
    )
    for a, b in zip(
        configurations_of(straight),
        configurations(wheel_of(turned), step_of(turned), math.pi / 2),
        strict=True,
    ):
        first, second = approach_target(straight, a), approach_target(turned, b)
        assert second.pose == pytest.approx(
            (-first.pose[1], first.pose[0], first.pose[2] + math.pi / 2), abs=1e-12
        )
        assert second.wheels == pytest.approx(first.wheels, abs=1e-12)
    a, b = plan_climb(straight), plan_climb(turned)
    # The default P1 of Table 5.4 favours an axis, so paths differ a little.
    assert [p.duration for p in b.plans] == pytest.approx([p.duration for p in a.plans], rel=0.1)


def left_plan(problem: Problem) -> ClearObjective:
    configuration = configurations_of(problem)[0]
    plan = plan_configuration(problem, configuration)
    assert isinstance(plan, Plan)
    return ClearObjective(TerminalObjective(plan.problem, problem.robot), free_ground(problem))


def test_violation_is_the_depth_of_the_footprint_outside() -> None:
    ground = FreeGround(
        (-1.0, 1.0),
        (-1.0, 1.0),
        (1.0, 0.0),
        0.8,
        ((0.5, 0.2), (-0.5, 0.2), (-0.5, -0.2), (0.5, -0.2)),
    )
    assert ground.margin(np.array(0.0), np.array(0.0), np.array(0.0)) == pytest.approx(0.3)
    assert ground.margin(np.array(0.4), np.array(0.0), np.array(0.0)) == pytest.approx(-0.1)
    assert ground.margin(np.array(0.0), np.array(0.9), np.array(math.pi / 2)) == pytest.approx(-0.4)
    assert "the step by 0.1" in ground.complaint(0.4, 0.0, 0.0)
    assert "y to" in ground.complaint(0.0, 0.9, 0.0)
    assert ground.complaint(0.0, 0.0, 0.0) == ""


@pytest.mark.parametrize("optimizer", ["lattice", "pso", "ipopt"])
def test_optimizers_see_the_violation(optimizer: str) -> None:
    """In a narrow space the terminal cost alone leaves it; with the violation every optimizer stays
    inside."""
    problem = load_problem(PROBLEMS / FILES[1])
    objective = left_plan(problem)
    found = minimize(objective, objective.bounds, optimizer=optimizer, seed=1)
    assert found.violation <= 1e-9, found.message
    assert path_margin(objective.path(found.x), objective.ground) >= 0
    assert found.fun < (1e-6 if optimizer in ("lattice", "ipopt") else 0.2)
    rng = np.random.default_rng(5)
    low, high = objective.bounds.T
    violations = objective.evaluate(low + rng.random((200, 4)) * (high - low)).violation
    assert (violations > 0.01).mean() > 0.2  # the constraint is not idle


def test_other_optimizers_plan_too() -> None:
    problem = load_problem(PROBLEMS / FILES[1])
    configuration = configurations_of(problem)[0]
    plan = plan_configuration(problem, configuration, optimizer="pso", seed=3)
    assert isinstance(plan, Plan)
    assert plan.wheel_error < 0.1
    assert plan.room >= 0


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"obstacles.step.height": 0.06}, "at most Rc - Re = 5.10 cm"),
        ({"obstacles.step.height": 0.0}, "obstacles[0].step.height"),
        ({"start.pose": [2.6, 0.0, 0.0]}, "before the step"),
        ({"start.pose": [0.0, 1.4, 0.0]}, "inside the space"),
        ({"ground.friction": 0.0}, "ground.friction"),
        ({"obstacles.step.heigth": 0.05}, "nearest is 'height'"),
        ({"obstacles.step.width": 4.0}, "across the whole space"),
        ({"obstacles.step.name": "kerb"}, "of kind step: kerb"),
        ({"climb.alphas": [1.2]}, "for this step"),
        ({"robot.wheels.all.double.minor_radius": 0.2}, "robot.wheels[0].double.minor_radius"),
        ({"robot.wheels.front-left.double.gap": 0.02}, "of equal sizes"),
        ({"robot.name": "loc8"}, "four double wheels"),
    ],
)
def test_one_clear_message_each(changes: dict[str, object], text: str) -> None:
    problem = load_problem(PROBLEMS / FILES[0])
    with pytest.raises((ProblemError, ArgumentError)) as caught:
        plan_climb(problem.replace(changes))
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_space_too_small_is_said_so() -> None:
    problem = load_problem(PROBLEMS / FILES[0]).replace({"space.y": [-0.5, 0.5]})
    found = plan_climb(problem)
    assert not found.plans
    assert "the space is too small" in found.status


def test_without_a_turn_wheel_angles_cannot_be_chosen() -> None:
    problem = load_problem(PROBLEMS / FILES[0])
    problem = problem.replace({"start.pose": [0.2, 0.0, math.radians(-35)]})
    square_on = [c for c in configurations_of(problem) if c.name == "forward -35 deg"]
    refused = plan_configuration(problem, square_on[0])
    assert isinstance(refused, Refused)
    assert "turn" in refused.reason


def test_chosen_angles_are_tried_either_way() -> None:
    problem = load_problem(PROBLEMS / FILES[0], {"climb.alphas": [math.radians(40.0)]})
    names = {c.name for c in configurations_of(problem)}
    assert names == {"lateral left", "lateral right", "forward +40 deg", "forward -40 deg"}


def test_solve_returns_the_best_plan_and_the_others_beside_it(maneuver: Maneuver) -> None:
    solution = solve(maneuver.problem)
    every = (solution, *solution.alternatives)
    assert [s.duration for s in every] == pytest.approx([p.duration for p in maneuver.plans])
    for found, plan in zip(every, maneuver.plans, strict=True):
        assert found.holds, found.faults
        assert found.problem.robot.name == "loc8-smdw"
        assert found.problem.scene.obstacles == maneuver.problem.scene.obstacles
        assert found.problem.critical == plan.configuration.critical
    none = solve(maneuver.problem.replace({"space.y": [-0.5, 0.5]}))
    assert none.trajectory is None
    assert any("the space is too small" in fault for fault in none.faults)
