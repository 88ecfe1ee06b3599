"""Solutions that the report tests share: solved once."""

from __future__ import annotations

import numpy as np
import pytest
from smdw_problems import smdw_problem

import trajopt
from tests.recordings import made_up
from trajopt.problem import Problem
from trajopt.simulate.check import ValidationReport
from trajopt.simulate.engine import Hit
from trajopt.simulate.plan import wheel_plan
from trajopt.solution import Solution
from trajopt.systems.smdw.thesis import through_drives


def problem_file(name: str) -> Problem:
    return smdw_problem(name)


@pytest.fixture(scope="session")
def exact() -> Solution:
    """Scenario 1 lateral by the lattice: holds, time-scaled."""
    return trajopt.solve(problem_file("scenario_1_lateral"))


@pytest.fixture(scope="session")
def through_actuators() -> Solution:
    """A short swarm search through the actuators: nominal timing, limits broken, misses the
    goal."""
    problem = through_drives(
        problem_file("scenario_2_forward45"), {"spline.free": ["p1", "p2", "heading"]}
    )
    return trajopt.solve(problem, optimizer="pso", seed=3, budget=trajopt.Budget(evaluations=500))


@pytest.fixture(scope="session")
def violated() -> Solution:
    """Duration as the cost, too few evaluations to meet the wheel angles: infeasible with a
    trajectory."""
    problem = problem_file("scenario_1_forward45").replace({"objective.kind": "duration"})
    return trajopt.solve(problem, optimizer="pso", seed=0, budget=trajopt.Budget(evaluations=60))


@pytest.fixture(scope="session")
def without_motion(exact: Solution) -> Solution:
    """The lateral path with limits that no motion keeps: there is no trajectory."""
    from dataclasses import replace

    error = trajopt.InfeasibleError("tip", 0.25, "rest already breaks it")
    return replace(exact, trajectory=None, infeasible=error)


@pytest.fixture(scope="session")
def drifted(exact: Solution) -> ValidationReport:
    """A made-up simulation that drifts from the plan by 1 mm a second along x and lags 2 mrad in
    wheel angle."""
    trajectory = exact.trajectory
    assert trajectory is not None
    times = np.linspace(0.0, trajectory.duration + 0.2, 300)
    plan = trajectory.at(np.minimum(times, trajectory.duration))
    pose = plan.pose + np.outer(times, [1e-3, 0.0, 0.0])
    picture = np.random.default_rng(0).integers(0, 255, (24, 32, 3), dtype=np.uint8)
    recording = made_up(
        times,
        pose=pose,
        wheel_angles=plan.wheel_angles - 2e-3,
        wheel_speeds=plan.wheel_speeds,
        picture=picture,
    )
    return ValidationReport(
        "made-up",
        2e-3,
        -1e-3,
        5e-4,
        np.full(4, -2e-3),
        1e-3,
        4e-3,
        3.0,
        (Hit("door", 1.5, (2.0, 0.25), 3),),
        trajectory.robot.wheel_names,
        np.array([0.01, 0.02, 0.03, 0.04]),
        3.5,
        plan.pose,
        recording,
        wheel_plan(trajectory, times),
        plan.steering_angles,
    )
