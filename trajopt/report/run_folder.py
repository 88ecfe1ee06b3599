"""The folder of one run: what was asked, what was found, and enough to go on from it.

``problem.toml`` the problem as solved; ``summary.json`` the result in numbers; ``trajectory.csv``
the motion over time; ``timing.csv`` the exact speed profile; ``history.csv`` and ``explored.npz``
the search; ``validation.json`` and ``simulated.csv`` the check in physics.
"""

from __future__ import annotations

import csv
import os
import zlib
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.objectives.duration import DurationObjective
from trajopt.objectives.terminal import TerminalObjective, swarm_engine, terminal_objective
from trajopt.optimize.base import History, OptimizeResult, Status
from trajopt.paths.path import Path
from trajopt.pipeline import Solution
from trajopt.problem.search import WHEELS, Problem, load_problem
from trajopt.provenance import commit, run_facts, versions
from trajopt.report.files import as_toml, made_folder, read_json, write_json, write_text
from trajopt.timing.trajectory import Trajectory
from trajopt.world.terrain import Flat

if TYPE_CHECKING:
    import pandas as pd

    from trajopt.simulate.check import ValidationReport


FORMAT = 1  # of the folder; a reader of another number refuses
SAMPLE_TIME = 0.01  # s, largest step of trajectory.csv; chosen: 100 rows a second
_OF_A_CHECK = ("validation.json", "simulated.csv", "physics.png", "engine.png")
_OF_A_SOLUTION = (
    "summary.json",
    "problem.toml",
    "trajectory.csv",
    "timing.csv",
    "history.csv",
    "explored.npz",
    "path.png",
    "profile.png",
    "convergence.png",
)


def write_solution(
    solution: Solution, folder: str | FilePath, *, seed: int, command: str | None = None
) -> FilePath:
    """Write a solution into ``folder`` (made if needed; an earlier run's files are replaced) and
    return it.

    ``summary.json`` comes last, so a folder with one is complete. Equal seeds and budgets in
    evaluations give equal bytes there outside the key "run". Without a trajectory there is no
    trajectory.csv and timing.csv. Raises ArgumentError where the folder cannot be written.
    """
    place = made_folder(folder)
    for name in (
        *_OF_A_SOLUTION,
        *_OF_A_CHECK,
    ):  # nothing of an earlier run may pass for this one's
        (place / name).unlink(missing_ok=True)
    write_text(
        place / "problem.toml", as_toml(solution.problem.model_dump(mode="json", exclude_none=True))
    )
    if solution.trajectory is not None:
        _write_csv(trajectory_table(solution), place / "trajectory.csv")
        _write_csv(_timing_table(solution.trajectory), place / "timing.csv")
    _write_csv(_history_table(solution.search.history), place / "history.csv")
    _write_samples(solution.search.history.samples, place / "explored.npz")
    summary = solution_summary(solution, seed=seed)
    summary["run"] = {
        **run_facts(),
        "command": command,
        "folder": str(place),
        "problem_file": solution.problem.source,
        "wall_time_s": solution.wall_time,
        "search_time_s": solution.search.seconds,
    }
    write_json(place / "summary.json", summary)
    return place


