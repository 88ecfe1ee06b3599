"""The replanner never hits anything while it moves, and arrives when the way is free."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.theses.powerbot_study import halving_plan
from trajopt.control.encounter import (
    Course,
    Obstacle,
    Visitor,
    clearance,
    course,
    safe_speed,
    visited_world,
)
from trajopt.control.encounter_run import run_encounter
from trajopt.control.replan import TIME_STEP, Sensor, SpeedPlan, at_rest, replan, stops_in_time
from trajopt.errors import ArgumentError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.paths.path import Path
from trajopt.robots.robot import robot as shipped
from trajopt.timing.scaling import time_scale

SPAN = 12.0  # s after which the way is free in every encounter


@pytest.fixture(scope="module")
def bend() -> Course:
    path = Path.through([[0, 0], [2, 0.5], [4, -0.3]], start_direction=[1, 0], end_direction=[1, 0])
    robot = shipped("powerbot")
    return course(
        time_scale(path, [Speed(1.0), Acceleration(0.55, 7.8), Slip(0.332)], robot=robot), robot
    )


class Crowd:
    """Discs that enter at or beyond the sensor's range of where the robot then stands, wander with
    bounded speed, and are gone after SPAN."""

    def __init__(self, where: Course, sensor: Sensor, rng: np.random.Generator) -> None:
        self.where, self.sensor, self.rng = where, sensor, rng
        self.count = int(rng.integers(1, 4))
        self.enter = np.sort(rng.uniform(0.0, SPAN * 0.7, self.count))
        self.radius = rng.uniform(0.05, 0.4, self.count)
        self.speed = rng.uniform(0.0, sensor.unseen_speed, self.count)
        self.centre = np.full((self.count, 2), np.nan)
        self.then = 0.0

    def __call__(self, now: float, pose: np.ndarray) -> list[Obstacle]:
        step, self.then = now - self.then, now
        if now > SPAN:
            return []
        things = []
        for i in range(self.count):
            if now < self.enter[i]:
                continue
            if np.isnan(self.centre[i, 0]):
                self.centre[i] = self.enter_at(pose, self.radius[i])
            else:
                self.centre[i] += self.move(i, pose, step)
            things.append(
                Obstacle(
                    tuple(self.centre[i]), self.radius[i], (0.0, 0.0), self.sensor.unseen_speed
                )
            )
        return things

    def enter_at(self, pose: np.ndarray, radius: float) -> np.ndarray:
        """Just outside the range: ahead on the path most of the time, else anywhere around."""
        angle = pose[2] + (
            self.rng.normal(0, 0.3) if self.rng.random() < 0.7 else self.rng.uniform(-np.pi, np.pi)
        )
        far = 0.0
        direction = np.array([np.cos(angle), np.sin(angle)])
        while True:
            centre = pose[:2] + far * direction
            gap = clearance(pose[None], self.where.outline, centre[None], np.array([radius]))[0]
            if gap >= self.sensor.reach:
                return centre
            far += max(self.sensor.reach - gap, 1e-6)

    def move(self, i: int, pose: np.ndarray, step: float) -> np.ndarray:
        """Towards the robot half of the time, else anywhere; never through its outline."""
        to_robot = pose[:2] - self.centre[i]
        angle = (
            np.arctan2(to_robot[1], to_robot[0])
            if self.rng.random() < 0.5
            else self.rng.uniform(-np.pi, np.pi)
        )
        shift = self.speed[i] * step * np.array([np.cos(angle), np.sin(angle)])
        gap = clearance(
            pose[None], self.where.outline, (self.centre[i] + shift)[None], self.radius[i : i + 1]
        )[0]
        return shift if gap > 0.01 else np.zeros(2)


def sensor_for(where: Course, rng: np.random.Generator) -> Sensor:
    """Drawn anew until the robot may drive at all: with too short a range the safe speed is next to
    nothing."""
    while True:
        sensor = Sensor(
            reach=rng.uniform(0.6, 3.0),
            scan_time=rng.choice([0.1, 0.26, 0.5]),
            reaction_time=rng.choice([0.0, 0.1, 0.5]),
            unseen_speed=rng.uniform(0.0, 0.35),
        )
        if (
            safe_speed(
                sensor.reach,
                sensor.scan_time + sensor.reaction_time,
                float(where.braking.min()),
                obstacle_speed=sensor.unseen_speed,
            )
            >= 0.05
        ):
            return sensor


def encounters(where: Course, seeds: range) -> None:
    for seed in seeds:
        rng = np.random.default_rng(seed)
        sensor = sensor_for(where, rng)
        run = run_encounter(where, sensor, Crowd(where, sensor, rng), longest=300.0)
        assert not run.hit, seed
        assert run.kept, seed
        assert run.arrived, seed
        assert np.all(np.diff(run.s) >= 0)
        assert run.s[-1] == pytest.approx(where.length, abs=1e-6)  # the distance is conserved


def test_no_contact_while_moving(bend: Course) -> None:
    encounters(bend, range(40))


@pytest.mark.slow
def test_a_thousand_encounters(bend: Course) -> None:
    encounters(bend, range(1000, 2000))


def test_free_way_costs_one_scan(bend: Course) -> None:
    run = run_encounter(bend, Sensor(6.0, 0.1, 0.0), lambda *_: [], longest=60.0)
    assert run.arrived
    assert run.v.max() == pytest.approx(1.0, abs=1e-6)


def test_blocked_way_stops_and_resumes(bend: Course) -> None:
    block = Obstacle((2.0, 0.5), 0.2)
    run = run_encounter(
        bend, Sensor(2.0, 0.1, 0.1), lambda t, _: [block] if t < 8 else [], longest=60.0
    )
    assert not run.hit
    assert run.v[run.times < 8].min() == 0
    assert run.v[np.argmin(np.abs(run.times - 7.9))] == 0
    assert run.gap[np.isfinite(run.gap)].min() > 0
    assert run.arrived


def test_known_velocity_lets_pass_what_leaves(bend: Course) -> None:
    """A disc that drives away to the side need not stop a robot that knows its velocity."""

    def world(t: float, _: np.ndarray) -> list[Obstacle]:
        return [Obstacle((2.0, 0.2 + 0.5 * t), 0.2, (0.0, 0.5), 0.0)]

    sensor = Sensor(2.0, 0.1, 0.1, unseen_speed=0.5)
    knows = run_encounter(bend, sensor, world, longest=60.0, knows_velocity=True)
    fears = run_encounter(bend, sensor, world, longest=60.0)
    assert knows.arrived
    assert not knows.hit
    assert knows.times[-1] <= fears.times[-1]


def test_a_plan_towards_an_obstacle_is_refused(bend: Course) -> None:
    sensor = Sensor(2.0, 0.1, 0.1)
    fast = replan(bend, sensor, at_rest(0.0), 0.0, [])
    ahead = bend.poses(np.array([fast.s[-1] / 2]))[0]
    assert stops_in_time(bend, sensor, fast, [])
    assert not stops_in_time(bend, sensor, fast, [Obstacle((ahead[0] + 0.369, ahead[1]), 0.05)])


def test_halving_rule_promises_nothing(bend: Course) -> None:
    """With the thesis's rule there is a speed at which the stopping distance is not kept."""
    sensor = Sensor(0.6, 0.5, 0.5)
    block = Obstacle((2.6, 0.35), 0.3)
    run = run_encounter(
        bend, sensor, lambda t, _: [block] if t < 20 else [], planner=halving_plan, longest=60.0
    )
    assert not run.kept
    assert run.arrived


