"""Searches of the SMDW reproduction page: the thesis's two swarms and the exact planner, in numbers
and pictures.

Counterparts of [guzman2015]: Figures 5.15-5.22 (swarms), 5.23-5.25 (paths over time interval), 6.5
and 6.12 (cost over the place of P2).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from benchmarks.common import PROBLEMS
from benchmarks.theses.smdw_search_pictures import (
    CostMap,
    SwarmSearch,
    cost_maps_figure,
    costs_figure,
    searches_figure,
    swarms_figure,
)
from trajopt.arrays import Array, fold
from trajopt.objectives.terminal import TerminalObjective, terminal_objective
from trajopt.optimize.base import Budget, OptimizeResult
from trajopt.optimize.search import minimize
from trajopt.paths.path import Path as RobotPath
from trajopt.problem import Problem, load_problem
from trajopt.systems.smdw.thesis import through_drives

# rad/s, fitted to Table 5.5 (loosely): what the thesis's drives seem to have done
ACTUATOR = {"saturation": 43.0, "dead_zone": 2.8}
GAINS, BETA = np.array([3.0, 0.125, 2.5]), 12.5  # Table 5.8
FIRST_GAINS, FIRST_BETA = np.array([1.0, 0.125, 1.0]), 10.0  # Table 5.2: all four wheels count
PSO = "pso-thesis-enhanced"
SWARM_ITERATIONS = 500  # of the thesis's PSO
LONG_ITERATIONS = 5000  # Figure 5.19
PARTICLES = 50  # of the thesis's PSO
CONFIGURATIONS = ("lateral", "forward35", "forward45")  # of Tables 6.1 and 6.6
OUTSIDE = 1e6  # cost of particles outside the space, above all others; chosen
GRID = 121  # places of P2 a side of a cost map
VIEW = (
    (-1.5, 3.5),
    (-2.5, 2.5),
)  # m, part of the ground around the space of Table 5.3 that is drawn


def table_5_3(duration: float, *free: str) -> Problem:
    """The test problem of Table 5.3 through the thesis's actuators; ``free`` control values,
    default P2."""
    changes = {"actuator": {"duration": duration, **ACTUATOR}}
    problem = load_problem(PROBLEMS / "smdw" / "table_5_3.toml", changes)
    return problem.replace({"spline.free": list(free)}) if free else problem


def search_5_3(
    duration: float, optimizer: str, seed: int
) -> tuple[TerminalObjective, OptimizeResult]:
    """The thesis's PSO moves P2; the exact planner P1, P2 and the heading."""
    objective = terminal_objective(
        table_5_3(duration, *(("p1", "p2", "heading") if optimizer == "lattice" else ()))
    )
    return objective, minimize(objective, objective.bounds, optimizer=optimizer, seed=seed)


def first_objective() -> tuple[TerminalObjective, Array]:
    """Table 5.3 at 5 s as the first implementation sees it, and its fixed values; those of P2 are
    left at 0.

    Values are x, y of P1 (Table 5.2), x, y of P2, and the yaws of both: the swarm moves P2 in x, y
    and yaw.
    """
    objective = terminal_objective(table_5_3(5.0, "p1", "p2", "heading"))
    start, goal = (
        np.array(state.pose) for state in (objective.problem.start, objective.problem.goal)
    )
    low, high = objective.problem.space.y
    return objective, np.array(
        [
            start[0] + (goal[0] - start[0]) / 4,
            start[1] - np.sign(start[1]) * (high - low) / 4,
            0.0,
            0.0,
            (goal[2] - start[2]) / 3,
            0.0,
        ]
    )


def first_swarm_cost(
    objective: TerminalObjective, fixed: Array, bounds: Array, candidates: Array
) -> Array:
    """Costs (n,) of P2 (n, 3); particles outside the bounds never count, so theirs are not worked
    out."""
    inside = np.all((candidates >= bounds[:, 0]) & (candidates <= bounds[:, 1]), axis=1)
    cost = np.full(len(candidates), OUTSIDE)
    if inside.any():
        cost[inside] = first_cost(objective, first_values(fixed, candidates[inside]))
    return cost


def first_values(fixed: Array, candidates: Array) -> Array:
    """(n, 6) values from x, y, yaw of P2 (n, 3)."""
    values = np.repeat(fixed[None], len(candidates), axis=0)
    values[:, [2, 3, 5]] = candidates
    return values


def first_cost(objective: TerminalObjective, values: Array) -> Array:
    """Table 4.4 with the gains of Table 5.2, which count all four wheels: (n,) for values (n,
    6)."""
    end = objective.predict(values.T)
    pose = np.concatenate([end.x, end.y, end.yaw]).T - np.array(objective.problem.goal.pose)
    wheels = np.concatenate(end.wheels).T - np.array(objective.problem.goal.wheels)
    return np.asarray(np.abs(pose) @ FIRST_GAINS + FIRST_BETA * np.abs(fold(wheels)).sum(axis=1))


