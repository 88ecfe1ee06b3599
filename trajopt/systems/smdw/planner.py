"""From an obstacle to ranked plans: exact paths to the target of every configuration, timing.

Among the control points that end exactly in the pose and with the wheel angles of a configuration's
target, the planner takes those whose footprint stays on free ground and times the most promising
ones.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, TypedDict, Unpack

import numpy as np

from trajopt.arrays import Array, fold
from trajopt.errors import InfeasibleError
from trajopt.objectives.clearance import ClearObjective
from trajopt.objectives.terminal import TerminalObjective
from trajopt.optimize.base import Budget, Optimizer
from trajopt.optimize.run import Progress
from trajopt.optimize.search import minimize
from trajopt.paths.path import Path
from trajopt.problem import Problem
from trajopt.systems.smdw.configurations import (
    Configuration,
    Target,
    approach_target,
    configurations_of,
)
from trajopt.systems.smdw.entry import free_ground, start_pose, step_of
from trajopt.systems.smdw.exact_paths import exact_candidates
from trajopt.timing.compiled import load_kernel
from trajopt.timing.scaling import rough_duration, time_scale
from trajopt.timing.trajectory import Trajectory
from trajopt.world.free_ground import path_margin

TIMED_CANDIDATES = 2  # paths that are time-scaled for each configuration, chosen
RANKING_GRID = (
    40  # gridpoints of the time scaling that ranks candidates, chosen; plans get the default grid
)
# Share of trials with both leading wheels up: MuJoCo, friction 0.6-1, 8 N m, wheel angles at the
# window's middle with errors of 3 mm, 0.5 deg, 0.05 rad: 20 of 20 for each (lateral), 40 of 40
# (forward 35 and 45 deg); benchmarks/theses/climb.py. Written as (successes + 1)/(trials + 2), so
# that no rate is certain.
CLIMB_RATES = {
    (False, 0.035): 41 / 42,
    (False, 0.05): 41 / 42,
    (True, 0.035): 21 / 22,
    (True, 0.05): 21 / 22,
}


@dataclass(frozen=True, eq=False)
class Plan:
    """One configuration with its exact, timed path; everything recomputed from the path.

    ``wheel_error``: largest error (rad) of a critical wheel at the end. ``room``: least distance
    (m) of the footprint from the borders and the step along the whole path. ``margin`` (rad): half
    width of the window of angles that climb. ``climb_rate``: measured share of trials that climb.
    """

    configuration: Configuration
    target: Target
    problem: Problem
    control_points: Array
    path: Path
    trajectory: Trajectory
    wheel_error: float
    room: float
    margin: float
    climb_rate: float

    @property
    def duration(self) -> float:
        """Of the approach, s."""
        return self.trajectory.duration


@dataclass(frozen=True)
class Refused:
    """A configuration without a plan, and why."""

    configuration: Configuration
    reason: str


@dataclass(frozen=True, eq=False)
class Maneuver:
    """Plans, best first, and the configurations that were refused; ``wall_time`` (s) for all of it
    but the loading of compiled kernels, once a process."""

    problem: Problem
    plans: tuple[Plan, ...]
    refused: tuple[Refused, ...]
    wall_time: float

    @property
    def faults(self) -> tuple[str, ...]:
        """None: a manoeuvre without a plan has no path either, and that is said already."""
        return ()

    @property
    def notes(self) -> dict[str, Any]:
        """Plans and refused configurations, for a summary."""
        plans = {
            plan.configuration.name: {
                "duration_s": plan.duration,
                "room_m": plan.room,
                "phase_margin_rad": plan.margin,
                "climb_rate": plan.climb_rate,
            }
            for plan in self.plans
        }
        return {"plans": plans, "refused": {r.configuration.name: r.reason for r in self.refused}}

    def save(self, folder: FilePath, *, pictures: str | None) -> None:
        """Pictures of all plans and of the wheel's geometry."""
        if pictures:
            from trajopt.systems.smdw.pictures import save_maneuver_pictures

            save_maneuver_pictures(self, folder, pictures)

    @property
    def status(self) -> str:
        """One sentence."""
        if self.plans:
            best = self.plans[0]
            return (
                f"{len(self.plans)} of {len(self.plans) + len(self.refused)} configurations have a plan; best by "
                f"{self.problem.climb.rank}: {best.configuration.name}, {best.duration:.2f} s"
            )
        first, others = self.refused[0], len(self.refused) - 1
        more = f" ({others} other configurations have none either)" if others else ""
        return f"no configuration has a plan; {first.configuration.name}: {first.reason}{more}"


class Search(TypedDict, total=False):
    """What ``minimize`` is asked for, where it is the one to search."""

    seed: int
    budget: Budget | None
    progress: Progress | None


