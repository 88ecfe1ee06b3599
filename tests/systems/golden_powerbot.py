"""Golden figures of [waheed2006]: every call into the package that they need."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from benchmarks.theses.powerbot_study import halving_plan, linear_factor
from tests.systems.golden_data import ROOT, Figures, rows_of
from trajopt.control.encounter import Visitor, course, safe_speed, visited_world
from trajopt.control.encounter_run import run_encounter
from trajopt.control.replan import Sensor, replan
from trajopt.limits.slip import Slip
from trajopt.limits.tip import Tip
from trajopt.paths.path import Path as RobotPath
from trajopt.paths.samples import sample_path
from trajopt.problem import Problem, load_problem
from trajopt.refine.profile import follow
from trajopt.robots.robot import robot as shipped
from trajopt.systems.powerbot.constants import FRICTION, REACTION_TIME, SCAN_TIME, SONAR_RANGE
from trajopt.systems.powerbot.limits import (
    thesis_slide_speed,
    thesis_slip_acceleration,
    thesis_tip_acceleration,
)
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory

TIMED = (1, 2, 4, 5)  # PowerBot experiments that [waheed2006] scales linearly
VARIANTS: tuple[Literal["thesis", "physical"], ...] = ("thesis", "physical")
SLOPES = (0.0, 5.99, -5.99)  # deg; experiment 4's ramp


def powerbot_limits() -> Figures:
    """Slip and tip limits by slope, uphill > 0, the thesis's and the physical ones; safe speeds."""
    found = {}
    robot = shipped("powerbot")
    for degrees in SLOPES:
        slope = math.radians(degrees)
        thesis = np.array([slope])
        found[f"a_slip (2.20) at {degrees:g} deg, m/s^2"] = float(
            thesis_slip_acceleration(thesis, FRICTION)[0]
        )
        found[f"a_tip (2.24) at {degrees:g} deg, m/s^2"] = float(thesis_tip_acceleration(thesis)[0])
        hill = RobotPath.through([[0, 0, 0], [3 * math.cos(slope), 0, 3 * math.sin(slope)]])
        samples = sample_path(hill, np.array([1.5]))
        for limit in (Slip(FRICTION, rule="load"), Tip()):
            rows = limit.rows(samples, robot)
            push, slow = rows.a > 1e-9, rows.a < -1e-9
            for what, value in (
                ("accelerating", np.min(rows.c[push] / rows.a[push])),
                ("braking", np.max(rows.c[slow] / rows.a[slow])),
            ):
                found[f"{limit.name}, physical, {what} at {degrees:g} deg, m/s^2"] = float(value)
    found["sliding speed on a radius of 1 m (2.15), m/s"] = thesis_slide_speed(
        np.array([1.0]), FRICTION
    )
    for braking in (1.51, 1.70, 2.55):
        found[f"safe speed, braking {braking:.2f} m/s^2, m/s"] = safe_speed(
            SONAR_RANGE, SCAN_TIME + REACTION_TIME, braking
        )
    return found


def powerbot_printed_times() -> Figures:
    """Linear scaling from the printed maxima."""
    found = {}
    for row in rows_of("powerbot/experiments.csv"):
        if int(row["experiment"]) in TIMED:
            factor = linear_factor(
                float(row["unscaled_v_max"]),
                float(row["unscaled_a_max"]),
                -float(row["unscaled_d_max"]),
                speed_limit=float(row["v_lim"]),
                acceleration_limit=float(row["a_lim"]),
                braking_limit=-float(row["d_lim"]),
            )
            found[f"experiment {row['experiment']}, s"] = factor * float(row["unscaled_time"])
    return found


def _experiment(number: int) -> Problem:
    return load_problem(ROOT / "problems" / "powerbot" / f"experiment_{number}.toml")


OWN = {"limits.variant": None, "limits.slip_rule": "load"}


def _timed(task: Problem, variant: Literal["thesis", "physical"], engine: str) -> Trajectory:
    return time_scale(
        task.path,
        task.replace(OWN if variant == "physical" else {"limits.variant": variant}).limits,
        robot=task.robot,
        ground=task.scene.ground,
        engine=engine,
    )


def powerbot_times() -> Figures:
    """The fitted paths under the thesis's limits and the physical ones, scaled linearly and
    time-optimally."""
    found = {}
    for number in TIMED:
        task = _experiment(number)
        found[f"experiment {number}, length, m"] = task.path.length
        for variant in VARIANTS:
            for engine in ("linear", "toppra", "auto"):
                name = f"experiment {number}, {variant} limits, {engine}, s"
                found[name] = _timed(task, variant, engine).duration
    return found


def powerbot_encounters() -> Figures:
    """Experiment 3: two things appear 0.6 m ahead and go away (printed: 46.5 and 49.3 s)."""
    found, task = {}, _experiment(3)
    visitors = [
        Visitor(o.appears, o.clears_after, o.distance, radius=0.15) for o in task.encounters
    ]
    sensor = Sensor(SONAR_RANGE, SCAN_TIME, REACTION_TIME)
    for variant, engine in (("thesis", "linear"), ("physical", "auto")):
        plan = _timed(task, variant, engine)  # type: ignore[arg-type]  # a tuple of literals
        where = course(plan, task.robot)
        label = f"experiment 3, {variant} limits, {engine}"
        found[f"{label}, planned, s"] = plan.duration
        for rule, planner in (("stops in time", replan), ("halving", halving_plan)):
            world = visited_world(visitors, where.outline)
            run = run_encounter(where, sensor, world, planner=planner, longest=300.0)
            found[f"{label}, {rule}, s"] = float(run.times[-1])
            found[f"{label}, {rule}, promise kept"] = float(run.kept)
    return found


def powerbot_following() -> Figures:
    """Experiment 6: following a speed profile (printed: 30.0 s)."""
    found, task = {}, _experiment(6)
    assert task.profile is not None
    profile = task.profile.bound
    for manner in ("below", "least_squares"):
        followed = follow(
            task.path,
            profile,
            task.limits,
            robot=task.robot,
            manner=manner,  # type: ignore[arg-type]  # a tuple of literals
        )
        found[f"experiment 6, {manner}, s"] = followed.trajectory.duration
        found[f"experiment 6, {manner}, speed error, m/s"] = followed.error
        found[f"experiment 6, {manner}, largest speed error, m/s"] = followed.largest_error
    return found
