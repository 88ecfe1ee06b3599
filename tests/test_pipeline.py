"""The whole: solve, time, check; and what the package promises about itself."""

from __future__ import annotations

import ast
import importlib
import pkgutil
import subprocess
import sys

import numpy as np
import pytest
from smdw_problems import ROOT, smdw_problem

import trajopt
from trajopt.errors import ArgumentError, MissingDependencyError
from trajopt.optimize.base import Budget
from trajopt.pipeline import solve, validate
from trajopt.systems.smdw.thesis import through_drives
from trajopt.timing.scaling import time_scale


def test_every_problem_holds(problem):
    solution = solve(problem)
    assert solution.holds, solution.faults
    assert solution.cost <= 1e-9
    assert min(solution.margins.values()) >= -1e-9
    assert np.abs(solution.deviation).max() < 1e-9
    assert np.abs(solution.wheel_deviation[list(problem.critical_indices)]).max() < 1e-6


def test_time_scaling_keeps_wheel_angles(problem):
    """Integrated wheel speeds at the end equal the planned angles (1e-6 rad), by an independent
    quadrature."""
    trajectory = solve(problem).trajectory
    times = np.linspace(0, trajectory.duration, 40_001)
    speeds = trajectory.at(times).wheel_speeds
    integrated = np.trapezoid(speeds, times, axis=0)
    np.testing.assert_allclose(
        integrated, trajectory.at(trajectory.duration).wheel_angles[0], atol=1e-6
    )


def test_time_scaling_is_never_slower_than_linear(problem):
    path, limits = solve(problem).path, problem.limits
    robot = solve(problem).trajectory.robot
    linear = time_scale(path, limits, robot=robot, engine="linear")
    optimal = time_scale(
        path, limits, robot=robot, start_speed=float(linear.sd[0]), end_speed=float(linear.sd[-1])
    )
    assert optimal.duration <= linear.duration * (1 + 1e-9)


def test_through_actuators_the_motion_is_nominal(scenario):
    problem = through_drives(
        scenario, {"spline.free": ["p1", "p2", "heading"], "limits": {"wheel_speed": 100.0}}
    )
    solution = solve(problem)
    assert solution.trajectory.engine == "nominal"
    assert solution.duration == pytest.approx(problem.actuator.duration, rel=1e-9)
    assert solution.cost < 1e-7
    assert solution.holds, solution.faults


def test_duration_objective_takes_the_fastest_exact_solution():
    problem = smdw_problem("scenario_1_lateral")
    fastest = solve(problem.replace(objective={"kind": "duration"}))
    any_exact = solve(problem)
    assert fastest.holds, fastest.faults
    assert fastest.duration <= any_exact.duration + 1e-9
    assert fastest.cost == pytest.approx(fastest.duration, rel=1e-6)


def test_infeasible_limits_are_reported_not_raised(scenario):
    solution = solve(scenario, optimizer="pso", budget=Budget(evaluations=50))
    assert not solution.holds
    assert any("wheel" in fault for fault in solution.faults)


@pytest.mark.parametrize("bad", [None, "problem.toml", {}])
def test_solve_rejects_what_is_no_problem(bad):
    with pytest.raises(ArgumentError, match="load_problem"):
        solve(bad)


def test_validate_rejects_unknown_engines(scenario):
    with pytest.raises(ArgumentError, match="engine"):
        validate(solve(scenario).trajectory, scenario, engine="bullet")


def test_physics_of_a_scenario(scenario):
    pytest.importorskip("pybullet")
    report = validate(solve(scenario).trajectory, scenario)
    assert report.final_distance < 0.02 * report.length + 0.01
    assert np.abs(report.wheel_deviation).max() < 0.05
    assert report.path_max < 0.05


