"""The whole on one page: problem -> path -> timing -> solution -> check in physics."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.objectives.terminal import terminal_objective
from trajopt.optimize.base import Budget, Optimizer, OptimizeResult
from trajopt.optimize.run import Callback
from trajopt.optimize.search import minimize
from trajopt.paths.path import Path
from trajopt.problem import Problem
from trajopt.problem.extensions import SECTIONS, entry
from trajopt.solution import Solution, search_objective
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory
from trajopt.world.scene import Scene

if TYPE_CHECKING:
    from trajopt.control.approach import Mode
    from trajopt.simulate.check import ValidationReport
    from trajopt.simulate.engine import Engine

# Where no wheel angle counts, every candidate is timed: 5 to 30 ms each. Chosen: within 0.1 % of
# longer searches on a scenario's space.
FREELY, FREE_EVALUATIONS = "slsqp", 400
_REACHES = 2.0  # m around a motion in which maps and borders stand in physics; chosen


def solve(
    problem: Problem,
    *,
    optimizer: str | Optimizer = "auto",
    seed: int = 0,
    budget: Budget | None = None,
    x0: ArrayLike | None = None,
    callback: Callback | None = None,
    state: str | FilePath | None = None,
    progress: Callable[[int, float], None] | None = None,
    engine: str = "auto",
) -> Solution:
    """Do the job of a problem (``problem.job``): search control points and time the path, time a
    given path, find a route, or what the system of a section does.

    ``optimizer``, ``budget``, ``x0``, ``callback``, ``state`` and ``progress(evaluations,
    best_cost)`` are of the search, as in ``minimize`` (auto: exact solutions first, then the best
    there are; 400 evaluations of slsqp where no wheel angle counts),
    ``engine`` of time scaling. Without [actuator] a path is timed as fast as the limits allow, or
    as its [profile] asks; with it, at uniform spline speed in the nominal duration, as searched.
    Limits that no motion keeps are reported, not raised. Raises ArgumentError for bad arguments.
    """
    started = time.perf_counter()
    if not isinstance(problem, Problem):
        raise ArgumentError(
            "problem", type(problem).__name__, "a Problem (load_problem reads one from a file)"
        )
    job = problem.job.name
    if job in SECTIONS:
        asked = None if engine == "auto" else engine
        expected = f"left out for the job '{job}'"
        _refuse(expected, x0=x0, callback=callback, state=state, engine=asked)
        found: Solution = entry(job).solve(
            problem, optimizer=optimizer, seed=seed, budget=budget, progress=progress
        )
    elif job == "path":
        by = None if optimizer == "auto" else optimizer
        expected = "left out: a given path is not searched"
        _refuse(expected, optimizer=by, budget=budget, x0=x0, callback=callback, state=state)
        found = _timed(problem, problem.flat_path, engine)
    elif job == "route":
        by = None if optimizer in ("auto", "ipopt") else optimizer
        expected = "left out: a route has its own search, by ipopt"
        _refuse(expected, optimizer=by, budget=budget, x0=x0, callback=callback, state=state)
        found = _routed(problem, engine)
    else:
        objective = search_objective(problem)
        if optimizer == "auto" and not problem.critical and problem.actuator is None:
            optimizer, budget = FREELY, budget or Budget(FREE_EVALUATIONS)
        searched = minimize(
            objective,
            objective.bounds,
            optimizer=optimizer,
            x0=x0,
            seed=seed,
            budget=budget,
            callback=callback,
            state=state,
            progress=progress,
        )
        found = _timed(problem, objective.path(searched.x), engine, searched)
    return replace(with_details(found), wall_time=time.perf_counter() - started)


def _refuse(expected: str, **given: Any) -> None:
    for name, value in given.items():
        if value is not None:
            raise ArgumentError(name, value, expected)


def with_details(solution: Solution) -> Solution:
    """With what the systems of its problem's sections add."""
    modules = {SECTIONS[section]: section for section in solution.problem.given & set(SECTIONS)}
    for section in modules.values():
        if hasattr(entry(section), "details"):
            solution = replace(solution, details=entry(section).details(solution))
    return solution


