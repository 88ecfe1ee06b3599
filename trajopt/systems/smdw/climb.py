"""Climb trials: drive a robot against a step and see which wheels get up ([guzman2015], chapter 6).

Sub-test 1 executes an approach open loop (or with a controller); sub-test 2 starts at the state
that was reached and drives 2 s at 8.5 rad/s against the step. A wheel is up when its centre has
risen by 0.7 of the step's height. A run that leaves physics is counted apart and never averaged in.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context

import numpy as np

from trajopt.control.measured import Controller
from trajopt.errors import ArgumentError
from trajopt.report.intervals import wilson
from trajopt.robots.robot import Robot
from trajopt.simulate.engine import Command, Recording
from trajopt.simulate.sensors import Sense, exact
from trajopt.simulate.stepping import drive
from trajopt.world.obstacles import Step
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

Four = tuple[float, float, float, float]

CLIMB_TIME = 2.0  # s, [guzman2015] section 6.1
CLIMB_SPEED = 8.5  # rad/s at the wheels, [guzman2015] Table 6.5 (3 km/h)
UP = 0.7  # share of the step's height by which a wheel centre must have risen; chosen
RAMP = 0.1  # s to full speed, chosen: the thesis switches at once
HOLD = 0.2  # s at the end over which a wheel must have stayed up, chosen
COAST = 0.3  # s of rest after an approach, chosen
TIMEOUT = 1.5  # of the planned duration, [guzman2015] section 6.1


@dataclass(frozen=True)
class StepScene:
    """The ``step``, the ``friction`` of what it is made of, and the ``robot`` that climbs it."""

    step: Step
    friction: float
    robot: Robot

    @property
    def height(self) -> float:
        """m."""
        return self.step.height

    def scene(self) -> Scene:
        return Scene(self.friction, Flat(), (self.step,))


@dataclass(frozen=True)
class Climb:
    """Sub-test 2 from ``pose`` (m, m, rad) with ``wheels`` (rad): drive along ``motion``, a unit
    vector in the body.

    ``critical`` are the wheels (0 = front-left) that meet the step first, ``travel`` (m) what they
    have to roll until then. ``speed`` (rad/s) at the wheels; a slower climb gets more time for the
    same distance.
    """

    step: StepScene
    pose: tuple[float, float, float]
    wheels: Four
    motion: tuple[float, float]
    critical: tuple[int, int]
    travel: tuple[float, float]
    speed: float = CLIMB_SPEED


@dataclass(frozen=True)
class Outcome:
    """``up``: wheels that stayed up to the end. ``first_attempt``: the leading wheels came up
    within half a turn of meeting the step. ``exploded`` with its ``reason``: the run left physics,
    and the rest does not count. ``yaw_change`` (rad) over the climb."""

    up: tuple[bool, bool, bool, bool]
    critical_up: bool
    first_attempt: bool
    exploded: bool
    reason: str
    yaw_change: float

    @property
    def all_up(self) -> bool:
        return all(self.up)


@dataclass(frozen=True)
class Rate:
    """``successes`` of ``trials`` (exploded ones left out), with Wilson's 95 % interval."""

    successes: int
    trials: int
    exploded: int

    @property
    def share(self) -> float:
        """0 where nothing was tried."""
        return self.successes / self.trials if self.trials else 0.0

    @property
    def interval(self) -> tuple[float, float]:
        return wilson(self.successes, self.trials)


def climb_command(climb: Climb) -> Command:
    """Constant wheel speeds along the motion, reached within RAMP."""
    robot = climb.step.robot
    speed = climb.speed * robot.wheels[0].radius
    full = robot.inverse @ np.array([speed * climb.motion[0], speed * climb.motion[1], 0.0])
    times = np.array([0.0, RAMP, CLIMB_TIME * (CLIMB_SPEED / climb.speed)])
    speeds = np.vstack([np.zeros(len(full)), full, full])
    return Command(times, speeds, None, climb.pose, np.array(climb.wheels))


