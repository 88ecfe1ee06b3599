"""What ``solve`` found, recomputed from path and trajectory."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from trajopt.arrays import Array, fold
from trajopt.errors import InfeasibleError
from trajopt.limits.torques import knows_torques
from trajopt.objectives.clearance import ClearObjective
from trajopt.objectives.duration import DurationObjective
from trajopt.objectives.terminal import TerminalObjective, terminal_objective
from trajopt.optimize.base import OptimizeResult
from trajopt.paths.path import Path
from trajopt.problem import Problem
from trajopt.shown import Shown
from trajopt.timing.trajectory import Trajectory
from trajopt.world.crossing import Standing, crossings

if TYPE_CHECKING:
    from trajopt.routes.plan import Route
    from trajopt.world.clearance import Clearance

SearchObjective = TerminalObjective | DurationObjective | ClearObjective
MARGIN = -1e-9  # least relative margin of a trajectory that keeps its limits
CLEARANCE = 1e-6  # m of clearance that is rounding


class Details(Protocol):
    """What the system of a section adds to a solution."""

    @property
    def faults(self) -> tuple[str, ...]:
        """What does not hold."""
        ...

    @property
    def notes(self) -> dict[str, Any]:
        """Facts for the summary, units in their names."""
        ...

    def save(self, folder: FilePath, *, pictures: str | None) -> None:
        """Write files of its own into a run folder, ``pictures`` in this format."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class Solution(Shown):
    """What ``solve`` found; everything said of it is recomputed from path and trajectory.

    ``trajectory`` is None where no motion keeps the limits (``infeasible`` says which fails where)
    or there is no path (``refused`` says why). ``search`` is that of the control points, where they
    were searched. ``alternatives`` are other solutions, best first; ``details`` is what the system
    of a section of its own adds. ``route`` holds the ways that were tried, where one was searched.
    """

    problem: Problem
    path: Path | None
    trajectory: Trajectory | None
    infeasible: InfeasibleError | None = None
    search: OptimizeResult | None = None
    refused: tuple[str, ...] = ()
    alternatives: tuple[Solution, ...] = ()
    details: Details | None = None
    route: Route | None = None
    wall_time: float = field(default=0.0, compare=False)

    def __repr__(self) -> str:
        return (
            f"Solution({self.problem.title!r}, cost={self.cost:.3g}, "
            f"duration={self.duration:.4g} s, holds={self.holds})"
        )

    @cached_property
    def objective(self) -> SearchObjective:
        """What was searched for. Raises ArgumentError where nothing was."""
        return search_objective(self.problem)

    @cached_property
    def terms(self) -> dict[str, float]:
        """Terms of the cost by name, without grid error."""
        if self.problem.job.name == "route" and self.path is not None:
            return {"duration": self.duration, "length": self.path.length}
        if self.search is None:
            return {"duration": self.duration}
        return self.objective.terms(self.search.x)

    @property
    def cost(self) -> float:
        """Of the search; of a route what it was chosen by; else the duration, s."""
        if self.problem.job.name == "route" and self.problem.aim == "length":
            return float("nan") if self.path is None else self.path.length
        return self.duration if self.search is None else self.search.fun

    @property
    def duration(self) -> float:
        """s; NaN without a trajectory."""
        return float("nan") if self.trajectory is None else self.trajectory.duration

    @cached_property
    def energy(self) -> float:
        """Work of the motors, J (``Trajectory.energy``); NaN without a trajectory, or where torques
        are not known."""
        if self.trajectory is None or not knows_torques(self.problem.robot):
            return float("nan")
        return self.trajectory.energy

    @property
    def evaluations(self) -> int:
        return 0 if self.search is None else self.search.nfev

    @property
    def control_points(self) -> Array:
        """(K, 3): x, y (m) and yaw (rad) of the points that a spline is laid through; yaw NaN along
        the path. None of them where there is no spline, or several."""
        path = self.problem.flat_path if self.problem.job.name == "path" else self.path
        if path is None or (not path.plain and self.problem.job.name == "path"):
            return np.zeros((0, 3))
        points, heading = path.points[:, :2], path.heading
        yaw = np.full(len(points), np.nan) if heading is None else heading[: len(points)]
        return np.column_stack([points, yaw])

    @property
    def margins(self) -> dict[str, float]:
        """Least relative margin of each limit on the fine grid; empty without a trajectory."""
        return {} if self.trajectory is None else dict(self.trajectory.margins())

    @cached_property
    def _final(self) -> tuple[Array, Array]:
        """Pose (3,) and wheel angles (W,) at the end of the motion as it will be driven."""
        if self.trajectory is not None and self.problem.actuator is None:
            end = self.trajectory.at(self.trajectory.duration)
            return end.pose[0], end.wheel_angles[0]
        assert self.search is not None  # only asked for where a goal was searched
        terminal = terminal_objective(self.problem)
        final = terminal.predict_exactly(self.search.x)
        pose = np.array([float(np.squeeze(v)) for v in (final.x, final.y, final.yaw)])
        turned = np.array([float(np.squeeze(v)) for v in final.wheels])
        return pose, self.problem.start_wheels + turned

    @property
    def _reaches(self) -> bool:
        """Whether there is a motion to the goal."""
        return self.search is not None or (
            self.problem.job.name == "route" and self.trajectory is not None
        )

    @property
    def deviation(self) -> Array:
        """(3,): final x, y (m), yaw (rad) less the goal's; (0,) where nothing was searched."""
        goal = self.problem.goal
        if goal is None or not self._reaches:
            return np.zeros(0)
        error = self._final[0] - np.array(goal.pose)
        return np.array([*error[:2], fold(error[2])])

    @property
    def wheel_deviation(self) -> Array:
        """(W,): final wheel angle less the wanted one, folded to the period, rad; (0,) where none
        was wanted."""
        goal = self.problem.goal
        if goal is None or goal.wheels is None or self.search is None:
            return np.zeros(0)
        error = self._final[1] - np.array(goal.wheels)
        return np.asarray(fold(error, self.problem.objective.period))

    @cached_property
    def faults(self) -> tuple[str, ...]:
        """Why the solution does not hold, in words; empty when it holds."""
        found = [*self.refused, *self._goal_faults()]
        if self.infeasible is not None:
            found.append(str(self.infeasible))
        found += [
            f"limit {name} is broken by {-margin:.1%}"
            for name, margin in self.margins.items()
            if margin < MARGIN
        ]
        found += self._crossing_faults()
        found += () if self.details is None else self.details.faults
        if self.problem.infeasible is not None and not found:
            found.append(
                f"it holds, but the problem says that none does: {self.problem.infeasible}"
            )
        return tuple(found)

    def _goal_faults(self) -> list[str]:
        section, found = self.problem.objective, []
        names = ("x", "y", "yaw")[: len(self.deviation)]
        for name, error in zip(names, self.deviation, strict=True):
            if not abs(error) <= section.pose_tolerance:
                found.append(
                    f"final {name} misses by {error:.3g} (tolerance {section.pose_tolerance:g})"
                )
        if len(self.wheel_deviation):
            for name, i in zip(self.problem.critical, self.problem.critical_indices, strict=True):
                if not abs(self.wheel_deviation[i]) <= section.wheel_tolerance:
                    found.append(
                        f"wheel {name} misses by {self.wheel_deviation[i]:.3g} rad "
                        f"(tolerance {section.wheel_tolerance:g})"
                    )
        return found

    def _crossing_faults(self) -> list[str]:
        if self.path is None:
            return []
        spline, advice = self.problem.spline, ""
        if spline is not None:
            more = [name for name in ("p1", "p2", "heading") if name not in spline.free]
            advice = "; more room to choose: spline.free with " + ", ".join(more) if more else ""
        robot, scene = self.problem.robot, self.problem.scene
        keeps = self.problem.limits_section.clearance
        if keeps is not None or scene.map is not None or scene.space is not None:
            near = self.clearance
            if near is None or near.distance >= (keeps or 0.0) - CLEARANCE:
                return []
            return [str(near) + (f"; limits.clearance is {keeps:g} m" if keeps else "")]
        return [
            f"{crossing}{advice}"
            for crossing in crossings(self.path, robot.footprint, scene.obstacles)
        ]

    @cached_property
    def clearance(self) -> Clearance | None:
        """How near the outline comes to what it keeps out of, along the whole path; None without a
        path."""
        if self.path is None:
            return None
        from trajopt.world.clearance import path_clearance

        return path_clearance(self.path, self.problem.robot.footprint, self.problem.scene.keep_out)

    @property
    def holds(self) -> bool:
        """Whether the goal is met, every limit is kept and the outline keeps clear."""
        return not self.faults

    @property
    def status(self) -> str:
        """One sentence: how it was found, and what does not hold."""
        found = "timed" if self.search is None else self.search.message
        if self.route is not None and self.route.best is not None:
            found = str(self.route)
        known = self.problem.infeasible
        expected = [f"as the problem says: {known}"] if known and self.faults else []
        return " | ".join([found, *filter(None, ["; ".join(self.faults)]), *expected])


def search_objective(problem: Problem) -> SearchObjective:
    """What the control points of a problem are searched for; with obstacles, clear of them."""
    terminal = terminal_objective(problem)
    kind = problem.objective.kind
    duration = DurationObjective(terminal, kind) if kind in ("duration", "energy") else None
    obstacles = problem.scene.obstacles
    if not obstacles:
        return terminal if duration is None else duration
    ground = Standing(problem.robot.footprint, obstacles)
    return ClearObjective(terminal, ground, duration=duration)
