"""What the replanner expects of obstacles, seen and unseen, against motions sampled densely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from trajopt.control.encounter import Course, Obstacle, clearance, course, safe_speed
from trajopt.control.encounter_run import run_encounter
from trajopt.control.replan import TIME_STEP, Sensor, SpeedPlan, at_rest, replan, stops_in_time
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.speed import Speed
from trajopt.paths.path import Path
from trajopt.robots.robot import robot as shipped
from trajopt.timing.scaling import time_scale

WIDE = Sensor(20.0, 0.1, 0.1)  # sees everything
BRAKING = 1.2  # m/s^2


def motion_on(path: Path) -> Course:
    robot = shipped("powerbot")
    return course(time_scale(path, [Speed(1.0), Acceleration(0.8, BRAKING)], robot=robot), robot)


@pytest.fixture(scope="module")
def straight() -> Course:
    return motion_on(Path.through([[0, 0], [12, 0]]))


@pytest.fixture(scope="module")
def left_turn() -> Course:
    angle = np.linspace(0, np.pi / 2, 7)
    return motion_on(Path.through(np.column_stack([2 * np.sin(angle), 2 - 2 * np.cos(angle)])))


def even(where: Course, speed: float, samples: int) -> SpeedPlan:
    """A plan that moves at one speed from the middle of the path, then stands."""
    s = where.length / 2 + speed * TIME_STEP * np.arange(samples)
    v = np.full(samples, speed)
    v[-1] = 0.0
    return SpeedPlan(0.0, s, v)


def gaps(where: Course, plan: SpeedPlan, thing: Obstacle, each: int) -> np.ndarray:
    """Distance (m) of a thing that keeps its velocity, ``each`` times a sample of the plan."""
    time = np.arange((len(plan.s) - 1) * each + 1) / each
    poses = where.poses(np.interp(time, np.arange(len(plan.s)), plan.s))
    centres = np.asarray(thing.centre) + np.outer(time * TIME_STEP, thing.velocity)
    return clearance(poses, where.outline, centres, np.full(len(time), thing.radius))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_known_velocity_carries_a_thing_forward_in_time(straight: Course, side: float) -> None:
    """What will stand in the way when the robot is there is refused, though it is far away now;
    what stands in the way now and will be gone is no hindrance."""
    plan, crossing = even(straight, 0.5, 151), np.array([0.0, side * 0.9])
    there = straight.poses(plan.s[100:101])[0, :2]
    start = there - 100 * TIME_STEP * crossing
    comes = Obstacle((start[0], start[1]), 0.1, (crossing[0], crossing[1]))
    passes = replace(comes, velocity=(-crossing[0], -crossing[1]))
    assert gaps(straight, plan, comes, 1).min() < 0 < gaps(straight, plan, passes, 1).min() - 0.5
    assert not stops_in_time(straight, WIDE, plan, [comes])
    assert stops_in_time(straight, WIDE, plan, [passes])
    leaves = Obstacle((there[0], there[1]), 0.1, (crossing[0], crossing[1]))
    assert stops_in_time(straight, WIDE, plan, [leaves])
    assert not stops_in_time(straight, WIDE, plan, [replace(leaves, velocity=(0.0, 0.0))])


@pytest.mark.parametrize("towards", [True, False])
def test_a_run_says_whether_what_the_world_held_could_have_been_met(
    straight: Course, towards: bool
) -> None:
    """The record looks at the true things, also at those that no scan shows: here one beyond the
    range, faster than anything unseen was said to be, for one instant."""
    near = Sensor(1.2, 0.1, 0.1)
    plan = replan(straight, near, at_rest(0.0), 0.0, [])
    rest = int(np.flatnonzero(plan.v > 0)[-1])
    x, y, _ = straight.poses(plan.s[rest : rest + 1])[0]
    thing = Obstacle((x, y - 12.0 * rest * TIME_STEP), 0.1, (0.0, 12.0 if towards else -12.0))
    assert gaps(straight, plan, thing, 1)[0] > near.reach
    run = run_encounter(
        straight,
        near,
        lambda t, _: [thing] if t < TIME_STEP / 2 else [],
        planner=lambda *_: plan,
        longest=0.1,
        knows_velocity=True,
    )
    assert run.kept is not towards


def corner_between_samples(
    where: Course, plan: SpeedPlan, corner: int, k: int
) -> tuple[np.ndarray, np.ndarray]:
    """A corner of the outline (2,) half-way between samples k and k + 1, and the direction (2,)
    that points away from it along the outline's diagonal."""
    x, y, yaw = where.poses(np.array([(plan.s[k] + plan.s[k + 1]) / 2]))[0]
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    away = turn @ np.sign(where.outline[corner]) / np.sqrt(2)
    return np.array([x, y]) + turn @ where.outline[corner], away