def solution_summary(solution: Solution, *, seed: int) -> dict[str, Any]:
    """Everything about a solution that equal runs share; units in the names."""
    search, trajectory = solution.search, solution.trajectory
    terminal = _terminal(solution.objective)
    return {
        "format": FORMAT,
        "title": solution.problem.title,
        "holds": solution.holds,
        "status": solution.status,
        "faults": list(solution.faults),
        "objective": solution.problem.objective.kind,
        "cost": solution.cost,
        "terms": solution.terms,
        "violation": search.violation,
        "duration_s": solution.duration,
        "margins": solution.margins,
        "binding_share_of_time": {} if trajectory is None else binding_shares(trajectory),
        "decision": dict(zip(terminal.names, search.x.tolist(), strict=True)),
        "control_points": [
            dict(zip(("x_m", "y_m", "yaw_rad"), row, strict=True))
            for row in solution.control_points.tolist()
        ],
        "final_deviation": dict(
            zip(("x_m", "y_m", "yaw_rad"), solution.deviation.tolist(), strict=True)
        ),
        "final_wheel_deviation_rad": _by_wheel(solution.wheel_deviation),
        "dead_zone_effect_rad": _by_wheel(solution.dead_zone_effect),
        "infeasible": _infeasible(solution.infeasible),
        "timing": None
        if trajectory is None
        else {
            "engine": trajectory.engine,
            "gridpoints": len(trajectory.s),
            "slowdown": trajectory.slowdown,
        },
        "search": {
            "optimizer": search.optimizer,
            "seed": int(seed),
            "status": search.status.name,
            "message": search.message,
            "success": search.success,
            "evaluations": search.nfev,
            "iterations": search.nit,
            "cost_on_search_grid": search.search_fun,
            "failures": search.failures,
            "first_failure": search.first_failure,
        },
        "swarm_engine": swarm_engine(),
        "versions": versions(),
        "commit": commit(),
    }


def read_solution(folder: str | FilePath) -> Solution:
    """The solution in a folder of ``write_solution``: numbers as written, path and trajectory
    rebuilt from them.

    Raises ArgumentError where a file is missing or cannot be used, ProblemError for its
    problem.toml.
    """
    place = FilePath(folder)
    summary = read_json(place / "summary.json")
    if summary.get("format") != FORMAT:
        raise ArgumentError(
            str(place / "summary.json"), summary.get("format"), f"format = {FORMAT}"
        )
    problem = load_problem(place / "problem.toml")
    if not isinstance(problem, Problem):
        raise ArgumentError(
            "folder", str(folder), "a folder with a problem that is searched, without [path]"
        )
    terminal = terminal_objective(problem)
    objective = DurationObjective(terminal) if problem.objective.kind == "duration" else terminal
    try:
        search = _search(summary, place, terminal.names)
        path = objective.path(search.x)
        timing = summary["timing"]
        trajectory = None if timing is None else _trajectory(place, path, terminal, timing)
        failed = summary["infeasible"]
        return Solution(
            problem=problem,
            objective=objective,
            search=search,
            terms={name: _number(value, np.inf) for name, value in summary["terms"].items()},
            path=path,
            trajectory=trajectory,
            infeasible=None
            if failed is None
            else InfeasibleError(failed["limit"], failed["place_m"], failed["reason"]),
            deviation=_numbers(summary["final_deviation"]),
            wheel_deviation=_numbers(summary["final_wheel_deviation_rad"]),
            dead_zone_effect=_numbers(summary["dead_zone_effect_rad"]),
            wall_time=summary["run"]["wall_time_s"],
        )
    except (KeyError, TypeError, AttributeError) as error:
        raise ArgumentError(
            str(place / "summary.json"),
            f"{type(error).__name__}: {error}",
            "every key that solve --out writes, unchanged",
        ) from None


def write_validation(report: ValidationReport, folder: str | FilePath) -> FilePath:
    """Write a check in physics into ``folder``: validation.json and simulated.csv. Returns the
    folder.

    Raises ArgumentError where the folder cannot be written.
    """
    place = made_folder(folder)
    for name in _OF_A_CHECK:
        (place / name).unlink(missing_ok=True)
    recording, columns = report.recording, {}
    for prefix, pose in (("planned_", report.planned), ("", recording.pose)):
        for i, name in enumerate(("x_m", "y_m", "yaw_rad")):
            columns[prefix + name] = pose[:, i]
    columns |= wheel_columns("angle_rad", recording.wheel_angles)
    columns |= wheel_columns("speed_rad_s", recording.wheel_speeds)
    columns |= wheel_columns("torque_nm", recording.wheel_torques)
    _write_csv(_frame({"t_s": recording.times, **columns}), place / "simulated.csv")
    summary = validation_summary(report)
    summary["run"] = {
        **run_facts(),
        "real_time_factor": report.real_time_factor,
        "wall_time_s": recording.wall_time,
    }
    write_json(place / "validation.json", summary)
    return place


