"""Seeded trials of a planned climb in physics: drive the approach (sub-test 1), then climb
(sub-test 2).

[guzman2015], sections 6.1 and 6.2, with random friction, start pose and wheel angles. Every trial
draws from its own number, so that it can be repeated alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array, require_not_negative
from trajopt.control.approach import Mode, approach_controller
from trajopt.control.bend import Goal
from trajopt.errors import ArgumentError
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.problem import Problem
from trajopt.simulate.engine import Command, Recording
from trajopt.simulate.plan import SAMPLE_TIME
from trajopt.simulate.sensors import Sensors
from trajopt.systems.smdw.approach_run import Ending, ending_of, run_controlled
from trajopt.systems.smdw.climb import (
    Climb,
    Four,
    Outcome,
    StepScene,
    judge,
    reached,
    record_climb,
    run_approach,
)
from trajopt.systems.smdw.configurations import Configuration, travel_to_step
from trajopt.systems.smdw.entry import WHEELS, free_ground, start_pose, step_of
from trajopt.systems.smdw.planner import Plan

NEAREST = 0.004  # m, least gap to the step that a climb starts with; chosen


@dataclass(frozen=True)
class Scatter:
    """What varies between trials, all chosen: standard deviations of the start's ``position`` (m),
    ``yaw`` and ``wheels`` (rad), which the plan does not know, and the share by which ``friction``
    is at most off."""

    position: float = 0.005
    yaw: float = math.radians(0.5)
    wheels: float = 0.05
    friction: float = 0.25

    def __post_init__(self) -> None:
        for name in ("position", "yaw", "wheels"):
            require_not_negative(f"scatter.{name}", getattr(self, name), "(standard deviation)")
        if not 0 <= self.friction < 1:
            raise ArgumentError("scatter.friction", self.friction, "a share from 0 to less than 1")


@dataclass(frozen=True, eq=False)
class ClimbTrial:
    """One trial: how the approach ended, and what the climb from there came to (None where the
    approach left physics). ``moved_back`` (m): where the approach ended too near to the step for a
    climb to start from."""

    number: int
    friction: float
    moved_back: float
    ending: Ending
    outcome: Outcome | None
    approach: Recording
    climb: Recording | None

    @property
    def exploded(self) -> bool:
        return self.outcome is None or self.outcome.exploded


def step_scene(problem: Problem, friction: float, torque: float | None = None) -> StepScene:
    """The problem's step and wheels with another friction and torque (N m a wheel; None: the
    problem's)."""
    limit = problem.robot.motor_array("torque").min() if torque is None else torque
    robot = problem.robot.replace({"motors.all.torque": float(limit)})
    return StepScene(step_of(problem), friction, robot)


def largest_wheel_speed(problem: Problem) -> float:
    """What every wheel may reach, rad/s."""
    found = [limit.largest for limit in problem.limits if isinstance(limit, WheelSpeed)]
    return float(np.min(found)) if found else math.inf


def critical_wheels(configuration: Configuration) -> tuple[int, int]:
    """Indices of the wheels that meet the step first (0 = front-left)."""
    return WHEELS.index(configuration.critical[0]), WHEELS.index(configuration.critical[1])


def before_step(problem: Problem, pose: Array) -> tuple[float, float, float]:
    """The pose (3,), moved back from the step where a corner of the robot is nearer to it than
    NEAREST."""
    x, y, yaw = (float(v) for v in pose)
    step = step_of(problem)
    normal, turned = np.array(step.normal), yaw - step.direction
    corners = np.array(problem.robot.footprint) @ np.array([math.cos(turned), -math.sin(turned)])
    room = float(normal @ (np.array(step.place) - [x, y])) - NEAREST - float(corners.max())
    return (
        (x, y, yaw)
        if room >= 0.0
        else (x + room * float(normal[0]), y + room * float(normal[1]), yaw)
    )


def four(values: Array) -> Four:
    """An array (4,) as the tuple that commands want."""
    a, b, c, d = (float(v) for v in values)
    return a, b, c, d


