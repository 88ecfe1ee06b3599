"""[waheed2006] beside this package: tables of encounters with obstacles."""

from __future__ import annotations

import math

import numpy as np

from benchmarks.common import ResultTable
from benchmarks.theses.powerbot_study import (
    BALANCED,
    FIGURES,
    OFF_AFTER,
    SETTLE,
    START_ERROR,
    halving_plan,
    problem,
    timed,
    yes,
)
from trajopt.control.encounter import Visitor, course, visited_world
from trajopt.control.encounter_run import Run, run_encounter
from trajopt.control.replan import TIME_STEP, Sensor, replan
from trajopt.limits.limit import Limit
from trajopt.limits.slip import Slip
from trajopt.problem import Problem
from trajopt.systems.powerbot.constants import FRICTION, REACTION_TIME, SCAN_TIME, SONAR_RANGE
from trajopt.timing.scaling import time_scale
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

BENDS = 0.5  # share of the friction for Experiment 3's plan; chosen
BRAKES = 0.8  # share of the friction for its brakes; chosen
DISC = 0.15  # m, radius of an obstacle; chosen
SLOW = 0.1  # m/s, obstacles on tracks; chosen: what the sonar's delay still allows
WALK = 0.8  # m/s, the same; chosen: a walking pace
LASER = Sensor(2.5, 0.1, 0.1, unseen_speed=WALK)  # m, s, s; chosen: a modest laser range finder


def encounter_three() -> ResultTable:
    """Experiment 3: two things appear 0.6 m ahead and go away."""
    task = problem(3)
    rows = []
    plans = {"linear": timed(task, "thesis", "linear"), "optimal": timed(task, "physical")}
    visitors = visits(task)["stand in the way, then are gone"][1]
    for name, plan in plans.items():
        where = course(plan, task.robot)
        sensor = Sensor(SONAR_RANGE, SCAN_TIME, REACTION_TIME)
        free = run_encounter(where, sensor, lambda *_: [], longest=200.0)
        for rule, planner in (("stops in time", replan), ("halving (thesis)", halving_plan)):
            run = run_encounter(
                where,
                sensor,
                visited_world(visitors, where.outline),
                planner=planner,
                longest=300.0,
            )
            rows.append(
                [
                    name,
                    rule,
                    f"{plan.duration:.1f}",
                    f"{free.times[-1]:.1f}",
                    f"{run.times[-1]:.1f}",
                    f"{run.v.max():.2f}",
                    yes(not run.hit),
                    yes(run.kept),
                    yes(run.arrived),
                    f"{where.length - run.s[-1]:.1e}",
                    f"{slowest(run):.1f}",
                ]
            )
    return ResultTable(
        "Experiment 3 (printed: 46.5 s planned, 49.3 s with obstacles)",
        (
            "plan",
            "rule",
            "plan, s",
            "free way, s",
            "with obstacles, s",
            "top speed, m/s",
            "no contact",
            "stopping distance kept",
            "arrived",
            "distance missing, m",
            "slowest replan, ms of CPU",
        ),
        rows,
    )


def visits(task: Problem) -> dict[str, tuple[Sensor, list[Visitor]]]:
    """Experiment 3's obstacles, as it prints them and on tracks; the sensor knows how fast they may
    be."""
    times = [(thing.appears, thing.clears_after, thing.distance) for thing in task.encounters]
    sonar = Sensor(SONAR_RANGE, SCAN_TIME, REACTION_TIME)
    slow = Sensor(SONAR_RANGE, SCAN_TIME, REACTION_TIME, unseen_speed=SLOW)
    edge = (
        -float(np.asarray(task.robot.footprint)[:, 1].min()) + DISC
    )  # m, centre of a disc that leaves the lane
    return {
        "stand in the way, then are gone": (
            sonar,
            [Visitor(a, c, d, radius=DISC) for a, c, d in times],
        ),
        f"leave the lane at {SLOW:g} m/s": (
            slow,
            [Visitor(a, 10.0, d, edge - SLOW * c, SLOW, DISC) for a, c, d in times],
        ),
        f"cross at {WALK:g} m/s (laser)": (
            LASER,
            [Visitor(a - 3.0, 8.0, 2.0, -2.9, WALK, DISC) for a, _, d in times],
        ),
    }


def encounter_three_in_physics() -> tuple[ResultTable, list[str]]:
    """Experiment 3 in pybullet, closed loop, its obstacles as solid discs; names of the
    pictures."""
    from trajopt.report.style import in_style, save_figure
    from trajopt.systems.powerbot.drive_encounter import drive_encounter
    from trajopt.systems.powerbot.pictures import replan_figure

    FIGURES.mkdir(parents=True, exist_ok=True)
    task, robot = problem(3), BALANCED
    plan = time_scale(task.path, with_friction(task, BENDS), robot=robot)
    where = course(plan, robot, limits=with_friction(task, BRAKES))
    rows, pictures = [], []
    for name, (sensor, visitors) in visits(task).items():
        free = run_encounter(where, sensor, lambda *_: [], longest=200.0)
        seen = drive_encounter(
            where,
            robot,
            Scene(task.scene.friction, Flat()),
            sensor,
            visitors,
            longest=300.0,
            start_error=START_ERROR,
        )
        run = seen.run
        stands = (
            float(np.sum((run.v == 0) & (run.s > 0) & (run.s < where.length - 1e-3))) * TIME_STEP
        )
        rows.append(
            [
                name,
                f"{plan.duration:.1f}",
                f"{free.times[-1]:.1f}",
                f"{run.times[-1] - SETTLE:.1f}",
                f"{stands:.1f}",
                yes(not (seen.contact or run.hit)),
                yes(run.kept),
                f"{run.gap.min():.3f}",
                f"{seen.off[OFF_AFTER:].max():.4f}",
                f"{seen.goal_offset:.4f}",
                f"{math.degrees(seen.heading_error):.3f}",
                f"{seen.slip_ratio:.2%}",
                f"{slowest(run):.1f}",
            ]
        )
        with in_style():
            file = FIGURES / f"experiment_3_{len(rows)}.png"
            pictures.append(save_figure(replan_figure(run, where, free=free), file).name)
    return ResultTable(
        f"Experiment 3 in physics, closed loop, {1e3 * START_ERROR[1]:.0f} mm and {math.degrees(START_ERROR[2]):.0f} "
        "deg off at the start",
        (
            "obstacles",
            "plan, s",
            "free way, s",
            "with obstacles, s",
            "standing, s",
            "no contact",
            "stopping distance kept at every instant",
            "least gap, m",
            "off the plan after 5 s, m",
            "goal offset, m",
            "final heading, deg",
            "wheel slip / speed",
            "slowest replan, ms of CPU",
        ),
        rows,
    ), pictures


def with_friction(task: Problem, share: float) -> list[Limit]:
    """The problem's limits with the physical slip limit per wheel, at a share of the friction."""
    kept: list[Limit] = [
        x for x in task.replace({"limits.variant": None}).limits if x.name not in ("slip", "tip")
    ]
    return [*kept, Slip(share * FRICTION)]


def slowest(run: Run) -> float:
    """ms."""
    return 1e3 * run.slowest_replan