def test_safe_speed_closed_form() -> None:
    """v T + v^2 / (2 d) = range: 0.51, 0.52, 0.54 m/s for 1.51, 1.70, 2.55 m/s^2; the thesis's 0.6
    without braking."""
    for braking, speed in ((1.51, 0.51), (1.70, 0.52), (2.55, 0.54)):
        v = safe_speed(0.6, 1.0, braking)
        assert v == pytest.approx(speed, abs=0.006)
        assert v * 1.0 + v**2 / (2 * braking) == pytest.approx(0.6, rel=1e-12)
    assert safe_speed(0.6, 1.0, 1e9) == pytest.approx(0.6, rel=1e-6)
    assert safe_speed(0.6, 1.0, 2.0, obstacle_speed=0.6) == 0.0
    with pytest.raises(ArgumentError, match="braking"):
        safe_speed(0.6, 1.0, -1.0)


def test_clearance_of_a_rectangle() -> None:
    outline = np.array([[1.0, 0.5], [-1.0, 0.5], [-1.0, -0.5], [1.0, -0.5]])
    pose = np.array([[0.0, 0.0, np.pi / 2]] * 3)
    centres = np.array([[0.0, 3.0], [2.0, 0.0], [0.0, 0.0]])
    assert clearance(pose, outline, centres, np.full(3, 0.25)) == pytest.approx([1.75, 1.25, -0.75])


