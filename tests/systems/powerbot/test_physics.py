"""PowerBot in pybullet: plans within limits hold in contact physics, plans beyond do not."""

from __future__ import annotations

import math
from pathlib import Path as FilePath
from typing import Literal

import numpy as np
import pytest

pytest.importorskip("pybullet")

from trajopt.control.encounter import Visitor, course
from trajopt.control.replan import Sensor, replan
from trajopt.control.tracking import Tracker
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.limit import Limit
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.tip import Tip
from trajopt.paths.path import Path
from trajopt.problem import Problem, load_problem
from trajopt.refine.profile import follow
from trajopt.robots.robot import robot as shipped
from trajopt.systems.powerbot.drive import drive_plan, faster
from trajopt.systems.powerbot.drive_encounter import DrivenEncounter, drive_encounter
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory
from trajopt.world.obstacles import Wall
from trajopt.world.ramp import Ramp, Ramps, lay_over
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

ROOT = FilePath(__file__).resolve().parents[3]
# balancing castors: one point of support behind
BALANCED = {
    "wheels.castor-left.position": [-0.31, 0.0],
    "wheels.castor-right.position": [-0.31, 0.0],
}
ROBOT = shipped("powerbot", BALANCED)
FLOOR = Scene(0.332, Flat())
MOTORS = (Speed(2.1), Acceleration(0.55, 7.8))


@pytest.fixture(scope="module")
def turn() -> Trajectory:
    """A path on which slip binds most of the way."""
    angle = np.linspace(0, 1.2 * math.pi, 8)
    points = np.vstack(
        [[-3, 0], [-1.5, 0], np.column_stack([1.5 * np.sin(angle), 1.5 - 1.5 * np.cos(angle)])]
    )
    return time_scale(Path.through(points), [*MOTORS, Slip(0.332)], robot=ROBOT)


def test_weight_and_straight_motion() -> None:
    plan = time_scale(
        Path.through([[0, 0], [2, 0]]), [Speed(0.5), Acceleration(0.5, 0.5)], robot=ROBOT
    )
    seen = drive_plan(plan, FLOOR)
    assert seen.recording.loads[-1].sum() == pytest.approx(148 * 9.80665, rel=0.01)
    assert seen.recording.loads[-1, :2].sum() / seen.recording.loads[-1].sum() == pytest.approx(
        0.218 / 0.35, rel=0.02
    )
    assert seen.goal_offset < 2e-3
    assert seen.slip_ratio < 0.005


def test_slip_within_and_beyond_the_limit(turn: Trajectory) -> None:
    share = (
        sum(part.end - part.start for part in turn.active if part.limit == "slip")
        / turn.path.length
    )
    assert share >= 0.3
    within = drive_plan(turn, FLOOR)
    beyond = drive_plan(faster(turn, math.sqrt(1.2)), FLOOR)
    assert within.slip_ratio < 0.02
    assert beyond.slip_ratio > 2 * within.slip_ratio


def test_tip_binds_with_grip_and_height() -> None:
    """Friction 1.2 and a high centre of gravity: braking 3 cm inside the tip limit keeps the
    casters down (what is left is the pitch of the compliant contacts), 30 % beyond the limit lifts
    them."""
    tall = shipped("powerbot", {**BALANCED, "body.cog": [-0.132, 0.0, 0.6]})
    limits = [Speed(2.0), Acceleration(0.55, 7.8), Slip(1.2), Tip(reserve=0.03)]
    plan = time_scale(Path.through([[0, 0], [6, 0]]), limits, robot=tall)
    assert any(part.limit == "tip" for part in plan.active)
    within = drive_plan(plan, Scene(1.2, Flat()))
    factor = math.sqrt(1.3 * 0.132 / (0.132 - 0.03))
    beyond = drive_plan(faster(plan, factor), Scene(1.2, Flat()))
    assert np.abs(within.recording.pitch).max() < math.radians(1.0)
    assert np.abs(beyond.recording.pitch).max() > math.radians(5.0)


def test_closed_loop_up_a_ramp() -> None:
    ramp = Ramp((2.0, 0.0), 0.0, 4.266, 0.45, 0.35)
    path = lay_over(
        Path.through([[0, 0], [4, 0.2], [8, 0]], start_direction=[1, 0], end_direction=[1, 0]),
        [ramp],
    )
    plan = time_scale(path, [Speed(1.0), Acceleration(0.55, 7.8), Slip(0.7 * 0.332)], robot=ROBOT)
    seen = drive_plan(plan, Scene(0.332, Ramps((ramp,), grade=0.2)), tracker=Tracker())
    assert np.degrees(-seen.recording.pitch).max() == pytest.approx(6.0, abs=0.5)
    assert seen.goal_offset < 0.02
    assert math.degrees(seen.final_heading_error) < 1.0
    assert seen.slip_ratio < 0.02


