"""Pictures of the SMDW reproduction page, drawn from runs made here and from the trial files of other benchmarks.

Counterparts of thesis 000: Figures 5.23-5.25 (searches over time interval), 6.4 and 6.11 (sub-test 1), 6.5 and 6.12
(costs), 6.6, 6.7 and 6.13 (sub-test 2); climb rates, phase map and closed-loop endings.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from benchmarks import closed_loop
from benchmarks.climb import NAMES, approach_command, climb_from, plan_of, step_scene
from benchmarks.common import OUT, PROBLEMS
from trajopt.maneuver import configurations
from trajopt.maneuver_problem import ManeuverProblem, load_maneuver
from trajopt.objectives.terminal import terminal_objective
from trajopt.optimize.search import minimize
from trajopt.paths.path import Path as RobotPath
from trajopt.problem import load_problem
from trajopt.report.smdw_trials import (
    ClimbCell,
    Motions,
    climb_rates_figure,
    costs_figure,
    endings_figure,
    motions_figure,
    phase_map_figure,
    searches_figure,
)
from trajopt.robots.smdw import loc8_smdw
from trajopt.simulate.climb import judge, reached, record_climb, run_approach
from trajopt.simulate.engine import Recording

Array = NDArray[np.float64]

SWARM_ITERATIONS = 500  # of the thesis's PSO
PARTICLES = 50  # of the thesis's PSO
# Share of the thesis's ten runs that climbed, least and greatest (sections 6.1, 6.1.1, 6.2); "most" is not counted.
THESIS_SHARE = {("lateral", 0.05): (0.0, 0.0), ("forward35", 0.05): (0.5, 0.5), ("forward45", 0.05): (0.5, 0.6),
                ("lateral", 0.035): (0.2, 0.4), ("forward35", 0.035): (1.0, 1.0), ("forward45", 0.035): (1.0, 1.0)}
SCENARIOS = ((1, "step_5cm.toml"), (2, "step_3_5cm.toml"))


def searches(quick: bool, actuator: dict[str, float | bool]) -> Figure:
    """Figures 5.23-5.25: what the thesis's PSO and the exact planner find over the time interval."""
    intervals = (1.0, 5.0) if quick else tuple(0.5 * k for k in range(1, 15))
    goal = np.array(load_problem(PROBLEMS / "smdw" / "table_5_3.toml").goal.pose[:2])

    def found(duration: float, optimizer: str, seed: int) -> Array:
        problem = load_problem(PROBLEMS / "smdw" / "table_5_3.toml", {"spline.duration": duration, **actuator})
        if optimizer == "lattice":
            problem = problem.replace({"spline.free": ["p1", "p2", "heading"]})
        objective = terminal_objective(problem)
        path = objective.path(minimize(objective, objective.bounds, optimizer=optimizer, seed=seed).x)
        return _places(path)

    pso = "pso-thesis-enhanced"
    return searches_figure([
        ("PSO (5.23)", [(f"{t:g} s", found(t, pso, 0)) for t in intervals]),
        ("PSO, 1 s, ten seeds (5.24)", [(f"{n}", found(1.0, pso, n)) for n in range(2 if quick else 10)]),
        ("Exact (P1, P2, heading)", [(f"{t:g} s", found(t, "lattice", 0)) for t in (1.0, 5.0)]),
    ], goal)


def _places(path: RobotPath) -> Array:
    return path.position(np.linspace(path.start, path.end, 200))[:, :2]


def costs(quick: bool) -> Figure:
    """Figures 6.5, 6.12: best cost of the thesis's PSO over its iterations."""
    panels = []
    for number, _ in SCENARIOS:
        for name in NAMES.values():
            problem = load_problem(PROBLEMS / "smdw" / f"scenario_{number}_{name}.toml", {"actuator.enabled": True})
            objective = terminal_objective(problem)
            lines = []
            for seed in range(2 if quick else 10):
                history = minimize(objective, objective.bounds, optimizer="pso-thesis-enhanced", seed=seed).history
                lines.append((np.append(history.evaluations / PARTICLES, SWARM_ITERATIONS),
                              np.append(history.cost, history.cost[-1])))
            panels.append((f"scenario {number}, {name}", lines))
    return costs_figure(panels)