def test_a_visitor_walks_its_track_where_the_robot_was() -> None:
    outline = np.array([[1.0, 0.5], [-1.0, 0.5], [-1.0, -0.5], [1.0, -0.5]])
    world = visited_world([Visitor(2.0, 3.0, 0.6, aside=-0.4, speed=0.2, radius=0.1)], outline)
    pose = np.array([3.0, 4.0, np.pi / 2])
    assert world(1.9, pose) == []
    (first,) = world(2.0, pose)
    assert first.centre == pytest.approx((3.4, 4.0 + 1.0 + 0.6 + 0.1))
    assert first.deviation == pytest.approx(0.2)
    assert clearance(
        pose[None], outline, np.array([first.centre]), np.array([0.1])
    ) == pytest.approx([0.6])
    (later,) = world(4.5, np.zeros(3))  # where the robot has gone since does not matter
    assert later.centre == pytest.approx((3.4 - 0.5, 5.7))
    assert world(5.0, pose) == []


def test_a_body_beside_its_plan_needs_the_allowance(bend: Course) -> None:
    """A robot that runs 4 cm beside the plan, towards the obstacle, is safe with the allowance for
    it."""

    def beside(plan: SpeedPlan, now: float, _: object) -> np.ndarray:
        x, y, yaw = bend.poses(plan.sampled(now + TIME_STEP, 1)[0])[0]
        return np.array([x - 0.04 * np.sin(yaw), y + 0.04 * np.cos(yaw), yaw])

    block = Obstacle((1.0, 0.71), 0.1)
    outcomes = []
    for allowance in (0.0, 0.05):
        run = run_encounter(
            bend,
            Sensor(2.0, 0.1, 0.1),
            lambda t, _: [block] if t < 6 else [],
            longest=60.0,
            body=beside,
            allowance=allowance,
        )
        outcomes.append((run.hit, run.kept))
        assert run.arrived
    assert outcomes[1] == (False, True)
    assert not outcomes[0][1]
    with pytest.raises(ArgumentError, match="allowance"):
        run_encounter(bend, Sensor(2.0, 0.1, 0.1), lambda *_: [], longest=1.0, allowance=2.0)


def test_a_course_brakes_with_the_limits_it_is_given() -> None:
    """A plan that uses all the friction in a bend leaves no braking; one timed with less does."""
    path = Path.through([[0, 0], [2, 0], [2.6, 0.6], [2.6, 2.5]])
    robot = shipped("powerbot")
    limits = [[Speed(2.1), Acceleration(0.55, 7.8), Slip(share * 0.332)] for share in (0.6, 1.0)]
    fast, slow = (time_scale(path, used, robot=robot) for used in reversed(limits))
    assert course(slow, robot, limits=limits[1]).braking.min() > 0.5
    with pytest.raises(ArgumentError, match="brake everywhere"):
        course(fast, robot, limits=limits[0])
