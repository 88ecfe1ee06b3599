"""The terminal cost against the thesis's tables, and the prediction against itself and an ODE
solver."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from smdw_problems import ROOT, smdw_problem

from benchmarks.theses.smdw_study import terminal_cost
from trajopt.arrays import fold
from trajopt.errors import ArgumentError
from trajopt.objectives.rollout import Kinematics
from trajopt.objectives.terminal import TerminalObjective, terminal_objective, with_free
from trajopt.optimize.lattice import lattice_points
from trajopt.robots.robot import robot as shipped
from trajopt.systems.smdw.thesis import through_drives

DATA = ROOT / "tests/data/smdw"
PRINT_ROUNDING = 0.0015


def rows(name):
    lines = [line for line in (DATA / name).read_text().splitlines() if not line.startswith("#")]
    return [dict(row) for row in csv.DictReader(lines)]


@pytest.mark.parametrize("table", ["table_5_5_time_interval.csv", "table_5_6_repeat_1s.csv"])
def test_recomputes_tables_5_5_and_5_6(table):
    found = rows(table)
    assert len(found) in (14, 10)
    for row in found:
        pose = np.array([float(row[k]) for k in ("dx_m", "dy_m", "dpsi_rad")])
        wheels = np.array([float(row[f"dtheta{i}_rad"]) for i in (1, 2, 3, 4)])
        cost = terminal_cost(pose, wheels, np.array([3, 0.125, 2.5]), np.array([0, 12.5, 0, 12.5]))
        assert cost == pytest.approx(float(row["cost"]), abs=PRINT_ROUNDING)


def test_recomputes_figures_5_15_to_5_22():
    for row in rows("figures_5_15_to_5_22.csv"):
        pose = np.array([2, 0.75, 1.5708]) - [float(row[k]) for k in ("xf_m", "yf_m", "psif_rad")]
        wheels = np.array([float(row[f"theta{i}_rad"]) for i in (1, 2, 3, 4)])
        first = row["implementation"] == "first"
        gains = ([1, 0.125, 1], [10] * 4) if first else ([3, 0.125, 2.5], [0, 12.5, 0, 12.5])
        cost = terminal_cost(pose, wheels, *map(np.array, gains))
        assert cost == pytest.approx(float(row["cost"]), abs=PRINT_ROUNDING)


@given(st.floats(-50, 50), st.sampled_from([np.pi, 2 * np.pi]))
def test_folding_is_the_circular_distance(angle, period):
    brute = min(abs(angle - period * k) for k in range(-20, 21))
    assert abs(fold(angle, period)) == pytest.approx(brute, abs=1e-12)


def with_actuator(problem, *free):
    return with_free(through_drives(problem), *(free or ("p2",)))


@pytest.mark.parametrize("steps", [48, 252, 2001])
def test_without_limits_the_prediction_is_exact_on_any_grid(problem, steps):
    objective = replace(terminal_objective(with_free(problem, "p1", "p2", "heading")), steps=steps)
    rng = np.random.default_rng(1)
    for x in rng.uniform(*objective.bounds.T, (5, objective.dimension)):
        exact = objective.predict_exactly(x)
        ours = objective.predict(x[:, None])
        tolerance = 1e-10 if steps > 48 else 1e-6
        np.testing.assert_allclose(np.ravel(ours.wheels), np.ravel(exact.wheels), atol=tolerance)


def test_exact_prediction_against_an_ode_solver():
    """The wheels' and body's motion through the actuator, integrated by scipy with events
    ignored."""
    problem = with_actuator(smdw_problem("scenario_1_lateral"), "p1", "p2", "heading")
    objective = terminal_objective(problem)
    x = objective.default
    points = objective.control_points(x[:, None])
    basis, speed = objective.basis, 3 / problem.actuator.duration

    def rates(t, state):
        u = np.array([1 + speed * t])
        value, rate = basis.matrix(u)[0], basis.matrix(u, 1)[0] * speed
        angle = value @ points.yaw[:, 0]
        dx, dy, da = rate @ points.x[:, 0], rate @ points.y[:, 0], rate @ points.yaw[:, 0]
        twist = [
            np.cos(angle) * dx + np.sin(angle) * dy,
            np.cos(angle) * dy - np.sin(angle) * dx,
            da,
        ]
        wheels = np.asarray(objective.actuator.output(objective.model.inverse @ twist))
        vx, vy, wz = objective.model.forward @ wheels
        c, s = np.cos(state[2]), np.sin(state[2])
        return [c * vx - s * vy, s * vx + c * vy, wz, *wheels]

    start = [*problem.search.start, 0, 0, 0, 0]
    end = solve_ivp(
        rates, (0, problem.actuator.duration), start, rtol=1e-8, atol=1e-9, max_step=2e-3
    ).y[:, -1]
    final = objective.predict_exactly(x)
    got = np.ravel([final.x, final.y, final.yaw, *final.wheels])
    np.testing.assert_allclose(got, end, atol=5e-4)


def test_step_averages_converge_to_the_exact_prediction(scenario):
    objective = terminal_objective(with_actuator(scenario, "p1", "p2", "heading"))
    exact = objective.score(objective.default).cost[0]
    errors = [
        abs(replace(objective, steps=n).evaluate(objective.default[None]).cost[0] - exact)
        for n in (252, 2001, 20001)
    ]
    assert errors[2] < errors[0] / 20
    assert errors[1] < 1e-3


def test_numba_and_numpy_agree():
    pytest.importorskip("numba")
    rng = np.random.default_rng(3)
    for name in ("table_5_3", "table_5_3_1s", "scenario_2_lateral"):
        objective = terminal_objective(
            with_actuator(smdw_problem(name), "p1", "p2", "heading", "duration")
        )
        z = rng.uniform(*objective.bounds.T, (40, objective.dimension)).T
        assert objective._compiled is not None
        assert objective._compiled[0].fits(z.T)
        a, b = objective.predict_readable(z), objective.predict(z)
        assert a.x is not b.x
        for name in ("x", "y", "yaw", "wheels"):
            np.testing.assert_allclose(getattr(b, name), getattr(a, name), atol=1e-12)


def test_turns_too_large_for_the_kernel_are_predicted_readably(scenario):
    objective = terminal_objective(with_actuator(scenario, "p1", "p2", "heading"))
    z = np.tile(objective.default[:, None], 2)
    z[objective.names.index("p1.yaw_rad"), 1] += 100.0
    one, both = objective.predict(z[:, :1]), objective.predict(z)
    for name in ("x", "y", "yaw", "wheels"):
        np.testing.assert_allclose(
            getattr(both, name), getattr(objective.predict_readable(z), name)
        )
        np.testing.assert_allclose(
            np.asarray(getattr(both, name))[..., 0],
            np.asarray(getattr(one, name))[..., 0],
            atol=1e-11,
        )


def test_a_swarm_is_its_candidates(problem):
    objective = terminal_objective(with_actuator(problem, "p1", "p2", "heading", "duration"))
    x = np.random.default_rng(0).uniform(*objective.bounds.T, (7, objective.dimension))
    together = objective.evaluate(x).cost
    np.testing.assert_allclose(
        together, [objective.evaluate(row[None]).cost[0] for row in x], atol=1e-10
    )


def test_wheel_identities_hold_along_every_path(problem):
    objective = terminal_objective(with_free(problem, "p1", "p2", "heading"))
    x = np.random.default_rng(5).uniform(*objective.bounds.T)
    t1, t2, t3, t4 = np.ravel(objective.predict_exactly(x).wheels)
    assert t1 + t2 == pytest.approx(t3 + t4, abs=1e-9)
    turn = problem.search.goal[2] - problem.search.start[2]
    assert -t1 + t2 - t3 + t4 == pytest.approx(4 * 0.692 / 0.098 * turn, abs=1e-9)


def test_affine_matrix_is_well_conditioned_and_right(problem):
    objective = terminal_objective(problem)
    matrix, offset = objective.affine()
    assert np.linalg.cond(matrix) == pytest.approx(1.0, abs=1e-9)
    x = np.random.default_rng(2).uniform(*objective.bounds.T)
    errors = np.ravel(objective.wheel_errors(objective.predict_exactly(x)))
    np.testing.assert_allclose(matrix @ x + offset, errors, atol=1e-10)


def test_lattice_is_exact_in_the_theses_convention_too(problem):
    """The thesis's kinematics (y right, yaw counter-clockwise) is ours with the y column
    negated."""
    mirrored = shipped("loc8").inverse * [1, -1, 1]
    thesis = TerminalObjective(
        problem, shipped("loc8"), kinematics=Kinematics(mirrored, np.linalg.pinv(mirrored))
    )
    points, _ = lattice_points(thesis.affine_part(), thesis.bounds)
    assert 1 <= len(points) <= 15
    assert max(thesis.score(x).cost[0] for x in points) < 1e-9


def test_terms_sum_to_the_score(problem):
    objective = terminal_objective(with_actuator(problem))
    x = objective.default
    assert sum(objective.terms(x).values()) == pytest.approx(objective.score(x).cost[0], abs=1e-12)


def test_affine_needs_ideal_actuators(scenario):
    with pytest.raises(ArgumentError, match="no actuator"):
        terminal_objective(with_actuator(scenario)).affine()


def test_steps_must_fit_the_segments(scenario):
    with pytest.raises(ArgumentError, match="multiple of the 3"):
        replace(terminal_objective(scenario), steps=250).evaluate(np.zeros((1, 2)))


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10_000))
def test_wheel_period_pi_never_costs_more(seed):
    base = smdw_problem("table_5_3")
    half = terminal_objective(base.replace(objective={"wheel_period": "pi"}))
    full = terminal_objective(base)
    x = np.random.default_rng(seed).uniform(*full.bounds.T)
    assert half.score(x).cost[0] <= full.score(x).cost[0] + 1e-9