def validation_summary(report: ValidationReport) -> dict[str, Any]:
    """A check in physics in numbers; units in the names, shares relative to the path's length."""
    length = report.length if report.length > 0 else np.nan
    return {
        "format": FORMAT,
        "engine": report.engine,
        "engine_version": report.recording.version,
        "control": report.control,
        "seed": None if report.control is None else report.seed,
        "length_m": report.length,
        "along_m": report.along,
        "across_m": report.across,
        "along_share": report.along / length,
        "across_share": report.across / length,
        "final_distance_m": report.final_distance,
        "yaw_rad": report.yaw,
        "wheel_deviation_rad": _by_wheel(report.wheel_deviation),
        "path_rms_m": report.path_rms,
        "path_max_m": report.path_max,
        "versions": versions(),
        "commit": commit(),
    }


def trajectory_table(solution: Solution) -> pd.DataFrame:
    """The motion in equal steps of at most 10 ms; units in the column names.

    Pose in the world; speeds in the body frame; wheel angles as the goal states them, from
    ``start.wheels`` on; ``limit`` names what binds ("" for nothing). Raises ArgumentError for a
    solution without a trajectory.
    """
    trajectory = solution.trajectory
    if trajectory is None:
        raise ArgumentError("solution", solution.status, "a solution with a trajectory")
    times = np.linspace(
        0.0, trajectory.duration, max(2, int(np.ceil(trajectory.duration / SAMPLE_TIME)) + 1)
    )
    state, (s, speed, acceleration) = trajectory.at(times), trajectory.along(times)
    columns: dict[str, Any] = {"t_s": times}
    columns |= dict(zip(("x_m", "y_m", "yaw_rad"), state.pose.T, strict=True))
    columns |= dict(zip(("vx_m_s", "vy_m_s", "yaw_rate_rad_s"), state.twist.T, strict=True))
    columns |= wheel_columns(
        "angle_rad", np.asarray(solution.problem.start.wheels) + state.wheel_angles
    )
    columns |= wheel_columns("speed_rad_s", state.wheel_speeds)
    columns |= {"s_m": s, "s_dot_m_s": speed, "s_ddot_m_s2": acceleration}
    columns["limit"] = binding_at(trajectory, times)
    return _frame(columns)


def binding_at(trajectory: Trajectory, times: Array) -> list[str]:
    """Name of the limit that binds at each time (s), "" where none does."""
    interval = np.clip(
        np.searchsorted(trajectory.times, times, side="right") - 1, 0, len(trajectory.sdd) - 1
    )
    return [trajectory.binding[i] for i in interval]


def binding_shares(trajectory: Trajectory) -> dict[str, float]:
    """Share of the duration in which each limit binds, most first; "" for the rest is left out."""
    steps, names = np.diff(trajectory.times) / trajectory.duration, np.array(trajectory.binding)
    shares = {limit.name: float(steps[names == limit.name].sum()) for limit in trajectory.limits}
    return dict(sorted(((k, v) for k, v in shares.items() if v > 0), key=lambda item: -item[1]))


def wheel_columns(quantity: str, values: Array) -> dict[str, Array]:
    """Columns wheel_<name>_<quantity> of an array (N, W)."""
    return {
        f"wheel_{name.replace('-', '_')}_{quantity}": values[:, i]
        for i, name in enumerate(wheel_names(values.shape[1]))
    }


def wheel_names(count: int) -> tuple[str, ...]:
    """Names in wheel order: the four corners, or numbers from 1 for another number of wheels."""
    return WHEELS if count == len(WHEELS) else tuple(str(i + 1) for i in range(count))


def _by_wheel(values: Array) -> dict[str, float]:
    return dict(
        zip(wheel_names(len(values)), np.asarray(values, dtype=float).tolist(), strict=True)
    )


def _infeasible(error: InfeasibleError | None) -> dict[str, Any] | None:
    return (
        None
        if error is None
        else {"limit": error.limit, "place_m": error.place, "reason": error.reason}
    )


