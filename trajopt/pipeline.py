"""The whole on one page: problem -> control points -> path -> timing -> check in physics."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, fold
from trajopt.control.approach import Mode
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.objectives.duration import DurationObjective
from trajopt.objectives.terminal import TerminalObjective, terminal_objective
from trajopt.optimize.base import Budget, Optimizer, OptimizeResult
from trajopt.optimize.search import minimize
from trajopt.paths.path import Path
from trajopt.problem.given_path import PathProblem
from trajopt.problem.search import Problem
from trajopt.robots.actuator import Actuator
from trajopt.simulate.check import ValidationReport, drive_trajectory
from trajopt.timing.nominal import nominal_timing
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory

MARGIN = -1e-9  # least relative margin of a trajectory that keeps its limits


@dataclass(frozen=True, eq=False, repr=False)
class Solution:
    """What ``solve`` found, everything recomputed from the control points.

    ``cost`` and ``terms`` are the objective's, without grid error. ``deviation`` is the final pose
    error (x, y, yaw), ``wheel_deviation`` (W,) the final wheel angle minus the wanted one, folded
    to the period; both are those of ``trajectory``. ``dead_zone_effect`` (W,) is what the drives'
    dead-zone would take from each wheel while the trajectory starts and stops. ``trajectory`` is
    None where no motion keeps the limits; ``infeasible`` then says which limit fails where.
    """

    problem: Problem
    objective: TerminalObjective | DurationObjective
    search: OptimizeResult
    terms: dict[str, float]
    path: Path
    trajectory: Trajectory | None
    infeasible: InfeasibleError | None
    deviation: Array
    wheel_deviation: Array
    dead_zone_effect: Array
    wall_time: float

    def __repr__(self) -> str:
        return (
            f"Solution({self.problem.title!r}, cost={self.cost:.3g}, duration={self.duration:.4g} s, "
            f"holds={self.holds}, optimizer={self.search.optimizer!r})"
        )

    @property
    def cost(self) -> float:
        return self.search.fun

    @property
    def control_points(self) -> Array:
        """(4, 3): x, y (m) and yaw (rad) of start, P1, P2, goal."""
        heading = self.path.heading
        assert heading is not None  # the objective's paths choose their heading
        return np.column_stack([self.path.points, heading])

    @property
    def margins(self) -> dict[str, float]:
        """Least relative margin of each limit on the fine grid; empty without a trajectory."""
        return {} if self.trajectory is None else dict(self.trajectory.margins())

    @property
    def duration(self) -> float:
        """s; NaN without a trajectory."""
        return float("nan") if self.trajectory is None else self.trajectory.duration

    @property
    def evaluations(self) -> int:
        return self.search.nfev

    @property
    def faults(self) -> tuple[str, ...]:
        """Why the solution does not hold, in words; empty when it holds."""
        section, found = self.problem.objective, []
        if self.infeasible is not None:
            found.append(str(self.infeasible))
        for name, error in zip(("x", "y", "yaw"), self.deviation, strict=True):
            if not abs(error) <= section.pose_tolerance:
                found.append(
                    f"final {name} misses by {error:.3g} (tolerance {section.pose_tolerance:g})"
                )
        for name, i in zip(
            self.problem.goal.critical, self.problem.goal.critical_indices, strict=True
        ):
            if not abs(self.wheel_deviation[i]) <= section.wheel_tolerance:
                found.append(
                    f"wheel {name} misses by {self.wheel_deviation[i]:.3g} rad "
                    f"(tolerance {section.wheel_tolerance:g})"
                )
        found += [
            f"limit {name} is broken by {-margin:.1%}"
            for name, margin in self.margins.items()
            if margin < MARGIN
        ]
        return tuple(found)

    @property
    def holds(self) -> bool:
        """Whether pose and critical wheels are within tolerance and every limit is kept."""
        return not self.faults

    @property
    def status(self) -> str:
        """One sentence: the search's status, and what does not hold."""
        return (
            self.search.message
            if self.holds
            else self.search.message + " | " + "; ".join(self.faults)
        )