def motions(quick: bool) -> Iterator[tuple[str, Figure]]:
    """Figures 6.4 and 6.11 (sub-test 1, open loop), 6.6 and 6.13 (sub-test 2 from where it ended), in MuJoCo."""
    trials = 2 if quick else 10
    for number, file in SCENARIOS:
        problem = load_maneuver(PROBLEMS / "smdw" / file)
        first, second = [], []
        for configuration in configurations(problem.robot.wheel, problem.obstacle):
            if configuration.name not in NAMES:
                continue
            plan = plan_of(problem, configuration)
            runs = [_both(problem, configuration.name, n) for n in range(trials)]
            target = np.array(plan.target.pose)
            near = [bool(math.hypot(*(a.pose[-1] - target)[:2]) < 0.02) for a, _, _ in runs]
            edge = problem.obstacle.place[0]
            first.append(Motions(configuration.name, [a.pose for a, _, _ in runs], near, target, edge,
                                 "blue: within 2 cm of the target"))
            up = [good for _, _, good in runs]
            second.append(Motions(configuration.name, [b.pose for _, b, _ in runs], up, None, edge,
                                  f"blue: critical wheels up, {sum(up)} of {trials}"))
        yield f"sub_test_1_scenario_{number}.png", motions_figure(first, loc8_smdw())
        yield f"sub_test_2_scenario_{number}.png", motions_figure(second, loc8_smdw())


def _both(problem: ManeuverProblem, name: str, number: int) -> tuple[Recording, Recording, bool]:
    """Sub-test 1 and the climb from where it ended, and whether the critical wheels came up."""
    configuration = next(c for c in configurations(problem.robot.wheel, problem.obstacle) if c.name == name)
    plan, rng = plan_of(problem, configuration), np.random.default_rng([number, 11])
    scene = step_scene(problem, float(rng.uniform(0.6, 1.0)))
    approach = run_approach(scene, approach_command(problem, plan, rng))
    pose, wheels = reached(approach)
    climb = replace(climb_from(problem, plan, np.zeros(4), rng), step=scene, pose=pose, wheels=wheels)
    recording = record_climb(climb)
    return approach, recording, judge(climb, recording).critical_up


def _trials(part: str) -> list[dict[str, str]]:
    """Rows of all climb trial files that exist."""
    rows = []
    for file in sorted(OUT.glob("climb_*_trials.csv")):
        if "quick" not in file.stem:
            with file.open(newline="", encoding="utf-8") as stream:
                rows += [r for r in csv.DictReader(stream) if r["part"] == part and r["exploded"] == "False"]
    return rows


def climb_rates() -> Figure | None:
    cells = []
    rows = _trials("planned")
    keys = dict.fromkeys((r["engine"], float(r["height"]), r["configuration"], r["source"]) for r in rows)
    for engine, height, name, source in keys:
        mine = [r["critical_up"] == "True" for r in rows
                if (r["engine"], float(r["height"]), r["configuration"], r["source"]) == (engine, height, name, source)]
        cells.append(ClimbCell(engine, height, name, source, sum(mine), len(mine), THESIS_SHARE[name, height]))
    return climb_rates_figure(cells) if cells else None


def phase_map() -> Figure | None:
    rows = [r for r in _trials("phases") if r["engine"] == "mujoco"]
    if not rows:
        return None
    labels = sorted({r["source"] for r in rows}, key=float)
    shares: dict[tuple[str, float], dict[tuple[float, float], list[float]]] = {}
    for r in rows:
        panel = shares.setdefault((r["configuration"], float(r["height"])), {})
        panel.setdefault((float(r["torque"]), float(r["friction"])), [math.nan] * len(labels))
    for panel_key, panel in shares.items():
        for row_key in panel:
            for k, label in enumerate(labels):
                hits = [r["critical_up"] == "True" for r in rows if r["source"] == label and row_key == (
                    float(r["torque"]), float(r["friction"])) and panel_key == (r["configuration"], float(r["height"]))]
                panel[row_key][k] = float(np.mean(hits)) if hits else math.nan
    return phase_map_figure(shares, [float(v) for v in labels])


def endings() -> Figure | None:
    rows = closed_loop.kept(OUT / "closed_loop_mujoco_trials.csv")
    found = {name: np.array([(r.position, r.yaw, r.phase) for r in rows if r.control == name and not r.exploded])
             for name in closed_loop.SETTINGS}
    found = {name: values for name, values in found.items() if len(values)}
    return endings_figure(found, {n: closed_loop.SETTINGS[n][2] for n in found}) if found else None


def all_figures(quick: bool, actuator: dict[str, float | bool]) -> Iterator[tuple[str, Figure]]:
    """(file name, figure) of everything there are data for."""
    from_files: tuple[tuple[str, Callable[[], Figure | None]], ...] = (
        ("climb_rates.png", climb_rates), ("phase_map.png", phase_map), ("closed_loop.png", endings))
    for name, draw in from_files:
        figure = draw()
        if figure is not None:
            yield name, figure
    yield "searches.png", searches(quick, actuator)
    yield "pso_costs.png", costs(quick)
    yield from motions(quick)
