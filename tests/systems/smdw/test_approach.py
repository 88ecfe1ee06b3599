"""The controller without physics: odometry, filter, and re-solved paths against their
definitions."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from trajopt.control.approach import Estimate, approach_controller, correct, predict
from trajopt.control.bend import ROOM, ROOM_WEIGHT, Goal, reference_of, resolved, wheel_path
from trajopt.control.measured import Measured
from trajopt.errors import ArgumentError
from trajopt.paths.path import Path as RobotPath
from trajopt.problem import load_problem
from trajopt.systems.smdw.climbing import loc8_smdw
from trajopt.systems.smdw.configurations import configurations_of
from trajopt.systems.smdw.entry import WHEELS, free_ground
from trajopt.systems.smdw.planner import Plan, plan_configuration
from trajopt.timing.scaling import time_scale

FILE = Path(__file__).parents[3] / "problems" / "smdw" / "step_5cm.toml"
ROBOT = loc8_smdw()


@pytest.fixture(scope="module")
def plan() -> Plan:
    problem = load_problem(FILE)
    found = plan_configuration(problem, configurations_of(problem)[0])
    assert isinstance(found, Plan)
    return found


def told(k: int, pose: np.ndarray, wheels: np.ndarray) -> Measured:
    """Exact measurements; the pose at every fifth control period."""
    none = np.zeros(3)
    return Measured(wheels, 0.0 * wheels, none[:0], pose.copy() if k % 5 == 0 else None, none)


def critical(plan: Plan) -> tuple[int, ...]:
    return tuple(WHEELS.index(w) for w in plan.configuration.critical)


def test_odometry_follows_the_plan(plan: Plan) -> None:
    reference = reference_of(plan.trajectory, np.zeros(4))
    estimate = Estimate(reference.pose[0], np.zeros((3, 3)))
    for before, after in zip(reference.wheels[:-1], reference.wheels[1:], strict=True):
        estimate = predict(estimate, ROBOT, ROBOT.forward @ (after - before))
    assert estimate.pose == pytest.approx(reference.pose[-1], abs=2e-3)
    assert np.linalg.eigvalsh(estimate.covariance).min() > 0


@pytest.mark.parametrize("turned", [(3.0, 3.0, 3.0, 3.0), (-2.0, 2.0, 2.0, -2.0), (4, -1, 2, 1)])
@pytest.mark.parametrize("yaw", [0.4, -2.0])
def test_doubt_of_the_yaw_becomes_doubt_of_the_place_as_poses_differ(
    yaw: float, turned: tuple[float, ...]
) -> None:
    """Odometry from poses that differ as the covariance says: the means spread by d pose / d start
    (difference quotients), so that the covariance grows by exactly what those give."""
    start = np.array([0.3, -0.7, yaw])
    root = np.array([[0.02, 0.0, 0.0], [0.01, 0.03, 0.0], [0.005, -0.01, 0.04]])

    def moved(pose: np.ndarray, covariance: np.ndarray) -> Estimate:
        return predict(
            Estimate(pose, covariance), ROBOT, ROBOT.forward @ np.array(turned, dtype=float)
        )

    slope = np.stack(
        [
            (moved(start + e, np.zeros((3, 3))).pose - moved(start - e, np.zeros((3, 3))).pose)
            / 2e-5
            for e in 1e-5 * np.eye(3)
        ],
        axis=1,
    )
    noise = moved(start, np.zeros((3, 3))).covariance
    expected = slope @ root @ root.T @ slope.T + noise
    assert np.abs(slope - np.eye(3)).max() > 0.05
    np.testing.assert_allclose(moved(start, root @ root.T).covariance, expected, atol=1e-10)


def test_a_place_measured_later_corrects_the_yaw_to_the_right_side() -> None:
    """Two metres ahead with the yaw in doubt: found to the left of where odometry says, the robot
    must have headed more to the left, by the angle at which it is seen from the start."""
    estimate = Estimate(np.zeros(3), np.diag([1e-4, 1e-4, 0.1]) ** 2)
    wheel = 2.0 / 0.098 / 20
    for _ in range(20):
        estimate = predict(estimate, ROBOT, ROBOT.forward @ np.full(4, wheel))
    assert estimate.pose == pytest.approx([2.0, 0.0, 0.0], abs=1e-9)
    doubt = np.array([2.0, 0.1, 0.0])  # yaw as good as unmeasured
    found = correct(estimate, doubt, np.array([0.001, 0.001, 10.0]))
    assert found.pose[2] == pytest.approx(0.05, abs=0.01)


def test_wheel_path_agrees_with_the_exact_wheel_angles(plan: Plan) -> None:
    reference = reference_of(plan.trajectory, np.zeros(4))
    assert wheel_path(ROBOT, reference.pose)[-1] == pytest.approx(reference.wheels[-1], abs=2e-3)


def test_measurements_shrink_the_error() -> None:
    truth = np.array([1.0, 2.0, math.pi - 0.01])
    estimate = Estimate(truth + np.array([0.02, -0.02, 0.05]), np.diag([0.02, 0.02, 0.05]) ** 2)
    rng = np.random.default_rng(1)
    for _ in range(60):
        measured = truth + rng.normal(0, 1, 3) * [0.005, 0.005, 0.009]
        measured[2] = (measured[2] + math.pi) % (
            2 * math.pi
        ) - math.pi  # a sensor's yaw jumps at half a turn
        estimate = correct(estimate, measured, np.array([0.005, 0.005, math.radians(0.5)]))
    assert estimate.pose == pytest.approx(truth, abs=4e-3)
    assert np.sqrt(np.diag(estimate.covariance)).max() < 2e-3


@pytest.mark.parametrize("when", [0.0, 1.0, 2.0])
def test_a_resolved_path_starts_here_and_ends_at_the_goal_with_its_wheel_angles(
    plan: Plan, when: float
) -> None:
    reference = reference_of(plan.trajectory, np.zeros(4))
    goal = Goal(reference.pose[-1], reference.wheels[-1], critical(plan), 30.0)
    _, here = reference.at(when)
    estimate = here + np.array([0.008, -0.006, 0.01])
    wheels = reference.wheels_at(when)[0] + [0.15, -0.1, 0.1, -0.05]
    new = resolved(reference, when, estimate, wheels, goal, ROBOT)
    assert new.pose[0] == pytest.approx(estimate, abs=1e-12)
    assert new.wheels[0] == pytest.approx(wheels, abs=1e-12)
    assert np.abs(new.pose[-1] - goal.pose) == pytest.approx(np.zeros(3), abs=4e-3)
    errors = (new.wheels[-1] - goal.wheels)[list(goal.critical)]
    assert np.abs(errors).max() < 0.03
    pose_only = resolved(reference, when, estimate, wheels, goal, ROBOT, phase=False)
    assert pose_only.pose[-1] == pytest.approx(goal.pose, abs=1e-12)
    assert (
        np.abs((pose_only.wheels[-1] - goal.wheels)[list(goal.critical)]).max()
        > 3 * np.abs(errors).max()
    )


def test_time_is_stretched_below_the_wheel_speed_cap(plan: Plan) -> None:
    reference = reference_of(plan.trajectory, np.zeros(4))
    goal = Goal(reference.pose[-1], reference.wheels[-1], critical(plan), 5.0)
    new = resolved(reference, 1.0, reference.at(1.0)[1], reference.wheels_at(1.0)[0], goal, ROBOT)
    speeds = np.abs(np.diff(new.wheels, axis=0)) / np.diff(new.times)[:, None]
    assert speeds.max() == pytest.approx(5.0, rel=1e-9)
    assert new.times[-1] > reference.times[-1]


def test_kinematic_closed_loop_removes_start_errors(plan: Plan) -> None:
    """A robot that rolls without slip, started off its place: with the controller pose and phase
    meet."""
    control = approach_controller(
        plan.trajectory,
        ROBOT,
        np.zeros(4),
        critical(plan),
        cap=30.0,
    )
    truth, wheels, dt = control.reference.pose[0] + [0.01, -0.01, 0.017], np.zeros(4), 0.01
    for k in range(round((plan.duration + 1.0) / dt)):
        turned = control.step(k * dt, told(k, truth, wheels)).wheel_speeds * dt
        truth = predict(Estimate(truth, np.zeros((3, 3))), ROBOT, ROBOT.forward @ turned).pose
        wheels = wheels + turned
    assert truth == pytest.approx(control.goal.pose, abs=2e-3)
    assert np.abs((wheels - control.goal.wheels)[list(control.goal.critical)]).max() < 0.03


def test_bends_leave_the_present_speed_as_it_is(plan: Plan) -> None:
    """A phase error alone bends the path ahead without a jump of wheel speeds now, which would make
    wheels slip."""
    reference = reference_of(plan.trajectory, np.zeros(4))
    goal = Goal(reference.pose[-1], reference.wheels[-1], critical(plan), 30.0)
    angles, speeds = reference.wheels_at(1.0)
    new = resolved(
        reference, 1.0, reference.at(1.0)[1], angles + np.array([0.2, 0.0, -0.2, 0.0]), goal, ROBOT
    )
    assert np.abs((new.wheels[-1] - goal.wheels)[list(goal.critical)]).max() < 0.02
    assert np.abs(new.wheels_at(1.001)[1] - speeds).max() < 0.05 * np.abs(speeds).max()


def test_a_bent_path_keeps_its_room_where_the_free_bend_would_cross_the_step() -> None:
    """Phase errors that free bends answer with a detour, some of them through the step."""
    problem = load_problem(FILE.with_name("step_3_5cm.toml"))
    found = next(c for c in configurations_of(problem) if c.name == "forward -35 deg")
    plan = plan_configuration(problem, found)
    assert isinstance(plan, Plan)
    reference, ground = reference_of(plan.trajectory, np.zeros(4)), free_ground(problem)
    goal = Goal(reference.pose[-1], reference.wheels[-1], critical(plan), 30.0, ground)
    when = 0.6 * plan.duration
    rooms = []
    for error in np.linspace(-0.5, 0.5, 11):
        wheels = reference.wheels_at(when)[0] + error * np.array([1.0, -1.0, -1.0, 1.0])
        free, kept = (
            resolved(reference, when, reference.at(when)[1], wheels, g, ROBOT)
            for g in (replace(goal, ground=None), goal)
        )
        rooms.append([float(ground.margin(*r.pose.T).min()) for r in (free, kept)])
    crossed, kept_room = np.min(rooms, axis=0)
    assert crossed < 0.0
    assert kept_room > ROOM - 2 * ROOM_WEIGHT


def test_a_doubtful_estimate_chases_phase_less_and_a_path_too_short_for_it_keeps_the_pose(
    plan: Plan,
) -> None:
    reference = reference_of(plan.trajectory, np.zeros(4))
    goal = Goal(reference.pose[-1], reference.wheels[-1], critical(plan), 30.0)
    pose, wheels = (
        reference.at(2.5)[1],
        reference.wheels_at(2.5)[0] + np.array([0.1, 0.0, -0.1, 0.0]),
    )
    sure, unsure = (
        resolved(reference, 2.5, pose, wheels, goal, ROBOT, doubt=d) for d in (0.0, 0.2)
    )
    missed = [
        np.abs((r.wheels[-1] - goal.wheels)[list(goal.critical)]).max() for r in (sure, unsure)
    ]
    assert missed[0] < missed[1]
    late = plan.duration - 0.12
    hopeless = reference.wheels_at(late)[0] + np.array([2.0, 0.0, -2.0, 0.0])
    kept = resolved(reference, late, reference.at(late)[1], hopeless, replace(goal, cap=4.0), ROBOT)
    assert kept.pose[-1] == pytest.approx(goal.pose, abs=1e-9)
    assert kept.times[-1] == pytest.approx(reference.times[-1], abs=1e-9)


def test_an_error_at_rest_is_shared_between_pose_and_phase_on_the_spot(plan: Plan) -> None:
    """4 mm off at the end with the wheels where they belong: pose only removes it, otherwise both
    end within tolerance."""
    left = {}
    for mode in ("pose", "pose and phase"):
        control = approach_controller(
            plan.trajectory,
            ROBOT,
            np.zeros(4),
            critical(plan),
            cap=30.0,
            mode=mode,
        )
        truth, wheels, dt = (
            control.goal.pose + np.array([0.004, 0.0, 0.0]),
            control.goal.wheels.copy(),
            0.01,
        )
        start = round(float(control.reference.times[-1]) / dt)
        control._next_solve = start * dt  # on the way nothing is corrected
        for k in range(start, start + 130):
            turned = control.step(k * dt, told(k, truth, wheels)).wheel_speeds * dt
            truth = predict(Estimate(truth, np.zeros((3, 3))), ROBOT, ROBOT.forward @ turned).pose
            wheels = wheels + turned
        left[mode] = (
            float(np.hypot(*(truth - control.goal.pose)[:2])),
            float(np.abs((wheels - control.goal.wheels)[list(control.goal.critical)]).max()),
        )
    assert left["pose"][0] < 5e-4
    assert left["pose"][1] == pytest.approx(0.004 / 0.098, abs=0.01)
    assert left["pose and phase"][0] < 0.0035
    assert left["pose and phase"][1] < 0.035


def test_too_little_turn_is_refused() -> None:
    path = RobotPath.through([[0, 0], [1, 0], [2, 0]], heading=[0.0, 0.1, 0.2])
    trajectory = time_scale(path, load_problem(FILE).limits, robot=ROBOT)
    with pytest.raises(ArgumentError, match="30 deg of turn"):
        approach_controller(trajectory, ROBOT, np.zeros(4), (0, 2), cap=30.0)
    approach_controller(trajectory, ROBOT, np.zeros(4), (0, 2), cap=30.0, mode="pose")