def solve(
    problem: Problem,
    *,
    optimizer: str | Optimizer = "auto",
    seed: int = 0,
    budget: Budget | None = None,
    x0: ArrayLike | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Solution:
    """Search control points, then time the path.

    Without an actuator the path is time-scaled: as fast as the limits allow, final wheel angles
    untouched. With one (the theses' way) it runs at uniform spline speed in the nominal duration,
    as searched. ``progress(evaluations, best_cost)`` is called during the search. Raises
    ArgumentError for bad arguments.
    """
    started = time.perf_counter()
    if not isinstance(problem, Problem):
        raise ArgumentError(
            "problem", type(problem).__name__, "a Problem (load_problem reads one from a file)"
        )
    terminal = terminal_objective(problem)
    objective = DurationObjective(terminal) if problem.objective.kind == "duration" else terminal
    found = minimize(
        objective,
        terminal.bounds,
        optimizer=optimizer,
        x0=x0,
        seed=seed,
        budget=budget,
        progress=progress,
    )
    path = objective.path(found.x)
    trajectory, infeasible = _timed(terminal, path, found.x)
    deviation, wheels = _final_deviation(terminal, found.x, trajectory)
    return Solution(
        problem,
        objective,
        found,
        objective.terms(found.x),
        path,
        trajectory,
        infeasible,
        deviation,
        wheels,
        _dead_zone_effect(problem, trajectory),
        time.perf_counter() - started,
    )


def time_path(problem: PathProblem, *, engine: str = "auto") -> Trajectory:
    """The fastest motion along a given path, thesis 004's kind of problem.

    Raises InfeasibleError, naming limit and place, where no motion keeps the limits.
    """
    if not isinstance(problem, PathProblem):
        raise ArgumentError(
            "problem", type(problem).__name__, "a PathProblem (load_path_problem reads one)"
        )
    return time_scale(
        problem.spline,
        problem.as_limits(),
        robot=problem.platform,
        ground=problem.terrain,
        engine=engine,
    )


def validate(
    trajectory: Trajectory,
    problem: Problem,
    *,
    engine: str = "pybullet",
    picture: bool = False,
    control: Mode | None = None,
    seed: int = 0,
) -> ValidationReport:
    """Drive a trajectory in a physics engine with real rollers, and measure how far it gets.

    ``engine``: "pybullet" or "mujoco". ``control``: None drives the planned wheel speeds; "wheel
    servo", "pose" or "pose and phase" switch on a servo on the planned wheel angles, feedback of
    the pose, of the pose and the critical wheel angles, with a pose measured with noise drawn from
    ``seed``. Raises MissingDependencyError where the engine is not installed and SimulationError
    where the simulation leaves physics.
    """
    if not isinstance(trajectory, Trajectory):
        raise ArgumentError(
            "trajectory", type(trajectory).__name__, "a Trajectory (solution.trajectory has one)"
        )
    if not isinstance(problem, Problem):
        raise ArgumentError("problem", type(problem).__name__, "the Problem that was solved")
    return drive_trajectory(
        trajectory, problem, engine=engine, picture=picture, control=control, seed=seed
    )


def _timed(
    terminal: TerminalObjective, path: Path, x: Array
) -> tuple[Trajectory | None, InfeasibleError | None]:
    limits = terminal.problem.limits.as_limits()
    try:
        if terminal.actuator.is_ideal:
            return time_scale(path, limits, robot=terminal.robot), None
        duration = float(terminal.control_points(x[:, None]).duration[0, 0])
        return nominal_timing(path, duration, limits, robot=terminal.robot), None
    except InfeasibleError as error:
        return None, error


def _final_deviation(
    terminal: TerminalObjective, x: Array, trajectory: Trajectory | None
) -> tuple[Array, Array]:
    """Final pose error (3,) and folded wheel deviations (W,), rad, of the motion as it will be
    driven."""
    problem = terminal.problem
    if terminal.actuator.is_ideal and trajectory is not None:
        end = trajectory.at(trajectory.duration)
        pose, travel = end.pose[0], end.wheel_angles[0]
    else:
        final = terminal.predict_exactly(x)
        pose = np.array([float(np.squeeze(v)) for v in (final.x, final.y, final.yaw)])
        travel = np.array([float(np.squeeze(v)) for v in final.wheels])
    wheels = np.asarray(problem.start.wheels) + travel - np.asarray(problem.goal.wheels)
    turns = 2 * np.pi * np.round((pose[2] - problem.goal.pose[2]) / (2 * np.pi))
    error = pose - np.array([*problem.goal.pose[:2], problem.goal.pose[2] + turns])
    return error, np.asarray(fold(wheels, problem.objective.period))


def _dead_zone_effect(problem: Problem, trajectory: Trajectory | None) -> Array:
    """(W,): wheel angle that a dead-zone would take away over the trajectory, rad."""
    if trajectory is None:
        return np.full(4, np.nan)
    drive = Actuator(dead_zone=problem.actuator.dead_zone)
    # Equal steps of time; a wheel crosses the dead-zone a few times, each costs at most one step's
    # error.
    times = np.linspace(0.0, trajectory.duration, 20_001)
    speeds = trajectory.at(times).wheel_speeds
    return np.asarray(np.trapezoid(drive.output(speeds) - speeds, times, axis=0))
