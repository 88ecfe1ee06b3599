"""Trials of climbs: what one is, how they start, their file."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.random import Generator

from benchmarks.common import OUT
from trajopt.arrays import Array
from trajopt.problem import Problem
from trajopt.systems.smdw.climb import Climb, Outcome
from trajopt.systems.smdw.configurations import Configuration
from trajopt.systems.smdw.planner import Plan, plan_configuration
from trajopt.systems.smdw.trials import NEAREST, before_step, critical_wheels, four, step_scene

FILES = {0.035: "step_3_5cm.toml", 0.05: "step_5cm.toml"}
NAMES = {"lateral left": "lateral", "forward -35 deg": "forward35", "forward -45 deg": "forward45"}
# m, rad, rad: of the state a climb starts from; chosen
POSITION_SD = 0.003
YAW_SD = math.radians(0.5)
WHEEL_SD = 0.05
FRICTION = (0.6, 1.0)  # range, issue's trials


@dataclass(frozen=True)
class Trial:
    """One row of the trial file."""

    part: str
    engine: str
    height: float
    configuration: str
    source: str
    number: int
    friction: float
    torque: float
    critical_up: bool
    first_attempt: bool
    all_up: bool
    exploded: bool
    reason: str
    seconds: float  # wall time, mean of its cell; nan where it was not taken


def kept(name: str) -> list[Trial]:
    """Trials that an earlier run wrote."""
    file = OUT / f"{name}_trials.csv"
    if not file.exists():
        return []
    with file.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    return [
        Trial(
            r["part"],
            r["engine"],
            float(r["height"]),
            r["configuration"],
            r["source"],
            int(r["number"]),
            float(r["friction"]),
            float(r["torque"]),
            r["critical_up"] == "True",
            r["first_attempt"] == "True",
            r["all_up"] == "True",
            r["exploded"] == "True",
            r["reason"],
            float(r.get("seconds") or math.nan),
        )
        for r in rows
    ]


def keep(name: str, rows: Sequence[Trial]) -> None:
    OUT.mkdir(parents=True, exist_ok=True)
    with (OUT / f"{name}_trials.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(asdict(rows[0])))
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def plan_of(problem: Problem, configuration: Configuration) -> Plan:
    """The exact plan; these problems all have one."""
    plan = plan_configuration(problem, configuration)
    if not isinstance(plan, Plan):
        raise SystemExit(f"{configuration.name}: {plan.reason}")
    return plan


def climb_from(
    problem: Problem, plan: Plan, wheels: Array, rng: Generator, yaw_error: float = 0.0
) -> Climb:
    """Sub-test 2 from the plan's target with random state errors and friction, and the given wheel
    angles (4,)."""
    x, y, yaw = plan.target.pose
    dx = min(float(rng.normal(0.0, POSITION_SD)), problem.climb.gap - NEAREST)
    shift = np.array([dx, rng.normal(0.0, POSITION_SD), yaw_error + rng.normal(0.0, YAW_SD)])
    angles = wheels + rng.normal(0.0, WHEEL_SD, 4)
    pose = before_step(problem, np.array([x, y, yaw]) + shift)
    c = plan.configuration
    return Climb(
        step_scene(problem, float(rng.uniform(*FRICTION))),
        pose,
        four(angles),
        c.direction,
        critical_wheels(c),
        plan.target.travel,
    )


def trials_of(
    part: str,
    engine: str,
    name: str,
    source: str,
    climbs: Sequence[Climb],
    outcomes: Sequence[Outcome],
    seconds: float = math.nan,
) -> list[Trial]:
    return [
        Trial(
            part,
            engine,
            c.step.height,
            name,
            source,
            n,
            c.step.friction,
            float(c.step.robot.motor_array("torque").min()),
            o.critical_up,
            o.first_attempt,
            o.all_up,
            o.exploded,
            o.reason,
            seconds,
        )
        for n, (c, o) in enumerate(zip(climbs, outcomes, strict=True))
    ]
