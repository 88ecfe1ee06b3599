"""[waheed2006] beside this package: tables of encounters and of driving in physics."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence

import numpy as np

from benchmarks.common import ResultTable
from benchmarks.theses.powerbot_study import BALANCED, DATA, problem, sample_time_study, timed
from benchmarks.theses.powerbot_tables_encounters import with_friction
from trajopt.control.tracking import Tracker
from trajopt.refine.profile import follow
from trajopt.systems.powerbot.constants import FRICTION
from trajopt.timing.scaling import time_scale
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

RESERVE = 0.7  # share of the friction that a plan for closed-loop driving uses; chosen


def following_in_physics() -> ResultTable:
    """Experiment 6 in pybullet along its profile."""
    from trajopt.systems.powerbot.drive import drive_plan

    task, robot = problem(6), BALANCED
    assert task.profile is not None
    profile = task.profile.bound
    rows = []
    for manner in ("below", "least_squares"):
        plan = follow(
            task.path,
            profile,
            with_friction(task, RESERVE),
            robot=robot,
            manner="below" if manner == "below" else "least_squares",
        )
        for loop, tracker in (("open", None), ("closed", Tracker())):
            scene = Scene(task.scene.friction, Flat())
            seen = drive_plan(plan.trajectory, scene, tracker=tracker)
            run = seen.recording
            moving = run.times <= plan.trajectory.duration
            along = np.hypot(*(run.pose - run.pose[0])[:, :2].T)
            off = (run.speed - np.interp(along, profile.places, profile.speeds))[moving]
            rows.append(
                [
                    manner,
                    loop,
                    f"{plan.trajectory.duration:.2f}",
                    f"{plan.error:.4f}",
                    f"{seen.speed_error:.4f}",
                    f"{np.sqrt(np.mean(off**2)):.4f}",
                    f"{seen.goal_offset:.4f}",
                    f"{math.degrees(seen.final_heading_error):.3f}",
                    f"{seen.slip_ratio:.2%}",
                ]
            )
    return ResultTable(
        "Experiment 6 in physics (measured on the robot: speed error 0.043 m/s, goal offset 0.928 m)",
        (
            "manner",
            "loop",
            "time, s",
            "plan from profile, m/s",
            "speed from plan, m/s",
            "speed from profile, m/s",
            "goal offset, m",
            "final heading, deg",
            "wheel slip / speed",
        ),
        rows,
    )


def physics(numbers: Sequence[int]) -> ResultTable:
    """Open and closed loop in pybullet beside the measured columns."""
    from trajopt.systems.powerbot.drive import drive_plan

    robot = BALANCED
    with (DATA / "measured.csv").open(encoding="utf-8") as file:
        measured = list(csv.DictReader(line for line in file if not line.startswith("#")))
    rows = []
    for number in numbers:
        task = problem(number)
        plan = time_scale(
            task.path, with_friction(task, RESERVE), robot=robot, ground=task.scene.ground
        )
        scene = task.scene
        theirs = [m for m in measured if int(m["experiment"]) == number]
        for loop, tracker in (("open", None), ("closed", Tracker())):
            seen = drive_plan(plan, scene, tracker=tracker)
            rows.append(
                [
                    str(number),
                    loop,
                    f"{plan.duration:.1f}",
                    f"{seen.speed_error:.4f}",
                    f"{math.degrees(seen.heading_error):.3f}",
                    f"{seen.goal_offset:.4f}",
                    f"{math.degrees(seen.final_heading_error):.3f}",
                    f"{seen.slip_ratio:.2%}",
                    *(
                        " ".join(m[k] or "-" for m in theirs)
                        for k in ("speed_error", "heading_error", "goal_offset")
                    ),
                ]
            )
    return ResultTable(
        f"Physics: friction {FRICTION}, plans at {RESERVE:.0%} of it per wheel",
        (
            "experiment",
            "loop",
            "time, s",
            "speed error, m/s",
            "heading error, deg",
            "goal offset, m",
            "final heading, deg",
            "wheel slip / speed",
            "measured speed error",
            "measured heading error",
            "measured goal offset",
        ),
        rows,
    )


def following() -> ResultTable:
    """Experiment 6."""
    task = problem(6)
    assert task.profile is not None
    profile = task.profile.bound
    rows = []
    for manner in ("below", "least_squares"):
        found = follow(
            task.path,
            profile,
            task.limits,
            robot=task.robot,
            manner="below" if manner == "below" else "least_squares",
        )
        rows.append(
            [
                manner,
                f"{found.trajectory.duration:.2f}",
                f"{found.error:.4f}",
                f"{found.largest_error:.3f}",
                f"{min(found.trajectory.margins().values()):.0e}",
            ]
        )
    return ResultTable(
        "Experiment 6: following a profile (printed: 30.0 s, measured error 0.043 m/s)",
        ("manner", "time, s", "speed error over the path, m/s", "largest", "least margin"),
        rows,
    )


def sample_times() -> ResultTable:
    """What digitising the commands costs, without any disturbance."""
    motion = timed(problem(2), "thesis", "linear")
    steps = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)
    with (DATA / "tables_1_2_sample_time.csv").open(encoding="utf-8") as file:
        printed = {
            float(r["sample_time_s"]): r
            for r in csv.DictReader(x for x in file if not x.startswith("#"))
        }
    rows = []
    for held, mean in zip(
        sample_time_study(motion, steps, "held"),
        sample_time_study(motion, steps, "mean"),
        strict=True,
    ):
        theirs = printed.get(held.sample_time)
        rows.append(
            [
                f"{held.sample_time:g}",
                f"{held.speed_error:.4f}",
                f"{held.goal_error:.3f}",
                f"{mean.goal_error:.4f}",
                theirs["speed_error"] if theirs else "",
                theirs["goal_error_m"] if theirs else "",
            ]
        )
    return ResultTable(
        "Sample time of the commands, experiment 2",
        (
            "sample time, s",
            "speed error held, m/s",
            "goal error held, m",
            "goal error mean, m",
            "speed error measured (Table 1)",
            "goal error measured (Table 2)",
        ),
        rows,
    )
