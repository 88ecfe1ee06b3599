"""What lattice and ipopt promise on the thesis's problems."""

from __future__ import annotations

import numpy as np
import pytest
from smdw_problems import SMDW, smdw_problem

from trajopt.arrays import fold
from trajopt.objectives.terminal import terminal_objective, with_free
from trajopt.optimize.base import Budget, Status
from trajopt.optimize.ipopt import Ipopt
from trajopt.optimize.lattice import Lattice, lattice_points
from trajopt.optimize.pso import thesis_enhanced, thesis_first
from trajopt.optimize.search import minimize
from trajopt.systems.smdw.entry import WHEELS
from trajopt.systems.smdw.thesis import through_drives

SOLVABLE = [name for name in SMDW if name != "table_5_3_1s"]


def through_actuators(name):
    problem = through_drives(smdw_problem(name))
    return terminal_objective(with_free(problem, "p1", "p2", "heading"))


@pytest.mark.parametrize("free", [("p2",), ("p1", "p2"), ("p1",)])
def test_lattice_is_exact_without_actuators(problem, free):
    objective = terminal_objective(with_free(problem, *free))
    result = minimize(objective, objective.bounds, optimizer="lattice")
    if result.status is Status.NO_EXACT:
        assert free == ("p1",)
        assert "no lattice point" in result.message
    else:
        assert result.fun <= 1e-9
        assert result.success


@pytest.mark.parametrize("name", SOLVABLE)
def test_lattice_is_exact_through_actuators(name):
    objective = through_actuators(name)
    result = minimize(objective, objective.bounds, optimizer="lattice")
    assert result.fun <= 1e-7
    assert result.success


@pytest.mark.parametrize("name", ["scenario_1_lateral", "scenario_2_forward35"])
def test_ipopt_is_exact_through_actuators(name):
    objective = through_actuators(name)
    result = minimize(objective, objective.bounds, optimizer="lattice+ipopt+newton")
    assert result.fun <= 1e-7


def test_ipopt_from_random_starts_without_the_lattice(problem):
    objective = terminal_objective(problem)
    result = minimize(objective, objective.bounds, optimizer=Ipopt(polish=True), seed=3)
    assert result.fun <= 1e-6


def test_lattice_finds_every_solution_that_brute_force_finds(problem):
    """Root finding from a fine grid of starts, deduplicated, gives the same points."""
    objective = terminal_objective(problem)
    part = objective.affine_part()
    points, _ = lattice_points(part, objective.bounds)
    inverse = np.linalg.inv(part.matrix)
    found = set()
    for x in np.stack(
        np.meshgrid(*[np.linspace(a, b, 80) for a, b in objective.bounds]), -1
    ).reshape(-1, 2):
        turns = np.round((part.matrix @ x + part.offset) / part.period)
        z = inverse @ (part.period * turns - part.offset)
        if np.all((z >= objective.bounds[:, 0]) & (z <= objective.bounds[:, 1])):
            found.add(tuple(np.round(z, 9)))
    assert found == {tuple(np.round(z, 9)) for z in points}


def test_without_lattice_points_the_best_of_the_box_is_found(scenario):
    """A small space holds no lattice point; the arrangement's best vertex beats a fine grid."""
    small = scenario.replace(space={"x": [0.0, 2.3], "y": [-0.01, 0.8]}).replace(
        {"spline.free": ["p2"]}
    )
    objective = terminal_objective(small)
    box = np.array([[1.0, 1.2], [0.1, 0.2]])
    result = minimize(objective, box, optimizer=Lattice())
    assert result.status is Status.NO_EXACT
    assert "no lattice point lies inside" in result.message
    grid = np.stack(np.meshgrid(*[np.linspace(a, b, 200) for a, b in box]), -1).reshape(-1, 2)
    assert result.fun <= objective.evaluate(grid).cost.min() + 1e-9


def wheel_signs(objective, x):
    """Signs of the critical wheels' errors at x, nearest whole turns taken off."""
    part = objective.affine_part()
    return tuple(np.sign(fold(part.matrix @ x + part.offset, part.period)).astype(int))


@pytest.mark.parametrize("signs", [(1, 1), (1, -1), (-1, 1), (-1, -1)])
def test_ipopt_alone_takes_errors_of_either_sign_as_costs(scenario, signs):
    """In a box with no exact point, where the wheels' errors have the given signs, the program's
    answer is as good as a fine grid's: |r| is bounded from both sides."""
    objective = terminal_objective(scenario)
    rng = np.random.default_rng(5)
    for centre in rng.uniform(*objective.bounds.T, (1000, 2)):
        box = centre[:, None] + 0.02 * np.array([-1.0, 1.0])
        corners = np.stack(np.meshgrid(*box), -1).reshape(-1, 2)
        if {wheel_signs(objective, x) for x in corners} == {signs}:
            break
    else:
        raise AssertionError("no such box")
    alone = Ipopt(starts=1, lattice_starts=0, polish=False)
    result = minimize(objective, box, optimizer=alone, x0=centre)
    grid = np.stack(np.meshgrid(*[np.linspace(a, b, 201) for a, b in box]), -1).reshape(-1, 2)
    assert result.fun == pytest.approx(objective.evaluate(grid).cost.min(), abs=1e-6)
    assert result.fun > 0.1


