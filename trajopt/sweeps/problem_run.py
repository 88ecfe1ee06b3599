"""The run function of sweeps over problem files: change the problem, solve it, and drive it where
asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt.errors import ArgumentError
from trajopt.problem.search import Problem
from trajopt.sweeps.cases import Case
from trajopt.systems.smdw.problem import ManeuverProblem

if TYPE_CHECKING:
    from trajopt.pipeline import Solution
    from trajopt.simulate.check import ValidationReport

RUN_NAMES = ("run.optimizer", "run.seed", "run.engine", "run.evaluations")
ENGINES = ("none", "pybullet", "mujoco")


@dataclass(frozen=True)
class SolveOptions:
    """How problems are solved: ``optimizer``, budget in ``evaluations`` (0: the default), and the
    physics ``engine`` that drives the result ("none": it is not driven)."""

    optimizer: str = "auto"
    evaluations: int = 0
    engine: str = "none"

    def __post_init__(self) -> None:
        if self.engine not in ENGINES:
            raise ArgumentError("solve.engine", self.engine, "one of " + ", ".join(ENGINES))
        if self.evaluations < 0:
            raise ArgumentError("solve.evaluations", self.evaluations, "a whole number >= 0")


@dataclass(frozen=True)
class ProblemRun:
    """Solves ``problem`` with a case's values put in.

    Names with a dot are keys of the problem, except ``run.optimizer``, ``run.seed``, ``run.engine``
    and ``run.evaluations``; without ``run.seed`` the case's own seed is used. Names without a dot
    are left alone.
    """

    problem: Problem
    options: SolveOptions

    def __call__(self, case: Case) -> dict[str, Any]:
        solution = self.solution(case)
        row: dict[str, Any] = {
            "cost": solution.cost,
            "terms": solution.terms,
            "evaluations": solution.evaluations,
            "holds": solution.holds,
            "faults": "; ".join(solution.faults),
            "search": solution.search.status,
            "margins": solution.margins,
            "pose_error": np.asarray(solution.deviation).tolist(),
            "wheel_error": np.asarray(solution.wheel_deviation).tolist(),
            "control_points": solution.control_points,
        }
        if solution.trajectory is not None:
            row["duration"] = solution.trajectory.duration
        report = self.driven(case, solution)
        if report is not None:
            row["driven"] = {
                "along": report.along,
                "across": report.across,
                "yaw": report.yaw,
                "wheel_error": np.asarray(report.wheel_deviation).tolist(),
                "path_rms": report.path_rms,
                "path_max": report.path_max,
            }
            row["driven_pose"] = report.recording.pose
            row["driven_times"] = report.recording.times
        return row

    def seed(self, case: Case) -> int:
        """The seed with which a case is solved."""
        return int(case.values.get("run.seed", case.seed))

    def solution(self, case: Case) -> Solution:
        """The solved problem of a case; every call finds the same."""
        from trajopt.optimize.base import Budget
        from trajopt.pipeline import solve

        evaluations = int(case.values.get("run.evaluations", self.options.evaluations))
        return solve(
            self.problem.replace(changes(case.values)),
            seed=self.seed(case),
            optimizer=str(case.values.get("run.optimizer", self.options.optimizer)),
            budget=Budget(evaluations=evaluations) if evaluations else None,
        )

    def driven(self, case: Case, solution: Solution) -> ValidationReport | None:
        """The solution in physics; None where the case has no engine, or the solution no
        trajectory."""
        from trajopt.pipeline import validate

        engine = str(case.values.get("run.engine", self.options.engine))
        if engine == "none" or solution.trajectory is None:
            return None
        return validate(solution.trajectory, solution.problem, engine=engine)


def changes(values: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a case that are keys of a problem."""
    return {k: v for k, v in values.items() if "." in k and k not in RUN_NAMES}


@dataclass(frozen=True)
class WithProblem:
    """A user's function of case and problem, as a run function."""

    function: Callable[[Case, Any], Any]
    problem: Problem | ManeuverProblem

    def __call__(self, case: Case) -> Any:
        return self.function(case, self.problem.replace(changes(case.values)))