def run_climb(climb: Climb, engine: str = "mujoco") -> Outcome:
    """Sub-test 2. Raises ArgumentError for an unknown engine and what the engine raises."""
    return judge(climb, record_climb(climb, engine))


def record_climb(climb: Climb, engine: str = "mujoco") -> Recording:
    """Sub-test 2, all of its motion; errors of ``run_climb``."""
    return drive(climb.step.robot, climb.step.scene(), climb_command(climb), engine=engine)


def judge(climb: Climb, recording: Recording) -> Outcome:
    """Outcome of a recorded sub-test 2."""
    if recording.exploded:
        return Outcome((False,) * 4, False, False, True, recording.reason, 0.0)
    risen = recording.wheel_heights - recording.wheel_heights[0] >= UP * climb.step.height
    last = recording.times >= recording.times[-1] - HOLD
    up = [bool(risen[last, i].all()) for i in range(4)]
    first = True
    lateral = climb.motion[0] == 0.0
    for i, travel in zip(climb.critical, climb.travel, strict=True):
        turned = np.abs(recording.wheel_angles[:, i] - recording.wheel_angles[0, i])
        limit = travel / climb.step.robot.wheels[i].radius + math.pi
        first &= bool(risen[:, i].any() and turned[np.argmax(risen[:, i])] <= limit)
        if not lateral:  # forward, the second wheel meets the step while the first one is climbing
            break
    both = up[climb.critical[0]] and up[climb.critical[1]]
    return Outcome(
        (up[0], up[1], up[2], up[3]),
        both,
        first,
        False,
        "",
        float(recording.pose[-1, 2] - recording.pose[0, 2]),
    )


def run_approach(
    step: StepScene,
    command: Command,
    *,
    engine: str = "mujoco",
    controller: Controller | None = None,
    sense: Sense = exact,
    rest: float = COAST,
) -> Recording:
    """Sub-test 1: execute an approach (its wheel speeds, or a controller) with the step standing
    there.

    An approach ends at rest, so the run ends ``rest`` seconds after it; TIMEOUT bounds that without
    a controller.
    """
    extra = rest if controller is not None else min(rest, (TIMEOUT - 1.0) * command.duration)
    end = command.duration
    times = np.append(command.times, [end + 1e-6, end + extra])
    speeds = np.vstack([command.wheel_speeds, np.zeros((2, 4))])
    longer = replace(command, times=times, wheel_speeds=speeds)
    return drive(
        step.robot, step.scene(), longer, engine=engine, controller=controller, sense=sense
    )


def reached(recording: Recording) -> tuple[tuple[float, float, float], Four]:
    """Pose and wheel angles at the end of a recording."""
    x, y, yaw = (float(v) for v in recording.pose[-1])
    a, b, c, d = (float(v) for v in recording.wheel_angles[-1])
    return (x, y, yaw), (a, b, c, d)


def climb_all(
    climbs: Sequence[Climb], *, engine: str = "mujoco", workers: int = 1
) -> list[Outcome]:
    """Outcomes in the order of ``climbs``, the same whatever the number of worker processes."""
    return list(_mapped(climbs, engine, workers))


def _mapped(climbs: Iterable[Climb], engine: str, workers: int) -> Iterator[Outcome]:
    if workers <= 1:
        yield from (run_climb(c, engine) for c in climbs)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        jobs = list(climbs)
        yield from pool.map(run_climb, jobs, [engine] * len(jobs))


def rate(outcomes: Sequence[Outcome], *, what: str = "critical_up") -> Rate:
    """Share of outcomes with ``what``: critical_up, first_attempt or all_up."""
    if what not in ("critical_up", "first_attempt", "all_up"):
        raise ArgumentError("what", what, "critical_up, first_attempt or all_up")
    sound = [o for o in outcomes if not o.exploded]
    return Rate(sum(bool(getattr(o, what)) for o in sound), len(sound), len(outcomes) - len(sound))
