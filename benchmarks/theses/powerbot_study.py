"""What [waheed2006] does and this package does not: its sample time study, its rule of halving
speeds, its factor of linear time scaling."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from benchmarks.common import OUT, PROBLEMS, ROOT
from trajopt.control.commands import commands, driven
from trajopt.control.encounter import Course, Obstacle
from trajopt.control.replan import TIME_STEP, Sensor, SpeedPlan
from trajopt.control.tracking import Tracker
from trajopt.problem import Problem, load_problem
from trajopt.robots.robot import robot
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory

_FINE = 0.01  # s between points where speeds are compared; chosen
_CREEP = 0.05  # m/s; the halving rule stops below it; chosen
TIMED = (1, 2, 4, 5)  # experiments that the thesis scales linearly
FIGURES = OUT / "powerbot_tables"
# balancing castors: one point of support behind
BALANCED = robot(
    "powerbot",
    {"wheels.castor-left.position": [-0.31, 0.0], "wheels.castor-right.position": [-0.31, 0.0]},
)
START_ERROR = (0.0, 0.02, math.radians(1.0))  # m, m, rad; chosen
SETTLE = Tracker().settle  # s behind the arrival
OFF_AFTER = round(5.0 / TIME_STEP)  # samples until a start error has gone
DATA = ROOT / "tests" / "data" / "powerbot"


class StudyRow(NamedTuple):
    """One sample time: error norm of the speed (m/s, eq. 3.10) and error of the final position (m,
    eq. 3.11)."""

    sample_time: float
    speed_error: float
    goal_error: float


def sample_time_study(
    trajectory: Trajectory, sample_times: Sequence[float], rule: Literal["held", "mean"] = "held"
) -> list[StudyRow]:
    """Tables 1 and 2 of [waheed2006] without its disturbances: what digitising alone costs."""
    rows = []
    start, goal = trajectory.at([0.0, trajectory.duration]).pose
    for sample_time in sample_times:
        orders = commands(trajectory, sample_time, rule=rule)
        t = np.arange(0.0, trajectory.duration, _FINE)
        i = np.clip((t / sample_time).astype(np.intp), 0, len(orders.times) - 1)
        given = orders.speeds[i].mean(axis=1)
        error = float(np.sqrt(np.mean((given - trajectory.at(t).twist[:, 0]) ** 2)))
        assert trajectory.robot is not None  # or commands had refused
        end = driven(orders, trajectory.robot, start, np.array([orders.duration]))[0]
        rows.append(StudyRow(sample_time, error, float(np.hypot(*(end - goal)[:2]))))
    return rows


def halving_plan(
    where: Course, sensor: Sensor, current: SpeedPlan, now: float, seen: Sequence[Obstacle]
) -> SpeedPlan:
    """The thesis's rule (section 3.6): half a cycle on, then half the speed; resume by doubling.

    An obstacle counts as in the way when it is within reach of the outline ahead. It promises
    nothing: the stopping distance is not looked at. The recovery is ambiguous in the thesis; here
    the speed doubles every cycle, from a creep, up to the plan's.
    """
    half = max(round(sensor.scan_time / 2 / TIME_STEP), 1)
    s0, v0 = (float(x[0]) for x in current.sampled(now, 1))
    slower = 0.5 * v0 if 0.5 * v0 > _CREEP else 0.0
    wanted = [v0] * half + [slower] * half if seen else [max(2 * v0, 2 * _CREEP)] * (2 * half)
    s_list, v_list = [s0], [v0]
    drop = float(where.braking.min()) * TIME_STEP
    while wanted or v_list[-1] > 0:
        v = (
            wanted.pop(0) if wanted else max(v_list[-1] - drop, 0.0)
        )  # behind the cycle: a full brake
        beyond = s_list[-1] + v * TIME_STEP
        if beyond < where.length:
            v = min(v, float(where.speed(np.array([beyond]))[0]))
        s_list.append(min(s_list[-1] + v * TIME_STEP, where.length))
        v_list.append(v if s_list[-1] < where.length else 0.0)
    return SpeedPlan(now, np.array(s_list), np.array(v_list))


def linear_factor(
    speed: float,
    acceleration: float,
    braking: float,
    *,
    speed_limit: float,
    acceleration_limit: float,
    braking_limit: float,
) -> float:
    """The thesis's factor on time from the unscaled maxima (eqs. 2.35 to 2.38; roots restored).

    max(1, v/V, sqrt(a/A), sqrt(d/D)); speeds m/s, accelerations and brakings m/s^2, all magnitudes.
    """
    return float(
        max(
            1.0,
            speed / speed_limit,
            np.sqrt(acceleration / acceleration_limit),
            np.sqrt(braking / braking_limit),
        )
    )


def problem(number: int) -> Problem:
    """The problem file of an experiment."""
    return load_problem(PROBLEMS / "powerbot" / f"experiment_{number}.toml")


# Physical limits with the slip formula of the thesis, which leaves the yaw moment out
OWN = {"limits.variant": None, "limits.slip_rule": "load"}


def timed(task: Problem, variant: str, engine: str = "auto") -> Trajectory:
    """The path of a problem, timed."""
    limits = task.replace({"limits.variant": "thesis"} if variant == "thesis" else OWN).limits
    return time_scale(task.path, limits, robot=task.robot, ground=task.scene.ground, engine=engine)


def yes(holds: bool) -> str:
    """For tables."""
    return "yes" if holds else "no"