def test_closed_loop_through_a_door() -> None:
    """A door 0.9 m wide; the robot is 0.68 m wide and starts 5 cm and 2 deg off."""
    path = Path.through([[0, 0], [5, 0]])
    plan = time_scale(path, [Speed(0.5), Acceleration(0.55, 1.5)], robot=ROBOT)
    walls = (
        Wall("left", 0.5, (2.5, 0.45), (2.5, 2.0), 0.1),
        Wall("right", 0.5, (2.5, -0.45), (2.5, -2.0), 0.1),
    )
    door = Scene(0.332, Flat(), walls)
    off = (0.0, 0.05, math.radians(2.0))
    seen = drive_plan(plan, door, tracker=Tracker(), start_error=off)
    assert not seen.recording.hits
    assert seen.goal_offset < 0.02
    assert math.degrees(seen.final_heading_error) < 1.0
    crash = drive_plan(plan, door, start_error=(0.0, 0.3, 0.0))
    hit, *_ = crash.recording.hits
    assert hit.name == "left"
    # the front, 0.369 m ahead of the axle, meets the wall's near face
    assert hit.place[0] == pytest.approx(2.45, abs=0.01)
    reached = float(np.interp(hit.time, crash.recording.times, crash.recording.pose[:, 0]))
    assert reached + 0.369 == pytest.approx(2.45, abs=0.02)


def problem(number: int) -> Problem:
    return load_problem(ROOT / "problems" / "powerbot" / f"experiment_{number}.toml")


def with_friction(task: Problem, share: float) -> list[Limit]:
    kept = [
        x for x in task.replace({"limits.variant": None}).limits if x.name not in ("slip", "tip")
    ]
    return [*kept, Slip(share * task.scene.friction)]


def assert_safe_and_at_the_goal(seen: DrivenEncounter) -> None:
    run = seen.run
    assert run.arrived
    assert not run.hit
    assert not seen.contact
    assert run.kept  # the stopping distance, at every instant
    assert run.gap.min() > 0
    assert (
        seen.off[200:].max() < 0.02
    )  # m, once the start error has gone: inside the planner's allowance
    assert seen.goal_offset < 0.02
    assert math.degrees(seen.heading_error) < 1.0
    assert seen.slip_ratio < 0.02


def test_a_disc_that_crosses_is_let_by() -> None:
    """In the way of a robot that would be there at the same time; the same disc in front of a blind
    robot is hit."""
    path = Path.through([[0, 0], [3, 0]])
    limits = [Speed(0.5), Acceleration(0.55, 1.5), Slip(0.8 * 0.332)]
    where = course(time_scale(path, limits, robot=ROBOT), ROBOT)
    visitor = Visitor(appears=1.0, stays=6.0, distance=1.6, aside=-1.6, speed=0.5)
    seen = drive_encounter(
        where,
        ROBOT,
        FLOOR,
        Sensor(1.4, 0.1, 0.1, unseen_speed=0.5),
        [visitor],
        longest=20.0,
        start_error=(0.0, 0.02, math.radians(1.0)),
    )
    assert_safe_and_at_the_goal(seen)
    blind = drive_encounter(
        where,
        ROBOT,
        FLOOR,
        Sensor(1.4, 0.1, 0.1),
        longest=5.0,
        visitors=[visitor],
        planner=lambda w, s, plan, now, _: replan(w, s, plan, now, []),
    )
    assert blind.contact
    assert not blind.run.kept


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["stand", "leave", "cross"])
def test_experiment_3_among_its_obstacles(kind: str) -> None:
    """Both obstacles at the printed times: as printed, leaving the lane on a track, crossing at a
    walking pace."""
    task = problem(3)
    assert [(o.appears, o.clears_after) for o in task.encounters] == [(9.95, 0.59), (21.2, 2.74)]
    where = course(
        time_scale(task.path, with_friction(task, 0.5), robot=ROBOT),
        ROBOT,
        limits=with_friction(task, 0.8),
    )
    sensor = {
        "stand": Sensor(0.6, 0.5, 0.5),
        "leave": Sensor(0.6, 0.5, 0.5, unseen_speed=0.1),
        "cross": Sensor(2.5, 0.1, 0.1, unseen_speed=0.8),
    }[kind]
    visitors = {
        "stand": [Visitor(o.appears, o.clears_after, o.distance) for o in task.encounters],
        "leave": [
            Visitor(o.appears, 10.0, o.distance, 0.49 - 0.1 * o.clears_after, 0.1)
            for o in task.encounters
        ],
        "cross": [Visitor(o.appears - 3.0, 8.0, 2.0, -2.9, 0.8) for o in task.encounters],
    }[kind]
    seen = drive_encounter(
        where,
        ROBOT,
        Scene(task.scene.friction, Flat()),
        sensor,
        visitors,
        longest=200.0,
        start_error=(0.0, 0.02, math.radians(1.0)),
    )
    assert_safe_and_at_the_goal(seen)
    near = np.isfinite(seen.run.gap)
    assert near.any()
    assert np.count_nonzero(np.diff(near.astype(int)) == 1) == 2  # both came
    assert not near[-1]


@pytest.mark.slow
@pytest.mark.parametrize("manner", ["below", "least_squares"])
def test_experiment_6_along_its_profile(manner: Literal["below", "least_squares"]) -> None:
    task = problem(6)
    assert task.profile is not None
    plan = follow(
        task.path, task.profile.bound, with_friction(task, 0.7), robot=ROBOT, manner=manner
    )
    seen = drive_plan(plan.trajectory, Scene(task.scene.friction, Flat()), tracker=Tracker())
    assert seen.goal_offset < 0.02
    assert math.degrees(seen.final_heading_error) < 1.0
    assert seen.speed_error < 0.043  # m/s, what [waheed2006] measured on the robot (Table 18)
    assert seen.slip_ratio < 0.02