def search_problem(problem: Problem, configuration: Configuration, target: Target) -> Problem:
    """The terminal problem of one configuration: goal and critical wheels filled in. Raises
    ProblemError."""
    goal = {"pose": target.pose, "wheels": target.wheels, "critical": configuration.critical}
    return problem.replace(
        {
            "title": f"{problem.title}: {configuration.name}",
            "climb": None,
            "goal": goal,
            "spline": {"free": ["p1", "p2"]},
        }
    )


def plan_climb(
    problem: Problem, *, optimizer: str | Optimizer = "lattice", **search: Unpack[Search]
) -> Maneuver:
    """Plans for every configuration that can climb the obstacle, ranked by
    ``problem.climb.rank``.

    ``optimizer``: "lattice" looks through all exact solutions; any other searches P1 and P2 with
    footprint and wheel angles judged together (its wheel errors are what it finds). Raises
    ArgumentError for a step too high.
    """
    load_kernel()  # libraries load once a process; that is no part of planning
    started = time.perf_counter()
    plans: list[Plan] = []
    refused: list[Refused] = []
    for configuration in configurations_of(problem):
        outcome = plan_configuration(problem, configuration, optimizer=optimizer, **search)
        if isinstance(outcome, Plan):
            plans.append(outcome)
        else:
            refused.append(outcome)
    keys = {
        "duration": lambda p: p.duration,
        "margin": lambda p: (-p.margin, p.duration),
        "climb_rate": lambda p: (-p.climb_rate, p.duration),
    }
    plans.sort(key=keys[problem.climb.rank])
    return Maneuver(problem, tuple(plans), tuple(refused), time.perf_counter() - started)


def plan_configuration(
    problem: Problem,
    configuration: Configuration,
    *,
    optimizer: str | Optimizer = "lattice",
    target: Target | None = None,
    **search: Unpack[Search],
) -> Plan | Refused:
    """Plan of one configuration (to ``target`` instead of its own where given), or why there is
    none."""
    target = approach_target(problem, configuration) if target is None else target
    ground = free_ground(problem)
    complaint = ground.complaint(*target.pose)
    if complaint:
        return Refused(configuration, f"the space is too small: at the target {complaint}")
    if abs(target.pose[2] - start_pose(problem)[2]) < 1e-3:
        return Refused(
            configuration,
            "no turn between start and target, so wheel angles cannot be chosen: turn first",
        )
    made = search_problem(problem, configuration, target)
    objective = ClearObjective(TerminalObjective(made, made.robot), ground)
    if optimizer == "lattice":
        objective, candidates = exact_candidates(objective, lateral=configuration.motion.lateral)
    else:
        found = minimize(objective, objective.bounds, optimizer=optimizer, **search)
        candidates = found.x[None]
    if len(candidates) == 0:
        return Refused(
            configuration,
            "the space is too small: no path with exact wheel angles keeps the footprint "
            "inside it and before the step",
        )
    return _fastest(problem, configuration, target, objective, candidates)


def _fastest(
    problem: Problem,
    configuration: Configuration,
    target: Target,
    objective: ClearObjective,
    candidates: Array,
) -> Plan | Refused:
    """The fastest of the most promising candidates, after checks on the fine grid."""
    reason = "every exact path leaves the free ground between the points of the search grid"
    timed: list[tuple[float, Path]] = []
    limits, robot = problem.limits, problem.robot
    for candidate in candidates[:TIMED_CANDIDATES]:
        path = objective.path(candidate)
        if path_margin(path, objective.ground) < 0:
            continue
        try:
            timed.append((rough_duration(path, limits, robot=robot, gridpoints=RANKING_GRID), path))
        except InfeasibleError as error:
            reason = str(error)
    for _, path in sorted(timed, key=lambda t: t[0]):
        try:
            trajectory = time_scale(path, limits, robot=robot, start_wheels=problem.start_wheels)
        except InfeasibleError as error:
            reason = str(error)
            continue
        made = objective.terminal.problem
        errors = trajectory.at(trajectory.duration).wheel_angles[0] - np.array(target.wheels)
        critical = fold(errors, made.objective.period)[list(made.critical_indices)]
        assert path.heading is not None  # the objective's paths choose their heading
        return Plan(
            configuration,
            target,
            made,
            np.column_stack([path.points, path.heading]),
            path,
            trajectory,
            float(np.max(np.abs(critical))),
            path_margin(path, objective.ground),
            configuration.window.half_width,
            predicted_climb_rate(configuration, step_of(problem).height),
        )
    return Refused(configuration, reason)


def predicted_climb_rate(configuration: Configuration, height: float) -> float:
    """Share of trials that climb, interpolated over step height between the measured ones."""
    heights = sorted(h for lateral, h in CLIMB_RATES if lateral == configuration.motion.lateral)
    rates = [CLIMB_RATES[configuration.motion.lateral, h] for h in heights]
    return float(np.interp(height, heights, rates))
