"""Cases of sweeps over problem files: the problem with a case's values put in, solved, driven in
physics where asked, and told as a row.

``trajopt.sweeps`` imports nothing of this; it finds ``run_case`` and ``with_problem`` by name.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, fields
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.errors import ArgumentError
from trajopt.optimize.base import Budget
from trajopt.pipeline import solve, validate
from trajopt.problem import Problem, load_problem
from trajopt.simulate.check import ValidationReport
from trajopt.solution import Solution
from trajopt.sweeps.cases import Case
from trajopt.world.occupancy import parts_of

ENGINES = ("none", "pybullet", "mujoco")


@dataclass(frozen=True)
class CaseOptions:
    """How ``run_case`` solves a case: its values ``run.optimizer``, ``run.evaluations`` (budget, 0:
    the default), ``run.engine`` (physics that drives the result; "none": it is not driven) and
    ``run.seed`` (None: the case's own)."""

    optimizer: str = "auto"
    evaluations: int = 0
    engine: str = "none"
    seed: int | None = None

    def __post_init__(self) -> None:
        if self.engine not in ENGINES:
            raise ArgumentError("run.engine", self.engine, "one of " + ", ".join(ENGINES))
        if not isinstance(self.optimizer, str):
            raise ArgumentError("run.optimizer", self.optimizer, "the name of an optimizer")
        for name in ("evaluations", "seed"):
            value = getattr(self, name)
            whole = isinstance(value, (int, float)) and value >= 0 and value == int(value)
            if value is not None and (not whole or isinstance(value, bool)):
                raise ArgumentError(f"run.{name}", value, "a whole number >= 0")

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> CaseOptions:
        """Options in a case's values. Raises ArgumentError, naming the one that is wrong."""
        given = {n.removeprefix("run."): v for n, v in values.items() if n.startswith("run.")}
        known = [field.name for field in fields(cls)]
        for name in given:
            if name not in known:
                expected = "one of " + ", ".join(f"run.{k}" for k in known)
                raise ArgumentError(f"run.{name}", given[name], expected)
        return cls(**given)


def run_case(case: Case, problem: Problem) -> dict[str, Any]:
    """Solve ``problem``, which has the case's values, and drive it where the case says so.

    A row of plain values and arrays: cost, terms, margins, faults, deviations, duration (s), energy (J),
    control points; ``driven.*`` and the driven pose over time, where it was driven.
    """
    solution, report = solve_case(case, problem)
    row: dict[str, Any] = {
        "cost": solution.cost,
        "terms": solution.terms,
        "evaluations": solution.evaluations,
        "holds": solution.holds,
        "faults": "; ".join(solution.faults),
        "search": "" if solution.search is None else solution.search.status,
        "margins": solution.margins,
        "pose_error": np.asarray(solution.deviation).tolist(),
        "wheel_error": np.asarray(solution.wheel_deviation).tolist(),
        "control_points": solution.control_points,
    }
    if solution.trajectory is not None:
        row["duration"] = solution.trajectory.duration
        row["energy"] = solution.energy
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


def solve_case(case: Case, problem: Problem) -> tuple[Solution, ValidationReport | None]:
    """The solution of a case, the same at every call, and what physics made of it: None where the
    case has no engine, or the solution no trajectory."""
    options = CaseOptions.of(case.values)
    solution = solve(
        problem,
        seed=seed_of(case),
        optimizer=options.optimizer,
        budget=Budget(evaluations=int(options.evaluations)) if options.evaluations else None,
    )
    if options.engine == "none" or solution.trajectory is None:
        return solution, None
    return solution, validate(solution.trajectory, solution.problem, engine=options.engine)


def seed_of(case: Case) -> int:
    """The seed with which a case is solved."""
    seed = CaseOptions.of(case.values).seed
    return case.seed if seed is None else int(seed)


@dataclass(frozen=True)
class ProblemRun:
    """``func(case, problem)`` as a run function: every case gets ``problem`` with those of its
    values put in whose names have a dot (``run.*`` are options of ``run_case``)."""

    func: Callable[[Case, Any], Any]
    problem: Problem

    def __call__(self, case: Case) -> Any:
        return self.func(case, self.changed(case))

    def changed(self, case: Case) -> Problem:
        """The problem of a case. Raises ProblemError for values it cannot have."""
        return self.problem.replace(
            {k: v for k, v in case.values.items() if "." in k and not k.startswith("run.")}
        )

    @property
    def content(self) -> Any:
        """The problem in plain values, as identities of cases hold it, with what files of the ground
        hold by their digests."""
        return self.problem.standalone(
            {
                key: sha256(b"".join(part.read_bytes() for part in parts_of(file))).hexdigest()
                for key, file in self.problem.files.items()
            }
        )

    def check(self, case: Case, spare: Collection[str]) -> None:
        """Find wrong names now and not in a million rows: ``case`` is the first one, ``spare`` are
        names without a dot that no formula of the sweep uses.

        A function of the user's own may read any name without a dot, ``run_case`` none. Raises
        ArgumentError, ProblemError.
        """
        self.changed(case)
        if self.func is not run_case:
            for name in case.values:
                if name.startswith("run."):
                    expected = f"a name without a dot: run.* is for {__name__}:run_case"
                    raise ArgumentError(name, case.values[name], expected)
            return
        CaseOptions.of(case.values)
        for name in spare:
            if name != "repeat":
                expected = (
                    "a dotted key of the problem, such as ground.friction, "
                    "repeat, or a name that derived or exclude use"
                )
                raise ArgumentError(f"axes.{name}", case.values[name], expected)


def with_problem(function: Callable[[Case, Any], Any], file: str | Path) -> ProblemRun:
    """``function(case, problem)`` bound to the problem in ``file``. Raises ProblemError."""
    return ProblemRun(function, load_problem(file))