def _around(problem: Problem) -> dict[str, Any]:
    """What timing takes besides a path and limits."""
    return {
        "robot": problem.robot,
        "ground": problem.scene.ground,
        "start_wheels": problem.start_wheels,
        "start_steering": problem.start_steering,
    }


def _timed(
    problem: Problem, path: Path, engine: str, searched: OptimizeResult | None = None
) -> Solution:
    """The solution on a path; without a trajectory where no motion keeps the limits."""
    limits = problem.limits
    around = _around(problem)
    try:
        if problem.actuator is not None and searched is not None:
            if engine != "auto":
                raise ArgumentError("engine", engine, "auto with [actuator]: nothing is scaled")
            from trajopt.timing.nominal import nominal_timing

            terminal = terminal_objective(problem)
            duration = float(terminal.control_points(searched.x[:, None]).duration[0, 0])
            timed = nominal_timing(path, duration, limits, **around)
        elif problem.profile is not None:
            if engine != "auto":
                raise ArgumentError("engine", engine, "auto with [profile]")
            from trajopt.refine.profile import follow

            bound, manner = problem.profile.bound, problem.profile.manner
            timed = follow(path, bound, limits, manner=manner, **around).trajectory
        else:
            stops = () if problem.path_section is None else problem.path_section.stops
            timed = time_scale(path, limits, engine=engine, stops=stops, **around)
    except InfeasibleError as error:
        return Solution(problem, path, None, error, searched)
    return Solution(problem, timed.path, timed, None, searched)


def _routed(problem: Problem, engine: str) -> Solution:
    """The best route found; without a trajectory where none is."""
    from trajopt.routes.plan import plan_route

    start, goal, timing = problem.start, problem.goal, _around(problem)
    assert start is not None
    assert start.pose is not None
    assert goal is not None
    route = plan_route(
        timing.pop("robot"),
        problem.scene,
        start.pose,
        goal.pose,
        problem.limits,
        clearance=problem.limits_section.clearance or 0.0,
        aim=problem.aim,
        timing={**timing, "engine": engine},
    )
    best = route.best
    if best is None or best.trajectory is None:
        return Solution(problem, None, None, refused=(route.refused,), route=route)
    return Solution(problem, best.trajectory.path, best.trajectory, route=route)


def validate(
    trajectory: Trajectory,
    where: Scene | Problem,
    *,
    engine: str | Engine = "auto",
    picture: bool = False,
    control: Mode | None = None,
    seed: int = 0,
) -> ValidationReport:
    """Drive the trajectory's robot in a physics engine, and measure how far it gets and what it
    touches.

    ``where``: the scene to drive in, or the problem that was solved, which also says which wheel
    angles count at the end. ``engine``: "mujoco", "pybullet", or "auto" for what is installed.
    ``control``: None drives the planned wheel speeds; "wheel servo", "pose" or "pose and phase"
    switch on a servo on the planned wheel angles, feedback of the pose, of the pose and the
    critical wheel angles, with a pose measured with noise drawn from ``seed``. Raises
    ArgumentError for what cannot be driven there, MissingDependencyError where the engine is not
    installed and SimulationError where the simulation leaves physics.
    """
    from trajopt.simulate.check import validate as check

    if not isinstance(trajectory, Trajectory):
        raise ArgumentError(
            "trajectory", type(trajectory).__name__, "a Trajectory (solution.trajectory has one)"
        )
    if not isinstance(where, Scene | Problem):
        raise ArgumentError(
            "where", type(where).__name__, "a Scene, or the Problem that was solved"
        )
    task = where if isinstance(where, Problem) else None
    scene = where if isinstance(where, Scene) else where.scene
    places = trajectory.path.position(trajectory.u)[:, :2]
    return check(
        trajectory,
        scene.around(places, _REACHES),
        engine=engine,
        picture=picture,
        control=control,
        critical=() if task is None else task.critical_indices,
        seed=seed,
    )