def test_a_corner_that_sweeps_a_post_between_two_samples_is_refused(left_turn: Course) -> None:
    """The outer front corner is the only part of the outline that touches the post, and it does so
    half-way between two samples."""
    plan, k = even(left_turn, 1.0, 41), 20
    corner = int(np.argmax(left_turn.outline @ [1.0, -1.0]))
    at, _ = corner_between_samples(left_turn, plan, corner, k)
    post = Obstacle((at[0], at[1]), 1e-4)
    assert gaps(left_turn, plan, post, 1).min() > 1e-3
    assert gaps(left_turn, plan, post, 20).min() < 0
    assert not stops_in_time(left_turn, WIDE, plan, [post])
    aside = at + 0.1 * np.array([np.sin(0.8), -np.cos(0.8)])
    assert stops_in_time(left_turn, WIDE, plan, [Obstacle((aside[0], aside[1]), 1e-4)])


def test_a_ball_that_grazes_a_creeping_robot_between_two_samples_is_refused(
    straight: Course,
) -> None:
    """The robot moves by 1 mm a sample, the ball by 10 cm: what it may do in between counts."""
    plan, k, radius = even(straight, 0.05, 41), 20, 0.1
    corner = int(np.argmax(straight.outline @ [1.0, 1.0]))
    at, away = corner_between_samples(straight, plan, corner, k)
    velocity = 5.0 * np.array([-away[1], away[0]])
    for far, fits in ((radius - 1e-4, False), (radius + 0.2, True)):
        start = at + far * away - (k + 0.5) * TIME_STEP * velocity
        ball = Obstacle((start[0], start[1]), radius, (velocity[0], velocity[1]))
        assert gaps(straight, plan, ball, 1).min() > 0.01
        assert bool(gaps(straight, plan, ball, 20).min() > 0) is fits
        assert stops_in_time(straight, WIDE, plan, [ball]) is fits


@pytest.mark.parametrize("unseen", [0.0, 0.5, 1.0])
def test_the_unseen_is_expected_at_its_full_speed(straight: Course, unseen: float) -> None:
    """On a free straight way the robot goes as fast as the closed form of the safe speed allows,
    which counts what may come towards it from beyond the range."""
    sensor = Sensor(1.6, 0.1, 0.1, unseen_speed=unseen)
    run = run_encounter(straight, sensor, lambda *_: [], longest=100.0)
    fastest = min(safe_speed(1.6, 0.2, BRAKING, obstacle_speed=unseen), 1.0)
    assert run.arrived
    assert run.v.max() <= fastest + BRAKING * TIME_STEP
    assert run.v.max() >= 0.9 * fastest


@pytest.mark.parametrize("scan", [0.1, 0.4])
def test_what_comes_from_beyond_the_range_meets_a_robot_at_rest(
    straight: Course, scan: float
) -> None:
    """Head on, at the unseen's full speed, appearing just beyond the range behind a scan."""
    unseen = 0.7
    sensor = Sensor(1.5, scan, 0.1, unseen_speed=unseen)
    front = float(straight.outline[:, 0].max())
    begun: dict[str, float] = {}

    def world(now: float, pose: np.ndarray) -> list[Obstacle]:
        if now < 3.0 + TIME_STEP:
            return []
        begun.setdefault("time", now)
        begun.setdefault("place", pose[0] + front + sensor.reach + 0.11)
        ahead = begun["place"] - unseen * (now - begun["time"])
        if ahead - 0.1 - pose[0] - front < -0.05:  # it has met the robot, and is gone
            return []
        return [Obstacle((ahead, 0.0), 0.1, (0.0, 0.0), unseen)]

    run = run_encounter(straight, sensor, world, longest=40.0)
    assert run.gap.min() < 0.02  # it does come
    assert not run.hit
    assert run.kept