def test_feedback_in_the_check_brings_pose_and_critical_wheels_to_the_goal(scenario):
    pytest.importorskip("mujoco")
    trajectory = solve(scenario).trajectory
    report = validate(trajectory, scenario, engine="mujoco", control="pose and phase", seed=1)
    assert report.final_distance < 0.01
    assert abs(report.yaw) < np.radians(1.0)
    assert np.abs(report.wheel_deviation[list(scenario.critical_indices)]).max() < 0.1
    other = validate(trajectory, scenario, engine="mujoco", control="pose and phase", seed=2)
    assert other.final_distance != report.final_distance


@pytest.mark.parametrize("control", [None, "wheel servo", "pose and phase"])
def test_the_check_starts_with_the_wheel_angles_that_the_plan_starts_with(scenario, control):
    """Physics begins at the problem's wheel angles, so that the critical wheels end at the goal's
    (modulo a turn), measured on the wheels themselves."""
    pytest.importorskip("mujoco")
    start = np.array([0.9, -1.4, 2.1, 0.5])
    problem = scenario.replace({"start.wheels": start.tolist()})
    trajectory = solve(problem).trajectory
    report = validate(trajectory, problem, engine="mujoco", control=control)
    angles, critical = report.recording.wheel_angles, list(problem.critical_indices)
    np.testing.assert_allclose(angles[0], start, atol=0.02)
    missed = (angles[-1] - np.asarray(problem.goal.wheels))[critical] / (2 * np.pi)
    assert np.abs(missed - np.round(missed)).max() * 2 * np.pi < 0.1
    assert np.abs(report.wheel_deviation[critical]).max() < 0.1
    planned = trajectory.at(trajectory.duration).wheel_angles[0]
    np.testing.assert_allclose(report.wheel_deviation, angles[-1] - planned, atol=0.01)


def test_a_seed_below_zero_is_refused(scenario):
    with pytest.raises(ArgumentError, match="seed"):
        validate(solve(scenario).trajectory, scenario, engine="mujoco", control="pose", seed=-1)


def test_missing_engine_is_named(scenario, monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(MissingDependencyError, match=r"trajopt\[simulate\]"):
        validate(solve(scenario).trajectory, scenario, engine="pybullet")


def test_import_is_light_and_lazy():
    code = (
        "import sys, time; t = time.perf_counter(); import trajopt; d = time.perf_counter() - t;"
        "heavy = {'casadi', 'pybullet', 'matplotlib', 'toppra', 'mujoco', 'numba', 'pandas'} & set(sys.modules);"
        "assert not heavy, heavy; assert d < 0.3, d"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_public_names_survive_importing_every_module():
    """A lazy function must not be shadowed by a submodule of its name."""
    for module in pkgutil.walk_packages(trajopt.__path__, "trajopt."):
        if module.name not in ("trajopt.__main__",):
            importlib.import_module(module.name)
    problem = trajopt.load_problem(ROOT / "problems/smdw/scenario_2_forward35.toml")
    for _ in range(2):
        assert trajopt.load_problem(ROOT / "problems/smdw/scenario_2_forward35.toml") == problem
        solution = trajopt.solve(problem)
        assert (
            trajopt.minimize(lambda x: x[0] ** 2, [[-1, 1]], budget=trajopt.Budget(100)).fun < 0.1
        )
        limits, robot = problem.limits, solution.trajectory.robot
        assert trajopt.time_scale(solution.path, limits, robot=robot).duration > 0
    for name in trajopt.__all__:
        assert getattr(trajopt, name) is not None
    with pytest.raises(AttributeError):
        _ = trajopt.nothing_like_this


def test_only_the_scipy_optimizers_import_scipy_optimize():
    allowed = {ROOT / f"trajopt/optimize/{name}.py" for name in ("scipy", "scipy_global")}
    for file in (ROOT / "trajopt").rglob("*.py"):
        if file in allowed or file.name == "least_squares.py":
            continue
        for node in ast.walk(ast.parse(file.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                names = [f"{node.module}.{a.name}" for a in node.names]
            assert not any(n.startswith("scipy.optimize") for n in names), file