@dataclass(frozen=True, eq=False)
class Swarms:
    """Costs of the first implementation's searches and of the enhanced one's, and the picture of
    what they explored."""

    first: list[float]
    enhanced: list[float]
    figure: Figure


def swarms(quick: bool) -> Swarms:
    """Figures 5.15-5.22: the thesis's two implementations at 5 s, and the first with ten times the
    iterations."""
    objective, fixed = first_objective()
    space = objective.problem.space.x, objective.problem.space.y
    bounds = np.array([*space, (objective.problem.start.pose[2], objective.problem.goal.pose[2])])
    first, enhanced, shown = [], [], []
    runs = [(f"5.{15 + seed}", seed, SWARM_ITERATIONS) for seed in range(1 if quick else 4)]
    for number, seed, iterations in (
        *runs,
        ("5.19", 0, SWARM_ITERATIONS if quick else LONG_ITERATIONS),
    ):
        found = minimize(
            lambda c: first_swarm_cost(objective, fixed, bounds, c),
            bounds,
            seed=seed,
            optimizer="pso-thesis-first",
            budget=Budget(evaluations=PARTICLES * iterations),
        )
        path = objective.path(first_values(fixed, found.x[None])[0])
        shown.append(
            SwarmSearch(
                f"{number}: first, seed {seed}\n{iterations} iterations, cost {found.fun:.3g}",
                found.history.samples[:, :2],
                places(path),
                found.x[:2],
            )
        )
        first.append(found.fun)
    for seed in range(1 if quick else 3):
        enhanced_objective, found = search_5_3(5.0, PSO, seed)
        shown.append(
            SwarmSearch(
                f"5.{20 + seed}: enhanced, seed {seed}\n{SWARM_ITERATIONS} iterations, "
                f"cost {found.fun:.3g}",
                found.history.samples,
                places(enhanced_objective.path(found.x)),
                found.x,
            )
        )
        enhanced.append(found.fun)
    return Swarms(first[: len(runs)], enhanced, swarms_figure(shown, space, VIEW))


def places(path: RobotPath) -> Array:
    return path.position(np.linspace(path.start, path.end, 200))[:, :2]


def searches(quick: bool) -> Figure:
    """Figures 5.23-5.25: paths that the thesis's PSO and the exact planner find over the time
    interval."""
    intervals = (1.0, 5.0) if quick else tuple(0.5 * k for k in range(1, 15))
    goal = np.array(table_5_3(1.0).goal.pose[:2])

    def found(duration: float, optimizer: str, seed: int) -> Array:
        objective, best = search_5_3(duration, optimizer, seed)
        return places(objective.path(best.x))

    def named(duration: float, optimizer: str) -> tuple[str, Array]:
        path = found(duration, optimizer, 0)
        return f"{duration:g} s: {np.linalg.norm(np.diff(path, axis=0), axis=1).sum():.2f} m", path

    return searches_figure(
        [
            (
                "5.23: its PSO over the time interval",
                [(f"{t:g} s", found(t, PSO, 0)) for t in intervals],
            ),
            (
                "5.24: its PSO, 1 s, ten seeds",
                [(f"{n}", found(1.0, PSO, n)) for n in range(2 if quick else 10)],
            ),
            ("5.25: its PSO, 1 s and 5 s", [named(t, PSO) for t in (1.0, 5.0)]),
            ("5.25: exact planner, 1 s and 5 s", [named(t, "lattice") for t in (1.0, 5.0)]),
        ],
        goal,
    )


def scenario_searches(quick: bool) -> Iterator[tuple[str, Figure]]:
    """Figures 6.5 and 6.12: cost over the place of P2, with the ends of the thesis's PSO; its cost
    over iterations."""
    panels, maps = [], []
    for number in (1, 2):
        for name in CONFIGURATIONS:
            file = PROBLEMS / "smdw" / f"scenario_{number}_{name}.toml"
            problem = through_drives(load_problem(file))
            objective = terminal_objective(problem)
            found = [
                minimize(objective, objective.bounds, optimizer=PSO, seed=seed)
                for seed in range(2 if quick else 10)
            ]
            panels.append(
                (
                    f"scenario {number}, {name}",
                    [
                        (
                            np.append(f.history.evaluations / PARTICLES, SWARM_ITERATIONS),
                            np.append(f.history.cost, f.history.cost[-1]),
                        )
                        for f in found
                    ],
                )
            )
            x, y = (np.linspace(low, high, GRID) for low, high in objective.bounds)
            ground = np.stack(np.meshgrid(x, y), axis=-1)
            cost = objective.evaluate(ground.reshape(-1, 2)).cost.reshape(ground.shape[:2])
            maps.append(
                CostMap(
                    f"{'6.5' if number == 1 else '6.12'}: scenario {number}, {name}",
                    x,
                    y,
                    cost,
                    np.array([f.x for f in found]),
                )
            )
    yield "cost_maps.png", cost_maps_figure(maps)
    yield "pso_costs.png", costs_figure(panels)