def approach_command(
    problem: Problem, plan: Plan, rng: Generator, scatter: Scatter | None = None
) -> Command:
    """The plan's wheel speeds from a start with random errors of pose and wheel angles."""
    scatter = Scatter() if scatter is None else scatter
    times = np.linspace(0.0, plan.duration, max(2, round(plan.duration / SAMPLE_TIME)))
    errors = rng.normal(0.0, [scatter.position, scatter.position, scatter.yaw])
    x, y, yaw = (float(v) for v in np.array(start_pose(problem)) + errors)
    wheels = problem.start_wheels + rng.normal(0.0, scatter.wheels, 4)
    return Command(times, plan.trajectory.at(times).wheel_speeds, None, (x, y, yaw), wheels)


def _angles(command: Command) -> Array:
    """Start angles (4,) of an approach's wheels."""
    assert command.start_wheel_angles is not None  # approach_command gives them
    return command.start_wheel_angles


def climb_trial(
    problem: Problem,
    plan: Plan,
    number: int,
    *,
    control: Mode | None = None,
    sensors: Sensors | None = None,
    engine: str = "mujoco",
    scatter: Scatter | None = None,
) -> ClimbTrial:
    """Drive the plan from a start with errors, then 2 s against the step.

    ``control`` None drives the planned wheel speeds without feedback; ``sensors`` are those of the
    feedback. Raises ArgumentError where the manoeuvre turns too little for "pose and phase",
    MissingDependencyError where the engine is not installed.
    """
    if number < 0:
        raise ArgumentError("number", number, "a whole number >= 0")
    if sensors is not None and control is None:
        raise ArgumentError(
            "sensors", sensors, "None without control: planned wheel speeds measure nothing"
        )
    scatter = Scatter() if scatter is None else scatter
    rng = np.random.default_rng([number, 11])
    friction = problem.scene.friction * float(
        rng.uniform(1 - scatter.friction, 1 + scatter.friction)
    )
    step = step_scene(problem, friction)
    command = approach_command(problem, plan, rng, scatter)
    critical = critical_wheels(plan.configuration)
    end = plan.trajectory.at(plan.duration)
    goal = Goal(
        end.pose[0],
        end.wheel_angles[0],
        critical,
        largest_wheel_speed(problem),
    )
    if control is None:
        approach = run_approach(step, command, engine=engine)
    else:
        controller = approach_controller(
            plan.trajectory,
            problem.robot,
            _angles(command),
            critical,
            cap=goal.cap,
            goal_wheels=goal.wheels,
            ground=free_ground(problem),
            mode=control,
        )
        sense = (Sensors() if sensors is None else sensors).sense(rng)
        approach = run_controlled(
            step, controller, sense, command.start_pose, four(_angles(command)), engine=engine
        )
    ending = ending_of(approach, goal)
    if approach.exploded:
        return ClimbTrial(number, friction, 0.0, ending, None, approach, None)
    pose, wheels = reached(approach)
    start = before_step(problem, np.array(pose))
    climb = Climb(
        step,
        start,
        wheels,
        plan.configuration.direction,
        critical,
        travel_to_step(problem, plan.configuration, start),
    )
    recording = record_climb(climb, engine)
    return ClimbTrial(
        number,
        friction,
        math.dist(start[:2], pose[:2]),
        ending,
        judge(climb, recording),
        approach,
        recording,
    )


def climb_trials(
    problem: Problem,
    plan: Plan,
    numbers: Sequence[int],
    *,
    control: Mode | None = None,
    sensors: Sensors | None = None,
    engine: str = "mujoco",
    scatter: Scatter | None = None,
    workers: int = 1,
    progress: Callable[[list[ClimbTrial]], None] | None = None,
) -> list[ClimbTrial]:
    """Trials in the order of ``numbers``, the same whatever the number of worker processes.

    ``progress(done)`` is called after each with all that are done. Raises as ``climb_trial``, and
    ArgumentError for no trials or workers < 1.
    """
    if len(numbers) == 0:
        raise ArgumentError("numbers", list(numbers), "at least one trial")
    if workers < 1:
        raise ArgumentError("workers", workers, "at least 1")
    found = []
    one = partial(
        climb_trial, problem, plan, control=control, sensors=sensors, engine=engine, scatter=scatter
    )
    for trial in _mapped(one, numbers, workers):
        found.append(trial)
        if progress is not None:
            progress(found)
    return found


def _mapped(
    one: Callable[[int], ClimbTrial], numbers: Sequence[int], workers: int
) -> Iterator[ClimbTrial]:
    if workers == 1:
        yield from map(one, numbers)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield from pool.map(one, numbers)
