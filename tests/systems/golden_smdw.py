"""Golden figures of [guzman2015]: every call into the package that they need."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache

import numpy as np

from benchmarks.theses.smdw_study import terminal_cost
from tests.smdw_problems import SMDW, smdw_problem
from tests.systems.golden_data import ROOT, Figures, rows_of
from trajopt.pipeline import solve, validate
from trajopt.problem import load_problem
from trajopt.solution import Solution
from trajopt.systems.smdw.climbing import DEFAULT_WHEEL, FITTED_WHEEL, forward_alphas
from trajopt.systems.smdw.entry import WHEELS
from trajopt.systems.smdw.geometry import contact_offset
from trajopt.systems.smdw.planner import Maneuver, plan_climb
from trajopt.systems.smdw.trials import climb_trials

TRIALS = 4  # climbs a configuration and control
STEPS = ("step_5cm", "step_3_5cm")


def smdw_costs() -> Figures:
    """Costs decoded from the deviations and final states that [guzman2015] prints."""
    found = {}
    for table, key, named in (
        ("table_5_5_time_interval", "time_s", "Table 5.5, T = {} s"),
        ("table_5_6_repeat_1s", "test", "Table 5.6, test {}"),
    ):
        for row in rows_of(f"smdw/{table}.csv"):
            pose = np.array([float(row[k]) for k in ("dx_m", "dy_m", "dpsi_rad")])
            wheels = np.array([float(row[f"dtheta{i}_rad"]) for i in (1, 2, 3, 4)])
            found[named.format(row[key])] = _cost(pose, wheels, first=False)
    for row in rows_of("smdw/figures_5_15_to_5_22.csv"):
        final = np.array([float(row[k]) for k in ("xf_m", "yf_m", "psif_rad")])
        wheels = np.array([float(row[f"theta{i}_rad"]) for i in (1, 2, 3, 4)])
        first = row["implementation"] == "first"
        found[f"Figure {row['figure']}"] = _cost(final - [2, 0.75, 1.5708], wheels, first=first)
    return found


def _cost(pose: np.ndarray, wheels: np.ndarray, *, first: bool) -> float:
    """Table 4.4 with the gains of the first or the enhanced implementation."""
    gains = ([1, 0.125, 1], [10] * 4) if first else ([3, 0.125, 2.5], [0, 12.5, 0, 12.5])
    return terminal_cost(pose, wheels, np.array(gains[0]), np.array(gains[1]))


def smdw_wheel() -> Figures:
    """Figures 4.10 and 4.18: contact offsets, and where a step can be climbed forward."""
    found = {}
    for name, wheel in (("default", DEFAULT_WHEEL), ("fitted", FITTED_WHEEL)):
        for degrees in (30, 60):
            offset = 100 * float(contact_offset(wheel, np.radians(degrees)))
            found[f"{name} wheel, contact offset at {degrees} deg, cm"] = offset
        found[f"{name} wheel, greatest clearance, cm"] = 100 * wheel.greatest_clearance
        for where, theta in (("at 0", 0.0), ("at any angle", None)):
            span = forward_alphas(wheel, 0.05, theta=theta)
            if span is not None:
                label = f"{name} wheel, 5 cm forward {where}"
                found[f"{label}, least angle, deg"] = math.degrees(span[0])
                found[f"{label}, largest angle, deg"] = math.degrees(span[1])
    return found


@cache
def _maneuver(name: str) -> Maneuver:
    return plan_climb(load_problem(ROOT / "problems" / "smdw" / f"{name}.toml"))


def smdw_plans() -> Figures:
    """The six configurations of both steps: durations and targets."""
    found = {}
    for name in STEPS:
        for plan in sorted(_maneuver(name).plans, key=lambda p: p.configuration.name):
            label = f"{name}, {plan.configuration.name}"
            found[f"{label}, duration, s"] = plan.duration
            for axis, value in zip(("x, m", "y, m", "yaw, rad"), plan.target.pose, strict=True):
                found[f"{label}, target {axis}"] = value
            found[f"{label}, window's half width, rad"] = plan.margin
    return found


def smdw_plan_errors() -> Figures:
    """How far the critical wheels end from their targets, and the footprint from every border."""
    found = {}
    for name in STEPS:
        for plan in sorted(_maneuver(name).plans, key=lambda p: p.configuration.name):
            label = f"{name}, {plan.configuration.name}"
            found[f"{label}, critical wheels' error, rad"] = plan.wheel_error
            found[f"{label}, least room, m"] = plan.room
    return found


@cache
def _solutions() -> Mapping[str, Solution]:
    return {name: solve(smdw_problem(name)) for name in SMDW}


def smdw_solutions() -> Figures:
    """The thesis's problems, solved: how long the exact motions take."""
    return {f"{name}, duration, s": found.duration for name, found in _solutions().items()}


def smdw_solution_errors() -> Figures:
    """The thesis's problems, solved: cost and what the critical wheels miss."""
    found = {}
    for name, solution in _solutions().items():
        critical = list(solution.problem.critical_indices)
        missed = float(np.abs(solution.wheel_deviation[critical]).max())
        found[f"{name}, cost"] = solution.cost
        found[f"{name}, critical wheels' error, rad"] = missed
    return found


def smdw_physics() -> Figures:
    """Table 6.2 to 6.4's counterpart: scenario 1 at planned wheel speeds, in MuJoCo."""
    found = {}
    for name, solution in _solutions().items():
        if not name.startswith("scenario_1"):
            continue
        assert solution.trajectory is not None
        report = validate(solution.trajectory, solution.problem, engine="mujoco")
        found[f"{name}, final distance, m"] = report.final_distance
        found[f"{name}, final yaw error, rad"] = report.yaw
        for wheel, value in zip(WHEELS, report.wheel_deviation, strict=True):
            found[f"{name}, {wheel} wheel's error, rad"] = float(value)
    return found


def smdw_climbs() -> Figures:
    """Climbs of a 5 cm step in MuJoCo, the same trials for every configuration."""
    found = {}
    problem = _maneuver("step_5cm").problem
    for plan in sorted(_maneuver("step_5cm").plans, key=lambda p: p.configuration.name):
        for control, label in ((None, "open loop"), ("pose and phase", "closed loop")):
            trials = climb_trials(problem, plan, range(TRIALS), control=control)  # type: ignore[arg-type]
            sound = [t.outcome for t in trials if t.outcome is not None and not t.exploded]
            name = f"{plan.configuration.name}, {label}, of {TRIALS}"
            found[f"{name}: leading wheels up"] = sum(o.critical_up for o in sound)
            found[f"{name}: at the first attempt"] = sum(
                o.critical_up and o.first_attempt for o in sound
            )
            found[f"{name}: all four up"] = sum(o.all_up for o in sound)
            found[f"{name}: exploded"] = len(trials) - len(sound)
    return {name: float(count) for name, count in found.items()}