@pytest.mark.parametrize("name", ["scenario_1_lateral", "table_5_3"])
def test_the_symbolic_program_is_the_cost(name):
    """Through actuators, at random points: with slacks = |residual| the program is feasible and
    costs what the objective says; with any slack a little smaller it is not."""
    objective, signs = through_actuators(name), []
    for x in np.random.default_rng(1).uniform(*objective.bounds.T, (20, objective.dimension)):
        slacks, turns = objective.slacks_at(x), objective.parameters_at(x)
        signs.append([np.sign(np.squeeze(r)) for r in objective.residuals(x[:, None], turns)])

        def program(slack, x=x, turns=turns):
            found = objective.symbolic(np.concatenate([x, slack])[:, None], turns)
            rows = np.ravel(found.constraints)
            return float(np.squeeze(found.cost)), np.min([rows - found.lower, found.upper - rows])

        cost, room = program(slacks)
        assert cost == pytest.approx(objective.evaluate(x[None]).cost[0], rel=1e-9)
        assert room >= -1e-12
        for i in np.flatnonzero(slacks > 1e-6):
            less = slacks.copy()
            less[i] *= 0.99
            assert program(less)[1] < 0
    assert {1.0, -1.0} <= set(map(float, np.array(signs)[:, -1]))
    assert {1.0, -1.0} <= set(map(float, np.array(signs)[:, 0]))


def test_no_turn_between_start_and_goal_is_explained(scenario):
    from trajopt.errors import ArgumentError

    straight = scenario.replace({"goal.pose": [2.2, 0.76, 0.0]})
    objective = terminal_objective(straight)
    with pytest.raises(ArgumentError, match="change of heading"):
        minimize(objective, objective.bounds, optimizer="lattice")


def test_lattice_points_are_exact_with_a_free_heading(problem):
    """The heading is held at its default: wheel angles are not affine in it."""
    objective = terminal_objective(with_free(problem, "p1", "p2", "heading"))
    part = objective.affine_part()
    points, _ = lattice_points(part, objective.bounds[part.variables])
    candidates = np.tile(part.base, (len(points), 1))
    candidates[:, part.variables] = points
    assert len(points)
    assert max(objective.score(x).cost[0] for x in candidates) < 1e-9


@pytest.mark.parametrize("optimizer", ["lattice", "lattice+ipopt+newton"])
@pytest.mark.parametrize("free", [("heading",), ("p2", "heading")])
def test_without_a_turn_a_free_heading_still_sets_the_wheels(scenario, optimizer, free):
    straight = with_free(scenario.replace({"goal.pose": [2.2, 0.76, 0.0]}), *free)
    objective = terminal_objective(straight)
    assert minimize(objective, objective.bounds, optimizer=optimizer).fun <= 1e-9


def test_a_huge_space_is_no_trouble(scenario):
    huge = terminal_objective(scenario.replace(space={"x": [-1e5, 1e5], "y": [-1e5, 1e5]}))
    result = minimize(huge, huge.bounds, optimizer="lattice", budget=Budget(evaluations=500))
    assert result.fun <= 1e-6  # positions of 100 km have 1e-11 m of rounding
    assert result.nfev <= 500


@pytest.mark.parametrize("evaluations", [1, 40])
def test_lattice_keeps_a_small_budget(evaluations):
    objective = through_actuators("scenario_1_lateral")
    result = minimize(
        objective, objective.bounds, optimizer="lattice", budget=Budget(evaluations=evaluations)
    )
    assert result.nfev <= evaluations
    assert np.isfinite(result.fun)


def test_all_four_wheels_cannot_be_had(scenario):
    # problem files refuse more than two critical wheels; the optimizer must find out by itself
    every = scenario.model_copy(
        update={"goal": scenario.goal.model_copy(update={"critical": WHEELS})}
    )
    del every.__dict__["search"]  # made when the file was checked
    objective = terminal_objective(every)
    result = minimize(objective, objective.bounds, optimizer="lattice")
    assert result.status is Status.NO_EXACT
    assert "over-determine" in result.message


@pytest.mark.parametrize("preset", [thesis_first, thesis_enhanced])
def test_thesis_presets_have_the_printed_parameters(preset):
    swarm = preset()
    assert swarm.particles == 50
    assert swarm.inertia == 1.0
    assert swarm.cognitive == swarm.social == (0.45 if preset is thesis_first else 0.15)


def test_swarm_stays_inside_with_reset_and_reflect(scenario):
    objective = terminal_objective(scenario)
    for name in ("pso", "pso-thesis-enhanced"):
        samples = minimize(
            objective, objective.bounds, optimizer=name, budget=Budget(evaluations=2000)
        ).history.samples
        assert np.all(samples >= objective.bounds[:, 0] - 1e-12)
        assert np.all(samples <= objective.bounds[:, 1] + 1e-12)
