"""One small example of every function that draws a figure: for the contact sheet, and for the test of one style."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import trajopt
from benchmarks import time_scaling_pictures
from benchmarks.common import PROBLEMS
from benchmarks.peers import timing_picture
from benchmarks.theses import (
    asoc_pictures,
    powerbot_figures,
    smdw_figures,
    smdw_rate_pictures,
    smdw_search_pictures,
    smdw_trial_figures,
    smdw_wheel_figures,
)
from trajopt.bench import pictures as bench
from trajopt.bench.tables import BenchTables
from trajopt.control.encounter import Obstacle, course
from trajopt.control.encounter_run import run_encounter
from trajopt.control.replan import Sensor
from trajopt.report import convergence_picture, shown, sweep_case, sweeps
from trajopt.report.loads_picture import loads_figure
from trajopt.report.path_picture import path_figure
from trajopt.report.physics_picture import physics_figure
from trajopt.report.profile_picture import profile_figure
from trajopt.report.robot_picture import robot_figure
from trajopt.simulate.check import ValidationReport
from trajopt.solution import Solution
from trajopt.systems.powerbot.pictures import replan_figure
from trajopt.systems.smdw import pictures as smdw
from trajopt.systems.smdw.climbing import DEFAULT_WHEEL, FITTED_WHEEL, loc8_smdw
from trajopt.systems.smdw.planner import plan_climb
from trajopt.systems.smdw.trial_pictures import Motions, motions_figure

_OPTIMIZERS = ("lattice", "pso", "pso-gbest", "nelder-mead", "slsqp", "l-bfgs-b", "cma-es", "bobyqa", "direct")  # fmt: skip
_WAY = np.linspace([0.0, 0.0, 0.0], [1.0, 0.5, -0.6], 40)


@cache
def solved(file: str) -> Solution:
    """The solution of a shipped problem."""
    return trajopt.solve(trajopt.load_problem(PROBLEMS / file))


@cache
def checked(file: str) -> ValidationReport:
    """What MuJoCo makes of that solution."""
    solution = solved(file)
    assert solution.trajectory is not None
    return trajopt.validate(solution.trajectory, solution.problem, engine="mujoco")


def of_run(draw: Callable[[Solution, Any], Figure], part: str, file: str) -> Callable[[], Figure]:
    return lambda: draw(solved(file), getattr(solved(file), part))


def searched() -> Figure:
    def bowl(x: Any) -> float:
        return float(np.sum((np.asarray(x) - 0.3) ** 2))

    found = {
        name: [trajopt.minimize(bowl, [(-1.0, 1.0)] * 3, optimizer=name, seed=seed, budget=trajopt.Budget(evaluations=1500)) for seed in range(5)]
        for name in ("pso", "differential-evolution")
    }  # fmt: skip
    return convergence_picture.seeds_figure(found)


@cache
def compared() -> BenchTables:
    """A made-up comparison of nine optimizers on two problems."""
    rng, rows = np.random.default_rng(5), []
    problems = ("smdw/scenario_1_lateral/p2", "classical/rosenbrock-10")
    for problem, (k, name), seed in itertools.product(problems, enumerate(_OPTIMIZERS), range(3)):
        cost = np.minimum.accumulate(10.0 ** -(rng.random(20) * (12 - k)).cumsum())
        used = np.unique(rng.integers(1, 2000, 60))[:20]
        rows.append({
            "problem": problem, "optimizer": name, "seed": seed, "status": "done", "dimension": 3, "reference": 1.0,
            "cost": float(cost[-1]), "feasible": True, "nfev": 2000, "gradients": 0, "failures": 0, "seconds": 0.2,
            "at_evaluations": used, "at_seconds": 1e-4 * used * (1 + k), "at_cost": cost,
        })  # fmt: skip
    return BenchTables(rows)


@cache
def study() -> pd.DataFrame:
    """A made-up study of climbs."""
    axes: dict[str, list[Any]] = {
        "configuration": ["lateral", "forward35", "forward45"],
        "obstacles.step.height": [0.03, 0.04, 0.05],
        "friction": [0.3, 0.5, 0.8],
        "heading_error": [-0.05, 0.0, 0.05],
        "torque": [2.0, 4.0, 8.0],
        "repeat": list(range(9)),
    }
    rows = pd.DataFrame(list(itertools.product(*axes.values())), columns=list(axes))
    rng = np.random.default_rng(3)
    share = rows["friction"] * rows["torque"] / 8 * (1.6 - 20 * rows["obstacles.step.height"])
    rows["climbed"] = rng.random(len(rows)) < share
    rows["duration"] = 2.0 + rows["friction"] + 0.1 * rng.standard_normal(len(rows))
    return rows.assign(status="done")


@cache
def encounter() -> dict[str, Any]:
    robot = trajopt.robot("powerbot")
    path = trajopt.Path.through(
        [[0, 0], [2, 0.3], [4, 0]], start_direction=[1, 0], end_direction=[1, 0]
    )
    limits = [trajopt.Speed(0.8), trajopt.Acceleration(0.5, 1.0)]
    plan, slow = (trajopt.time_scale(path, chosen, robot=robot) for chosen in (limits, [trajopt.Speed(0.4), *limits[1:]]))  # fmt: skip
    where, sensor = course(plan, robot), Sensor(2.0, 0.1, 0.1)
    block = Obstacle((2.0, 0.3), 0.2)
    run = run_encounter(where, sensor, lambda t, _: [block] if t < 5 else [], longest=20.0)
    free = run_encounter(where, sensor, lambda *_: [], longest=20.0)
    return {"plan": plan, "slow": slow, "where": where, "run": run, "free": free}


def climb_cells() -> list[smdw_trial_figures.ClimbCell]:
    return [
        smdw_trial_figures.ClimbCell("mujoco", height, name, source, k, 20, (0.0, 0.5))
        for height in (0.035, 0.05)
        for name in ("lateral", "forward35")
        for source, k in (("planned exactly", 18), ("uniform random phases", 6))
    ]


def searches() -> Figure:
    way = _WAY[:, :2]
    lines = [(f"{k} s", way * [1.0, 0.2 * k]) for k in range(1, 12)]
    return smdw_search_pictures.searches_figure([("over time", lines), ("two", lines[:2])], way[-1])


def swarms() -> Figure:
    places = np.random.default_rng(0).uniform(0.0, 1.0, (400, 2))
    one = smdw_search_pictures.SwarmSearch("one search", places, _WAY[:, :2], _WAY[20, :2])
    return smdw_search_pictures.swarms_figure([one] * 4, ((0.0, 1.0), (0.0, 1.0)), ((-0.2, 1.2), (-0.2, 1.2)))  # fmt: skip


def costs() -> Figure:
    rng = np.random.default_rng(1)
    lines = [(np.arange(60.0), np.minimum.accumulate(np.exp(-rng.random(60).cumsum()))) for _ in range(10)]  # fmt: skip
    return smdw_search_pictures.costs_figure([(f"scenario {k}", lines) for k in (1, 2, 3)])


def cost_maps() -> Figure:
    x, y = np.linspace(0, 1, 30), np.linspace(0, 0.8, 25)
    cost = 1e-3 + (x[None, :] - 0.4) ** 2 + (y[:, None] - 0.3) ** 2
    shown_map = smdw_search_pictures.CostMap("scenario 1", x, y, cost, np.array([[0.4, 0.3]]))
    return smdw_search_pictures.cost_maps_figure([shown_map] * 3)


def isotropy() -> Figure:
    x, y = np.linspace(1.5, 3.0, 30), np.linspace(0, 45, 20)
    values = np.exp(-((x[None, :] - 2 / np.cos(np.radians(y[:, None]))) ** 2))
    labels = ("Isotropy", "split / offset (–)", "largest tilt (deg)")
    return asoc_pictures.map_figure(x, y, values, labels, (2 / np.cos(np.radians(y)), y))


def setups() -> Figure:
    files = {n: trajopt.load_problem(PROBLEMS / "smdw" / f) for n, f in smdw_figures.SCENARIOS.items()}  # fmt: skip
    return smdw_wheel_figures.setups_figure(
        [(f"scenario {n}", problem, smdw_figures.TARGETS[n]) for n, problem in files.items()]
    )


def stored() -> Figure:
    times = np.linspace(0, 2, 200)
    corners = np.array([[0.0, 0, 0], [0.3, 0.4, 0], [0.8, -0.1, 0], [1.0, 0.5, 0]])
    arrays = {"control_points": corners, "driven_pose": np.column_stack([times, np.sin(times), times]), "driven_times": times, "load": np.random.default_rng(0).normal(40, 2, (200, 12))}  # fmt: skip
    return sweep_case.arrays_figure(arrays, searched=True)


def motions() -> Figure:
    ways = [_WAY + np.array([0, 0.03 * k, 0]) for k in range(-6, 7)]
    panel = Motions("closed loop", ways, [abs(k) < 4 for k in range(-6, 7)], _WAY, 1.4, "blue: reached")  # fmt: skip
    return motions_figure([panel, panel], loc8_smdw(), columns=2)


def tracks() -> Figure:
    return asoc_pictures.tracks_figure(
        np.array([[0, 0], [1, 0], [1, 1]]), [(f"sigma {k} cm", _WAY[:, :2] * k / 3) for k in range(1, 6)], "Tracking"
    )  # fmt: skip


def powerbot(name: str) -> Figure:
    facts = encounter()
    match name:
        case "replan":
            return replan_figure(facts["run"], facts["where"], free=facts["free"])
        case "speeds":
            return powerbot_figures.speeds_figure([("slow", facts["slow"]), ("fast", facts["plan"])])  # fmt: skip
        case _:
            return powerbot_figures.path_speed_figure(facts["plan"], knots=[[0, 0], [2, 0.3], [4, 0]])  # fmt: skip


LATERAL, SLOPE, FIELD, CLIMB = "smdw/scenario_1_lateral.toml", "powerbot/across_slope.toml", "asoc/field.toml", "smdw/step_5cm.toml"  # fmt: skip
_X = np.linspace(0.1, 2.0, 40)

# Name -> what draws it. A name begins with that of the function it shows.
FIGURES: dict[str, Callable[[], Figure]] = {
    "path_figure": of_run(path_figure, "path", LATERAL),
    "path_figure over a field": of_run(path_figure, "path", FIELD),
    "convergence_figure": of_run(convergence_picture.convergence_figure, "search", LATERAL),
    "seeds_figure": searched,
    "profile_figure": of_run(profile_figure, "trajectory", LATERAL),
    "profile_figure over a field": of_run(profile_figure, "trajectory", FIELD),
    "loads_figure": of_run(loads_figure, "trajectory", SLOPE),
    "loads_figure over a field": of_run(loads_figure, "trajectory", FIELD),
    "physics_figure": lambda: physics_figure(solved(LATERAL), checked(LATERAL)),
    "figure_of a trajectory": lambda: shown.figure_of(solved(SLOPE).trajectory),
    "figure_of a problem": lambda: shown.figure_of(solved(SLOPE).problem),
    "figure_of a search": lambda: shown.figure_of(solved(LATERAL).search),
    "figure_of a check": lambda: shown.figure_of(checked(LATERAL)),
    "robot_figure": lambda: robot_figure(trajopt.robot("swerve"), twist=[0.4, 0.0, 0.6]),
    "arrays_figure": stored,
    "heat_map": lambda: sweeps.heat_map(study(), "friction", "obstacles.step.height", "duration"),
    "lines": lambda: sweeps.lines(study(), "torque", "climbed", "repeat"),
    "lines of a median": lambda: sweeps.lines(study(), "friction", "duration", "configuration"),
    "pairs": lambda: sweeps.pairs(study(), ["friction", "torque", "duration"]),
    "ecdf_figure": lambda: bench.ecdf_figure(compared()),
    "profiles_figure": lambda: bench.profiles_figure(compared()),
    "families_figure": lambda: bench.families_figure(compared()),
    "geometry_figure": lambda: smdw.geometry_figure(DEFAULT_WHEEL, 0.05),
    "plans_figure": lambda: smdw.plans_figure(plan_climb(trajopt.load_problem(PROBLEMS / CLIMB))),
    "motions_figure": motions,
    "searches_figure": searches,
    "swarms_figure": swarms,
    "costs_figure": costs,
    "cost_maps_figure": cost_maps,
    "cam_figure": lambda: smdw_wheel_figures.cam_figure(DEFAULT_WHEEL, FITTED_WHEEL),
    "wheel_at_step_figure": lambda: smdw_wheel_figures.wheel_at_step_figure(DEFAULT_WHEEL, math.radians(-35), math.radians(-30), 0.035),
    "setups_figure": setups,
    "climb_rates_figure": lambda: smdw_trial_figures.climb_rates_figure(climb_cells()),
    "phase_map_figure": lambda: smdw_trial_figures.phase_map_figure({("lateral", 0.05): {(8.0, 0.8): [0.0, 1.0, 0.4], (4.0, 0.5): [0.5, 1.0, 0.2]}}, [-0.6, 0.0, 0.6]),
    "causes_figure": lambda: smdw_trial_figures.causes_figure({"gap (cm)": {n: {2.0: (20, 20), 5.0: (5, 20)} for n in ("lateral", "forward")}}),
    "endings_figure": lambda: smdw_trial_figures.endings_figure({n: np.abs(np.random.default_rng(0).normal(0, [3e-3, 9e-3, 4e-2], (30, 3))) for n in ("noiseless", "noise")}, dict.fromkeys(("noiseless", "noise"), (0.005, 0.0087, 0.06))),
    "rate_maps": lambda: smdw_rate_pictures.rate_maps(study()),
    "rate_lines": lambda: smdw_rate_pictures.rate_lines(study()),
    "curve_figure": lambda: asoc_pictures.curve_figure(_X, np.exp(-_X), {0.5: 0.6, 1.0: 0.35}, ("Isotropy", "split / offset (–)", "mean isotropy (–)")),
    "map_figure": isotropy,
    "tracks_figure": tracks,
    "speed_figure": lambda: asoc_pictures.speed_figure([("sigma 1 cm", _X, 1 + 0.1 * np.sin(9 * _X))], 1.2, "Speed"),
    "front_figure": lambda: asoc_pictures.front_figure(np.column_stack([_X / 2, 1 - _X / 2, 1 - (_X / 2) ** 2]), ["K", "d_max", "S"], np.array([0.5, 0.5, 0.7])),
    "replan_figure": lambda: powerbot("replan"),
    "speeds_figure": lambda: powerbot("speeds"),
    "path_speed_figure": lambda: powerbot("path"),
    "safe_speed_figure": lambda: powerbot_figures.safe_speed_figure(braking=1.5, robot_speed=2.1),
    "phase": lambda: time_scaling_pictures.phase(time_scaling_pictures.timed(300)),
    "rows": lambda: time_scaling_pictures.rows(time_scaling_pictures.timed(300)),
    "grid": time_scaling_pictures.grid,
    "gap": time_scaling_pictures.gap,
    "growth_figure": lambda: timing_picture.growth_figure({"compiled": ((100, 1000, 10000), (1e-3, 1e-2, 1e-1)), "toppra": ((100, 1000), (1e-2, 0.12))}),
}  # fmt: skip