def _terminal(objective: TerminalObjective | DurationObjective) -> TerminalObjective:
    return objective.terminal if isinstance(objective, DurationObjective) else objective


def _timing_table(trajectory: Trajectory) -> pd.DataFrame:
    """Gridpoints of the speed profile; s'' belongs to the interval after a gridpoint, so the last
    has none."""
    if not isinstance(trajectory.ground, Flat):
        raise ArgumentError(
            "trajectory.ground", trajectory.ground, "flat ground: the folder keeps no other"
        )
    return _frame(
        {
            "u": trajectory.u,
            "s_m": trajectory.s,
            "s_dot_m_s": trajectory.sd,
            "s_ddot_m_s2": np.append(trajectory.sdd, np.nan),
        }
    )


def _trajectory(
    place: FilePath, path: Path, terminal: TerminalObjective, timing: dict[str, Any]
) -> Trajectory:
    table = _read_csv(place / "timing.csv", ("u", "s_m", "s_dot_m_s", "s_ddot_m_s2"))
    return Trajectory(
        path,
        terminal.problem.limits.as_limits(),
        terminal.robot,
        Flat(),
        table["u"],
        table["s_m"],
        table["s_dot_m_s"],
        table["s_ddot_m_s2"][:-1],
        timing["engine"],
        timing["slowdown"],
    )


def _history_table(history: History) -> pd.DataFrame:
    return _frame(
        {
            "evaluations": history.evaluations,
            "cost": history.cost,
            "violation": history.violation,
            "seconds_s": history.seconds,
        }
    )


def _search(summary: dict[str, Any], place: FilePath, names: tuple[str, ...]) -> OptimizeResult:
    facts = summary["search"]
    table = _read_csv(place / "history.csv", ("evaluations", "cost", "violation", "seconds_s"))
    try:
        with np.load(place / "explored.npz") as stored:
            samples = stored["samples"]
    except (OSError, ValueError, KeyError, EOFError, BadZipFile, zlib.error) as error:
        raise ArgumentError(
            str(place / "explored.npz"), str(error), "the file that solve --out writes"
        ) from None
    history = History(
        table["evaluations"].astype(np.int64),
        table["seconds_s"],
        table["cost"],
        table["violation"],
        samples,
    )
    return OptimizeResult(
        x=np.array([summary["decision"][name] for name in names], dtype=np.float64),
        fun=_number(summary["cost"], np.inf),
        violation=_number(summary["violation"], np.inf),
        search_fun=_number(facts["cost_on_search_grid"], np.inf),
        nfev=facts["evaluations"],
        nit=facts["iterations"],
        success=facts["success"],
        status=Status[facts["status"]],
        message=facts["message"],
        optimizer=facts["optimizer"],
        history=history,
        seconds=summary["run"]["search_time_s"],
        failures=facts["failures"],
        first_failure=facts["first_failure"],
    )


def _number(value: float | None, missing: float) -> float:
    return missing if value is None else float(value)


def _numbers(values: dict[str, float | None]) -> Array:
    return np.array([_number(v, np.nan) for v in values.values()])


def _frame(columns: dict[str, Any]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(columns)


def _write_csv(table: pd.DataFrame, file: FilePath) -> None:
    write_text(file, table.to_csv(index=False, lineterminator="\n"))


def _read_csv(file: FilePath, columns: tuple[str, ...]) -> dict[str, Array]:
    """Those columns of a table, every bit of their numbers; an empty field is NaN.

    Raises ArgumentError where the table is another.
    """
    try:
        with file.open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
            return {name: np.array([float(row[name] or "nan") for row in rows]) for name in columns}
    except (OSError, ValueError, KeyError) as error:
        raise ArgumentError(
            str(file), str(error), f"a table with columns {', '.join(columns)}"
        ) from None


def _write_samples(samples: Array, file: FilePath) -> None:
    part = file.with_name(f".{file.name}.part")
    with part.open("wb") as stream:
        np.savez_compressed(stream, samples=samples)
    os.replace(part, file)
