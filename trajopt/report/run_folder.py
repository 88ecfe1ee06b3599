"""The folder of one run: what was asked, what was found, and enough to go on from it.

``problem.toml`` the problem as solved; ``summary.json`` the result in numbers; ``trajectory.csv``
the motion over time; ``timing.csv`` the exact speed profile; ``height_map``, ``mesh`` and
``friction_map`` files of the ground; ``history.csv`` and ``explored.npz``
the search, where control points were searched; ``validation.json`` and ``simulated.csv`` the check
in physics. It stands alone: robot and path are in problem.toml, and reading it back gives problem,
path and trajectory to the last bit.
"""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.files import DamageError, checksums, read_table, require_unchanged, whole_file
from trajopt.objectives.terminal import swarm_engine, terminal_objective
from trajopt.optimize.base import History, OptimizeResult, Status
from trajopt.paths.path import Path
from trajopt.paths.spline import SplineBasis
from trajopt.pipeline import with_details
from trajopt.problem import Problem, load_problem
from trajopt.problem.ground import FILES
from trajopt.problem.surroundings import MAPS
from trajopt.provenance import commit, run_facts, versions
from trajopt.report.files import (
    FORMAT,
    FORMATS,
    as_toml,
    made_folder,
    read_sealed,
    write_bytes,
    write_sealed,
    write_table,
    write_text,
)
from trajopt.report.motion import (
    binding_shares,
    column,
    given_columns,
    sampled,
    timing_table,
    trajectory_table,
    turning_wheels,
    wheel_columns,
)
from trajopt.robots.robot import Robot
from trajopt.solution import Solution
from trajopt.timing.cells import Measure
from trajopt.timing.profile import Profile
from trajopt.timing.track import Track
from trajopt.timing.trajectory import Trajectory
from trajopt.world.occupancy import stored as map_files

if TYPE_CHECKING:
    from trajopt.simulate.check import ValidationReport


_OF_A_CHECK = (
    "validation.json",
    "simulated.csv",
    "engine.png",
    "view.html",
    *(f"physics.{kind}" for kind in FORMATS),
)
_PICTURES = tuple(
    f"{name}.{kind}" for name in ("path", "profile", "loads", "convergence") for kind in FORMATS
)
_OF_A_SOLUTION = (
    "summary.json",
    "problem.toml",
    "trajectory.csv",
    "timing.csv",
    "history.csv",
    "explored.npz",
    "route.csv",
    *_PICTURES,
)
_SIGMA = ("sigma_dot_squared_m2_s2", "sigma_ddot_first_m_s2", "sigma_ddot_last_m_s2")
_TABLES = {  # columns that are read back, and those of them that may hold gaps
    "timing.csv": (
        ("u", "s_m", "s_dot_m_s", "s_ddot_m_s2", *_SIGMA),
        ("s_ddot_m_s2", *_SIGMA),
    ),
    "route.csv": (("u", "x_m", "y_m", "yaw_rad"), ("u", "yaw_rad")),
    "history.csv": (("evaluations", "cost", "violation", "seconds_s"), ("cost", "violation")),
}


def write_solution(
    solution: Solution,
    folder: str | FilePath,
    *,
    seed: int,
    command: str | None = None,
    pictures: str | None = None,
    force: bool = False,
) -> FilePath:
    """Write a solution into ``folder`` (made if needed; an earlier run's files are replaced) and
    return it.

    ``summary.json`` comes last, so a folder with one is complete; it holds checksums of the others
    (but pictures) and of itself. Equal seeds and budgets in evaluations give equal bytes there
    outside the keys "run" and "checksum". Without a trajectory there is no trajectory.csv and
    timing.csv. ``pictures`` is the format in which they are drawn too. Raises ArgumentError where the folder cannot be
    written, or, without ``force``, holds files of these names that no run
    wrote.
    """
    place, search, problem = made_folder(folder), solution.search, solution.problem
    strange = [name for name in _OF_A_SOLUTION if (place / name).exists()]
    strange += _copies(place)
    if strange and "summary.json" not in strange and not force:
        expected = (
            f"a folder without {', '.join(strange)}: no run that ended wrote this; or --force"
        )
        raise ArgumentError("folder", str(folder), expected)
    # Read first: the problem's file may stand in this folder itself.
    names: dict[str, str] = {}
    stored: dict[str, bytes] = {}
    for key, file in problem.files.items():
        names[key] = key.removeprefix("ground.").replace(".", "_") + file.suffix
        cells = key == "map" and file.suffix in MAPS
        stored |= map_files(file, names[key]) if cells else {names[key]: file.read_bytes()}
    for name in (*_OF_A_SOLUTION, *_OF_A_CHECK, *_copies(place)):
        (place / name).unlink(missing_ok=True)  # nothing of an earlier run may pass for this one's
    for name, content in stored.items():
        write_bytes(place / name, content)
    write_text(place / "problem.toml", as_toml(problem.standalone(names)))
    if solution.trajectory is not None:
        write_table(place / "trajectory.csv", trajectory_table(solution.trajectory))
        write_table(place / "timing.csv", timing_table(solution.trajectory))
    if search is not None:
        write_table(place / "history.csv", _history_table(search.history))
        _write_samples(search.history.samples, place / "explored.npz")
    if problem.job.name == "route" and solution.path is not None:
        write_table(place / "route.csv", _route_table(solution.path))
    if solution.details is not None:
        solution.details.save(place, pictures=pictures)
    if pictures:
        from trajopt.report.pictures import save_pictures
        from trajopt.report.viewer.motion_page import write_view

        save_pictures(solution, place, pictures)
        write_view(solution, place)
    summary = solution_summary(solution, seed=seed)
    summary["run"] = {
        **run_facts(),
        "command": command,
        "folder": str(place),
        "problem_file": solution.problem.source,
        "wall_time_s": solution.wall_time,
        "search_time_s": None if search is None else search.seconds,
        "files": checksums(place, [*(n for n in _OF_A_SOLUTION if n not in _PICTURES), *stored]),
    }
    write_sealed(place / "summary.json", summary)
    return place


def _copies(place: FilePath) -> list[str]:
    """Names of files in a folder that copies of a problem's files have."""
    patterns = [f"{key}.*" for key in FILES] + ["map.*", "map_picture.*", "obstacles_*.*"]
    return [path.name for pattern in patterns for path in place.glob(pattern)]


def solution_summary(solution: Solution, *, seed: int) -> dict[str, Any]:
    """Everything about a solution that equal runs share; units in the names."""
    trajectory, problem = solution.trajectory, solution.problem
    points = [
        dict(zip(("x_m", "y_m", "yaw_rad"), row, strict=True))
        for row in solution.control_points.tolist()
    ]
    return {
        "format": FORMAT,
        "title": problem.title,
        "job": problem.job.name,
        "robot": problem.robot.name,
        "holds": solution.holds,
        "status": solution.status,
        "faults": list(solution.faults),
        "cost": solution.cost,
        "terms": solution.terms,
        "duration_s": solution.duration,
        "energy_j": solution.energy,
        "margins": solution.margins,
        "binding_share_of_time": {} if trajectory is None else binding_shares(trajectory),
        "control_points": points,
        "final_deviation": dict(
            zip(("x_m", "y_m", "yaw_rad"), solution.deviation.tolist(), strict=False)
        ),
        "final_wheel_deviation_rad": dict(
            zip(problem.robot.wheel_names, solution.wheel_deviation.tolist(), strict=False)
        ),
        "infeasible": _infeasible(solution.infeasible),
        "refused": list(solution.refused),
        "timing": None
        if trajectory is None
        else {
            "engine": trajectory.engine,
            "gridpoints": len(trajectory.s),
            "slowdown": trajectory.slowdown,
            "least_time_s": trajectory.bound,
            "gap": trajectory.gap,
            "sampled": sampled(trajectory),
            "limits": [limit.name for limit in trajectory.limits],
        },
        "search": _search_summary(solution, seed),
        "details": {} if solution.details is None else solution.details.notes,
        "versions": versions(),
        "commit": commit(),
    }


def _search_summary(solution: Solution, seed: int) -> dict[str, Any] | None:
    search = solution.search
    if search is None:
        return None
    names = terminal_objective(solution.problem).names
    return {
        "objective": solution.problem.objective.kind,
        "decision": dict(zip(names, search.x.tolist(), strict=True)),
        "violation": search.violation,
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
        "swarm_engine": swarm_engine(),
    }


def read_solution(folder: str | FilePath) -> Solution:
    """The solution in a folder of ``write_solution``: numbers as written, path and trajectory
    rebuilt from them.

    Raises ArgumentError where summary.json is missing or of another format, DamageError where a
    file of the run or of its check is not what was written.
    """
    place = FilePath(folder)
    summary = read_sealed(place / "summary.json", FORMAT)
    checks = [summary]
    if (place / "validation.json").exists():
        checks.append(read_sealed(place / "validation.json", FORMAT))
    try:
        for check in checks:
            require_unchanged(place, check["run"]["files"])
    except DamageError:
        for name, (columns, free) in _TABLES.items():
            if (place / name).exists():
                read_table(place / name, columns, free)  # tells the row, where one is no row
        raise
    problem = load_problem(place / "problem.toml")
    try:
        search = None if summary["search"] is None else _search(summary, place, problem)
        timing, path = summary["timing"], None
        if problem.job.name == "path":
            path = problem.flat_path if timing is None else problem.path
        if search is not None:
            path = terminal_objective(problem).path(search.x)
        if problem.job.name == "route" and (place / "route.csv").exists():
            path = _route_path(place, problem)
        trajectory = None
        if timing is not None and path is not None:
            trajectory = _trajectory(place, path, problem, timing)
        failed = summary["infeasible"]
        return with_details(
            Solution(
                problem,
                path,
                trajectory,
                None
                if failed is None
                else InfeasibleError(failed["limit"], failed["place_m"], failed["reason"]),
                search,
                tuple(summary["refused"]),
                wall_time=summary["run"]["wall_time_s"],
            )
        )
    except (KeyError, TypeError, AttributeError) as error:
        raise ArgumentError(
            str(place / "summary.json"),
            f"{type(error).__name__}: {error}",
            "every key that solve --out writes, unchanged",
        ) from None


def write_validation(report: ValidationReport, folder: str | FilePath, robot: Robot) -> FilePath:
    """Write a check in physics of ``robot`` into ``folder``: validation.json and simulated.csv.
    Returns the folder.

    Raises ArgumentError where the folder cannot be written.
    """
    place = made_folder(folder)
    for name in _OF_A_CHECK:
        (place / name).unlink(missing_ok=True)
    recording, columns = report.recording, {}
    for prefix, pose in (("planned_", report.planned), ("", recording.pose)):
        for i, name in enumerate(("x_m", "y_m", "yaw_rad")):
            columns[prefix + name] = pose[:, i]
    columns |= wheel_columns("angle_rad", recording.wheel_angles, robot)
    columns |= wheel_columns("speed_rad_s", recording.wheel_speeds, robot)
    columns |= wheel_columns("torque_nm", recording.wheel_torques, robot)
    columns |= {"z_m": recording.height, "roll_rad": recording.roll, "pitch_rad": recording.pitch}
    turns = [report.wheels.index(name) for name in turning_wheels(robot)]
    every, plan = range(len(report.wheels)), report.wheel_plan
    for quantity, values, which in (
        ("load_n", recording.loads, every),
        ("planned_load_n", plan.loads, every),
        ("slip_m_s", recording.slip, every),
        ("steering_rad", report.steering, turns),
        ("planned_steering_rad", plan.steering, turns),
    ):
        columns |= {column(report.wheels[i], quantity): values[:, i] for i in which}
    columns |= given_columns(recording, robot)
    write_table(place / "simulated.csv", {"t_s": recording.times, **columns})
    summary = validation_summary(report, robot)
    summary["run"] = {
        **run_facts(),
        "real_time_factor": report.real_time_factor,
        "wall_time_s": recording.wall_time,
        "files": checksums(place, ["simulated.csv"]),
    }
    write_sealed(place / "validation.json", summary)
    return place


def validation_summary(report: ValidationReport, robot: Robot) -> dict[str, Any]:
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
        "wheel_deviation_rad": dict(
            zip(robot.wheel_names, report.wheel_deviation.tolist(), strict=True)
        ),
        "path_rms_m": report.path_rms,
        "path_max_m": report.path_max,
        "contacts": [
            {"name": hit.name, "time_s": hit.time, "place_m": list(hit.place)}
            for hit in report.contacts
        ],
        "slip_m_s": dict(zip(report.wheels, report.slip.tolist(), strict=True)),
        "steering_error_rad": {
            name: float(report.steering_error[report.wheels.index(name)])
            for name in turning_wheels(robot)
        },
        "mean_load_n": dict(zip(report.wheels, report.recording.loads.mean(axis=0), strict=True)),
        "planned_mean_load_n": dict(
            zip(report.wheels, report.wheel_plan.loads.mean(axis=0), strict=True)
        ),
        "versions": versions(),
        "commit": commit(),
    }


def _infeasible(error: InfeasibleError | None) -> dict[str, Any] | None:
    return (
        None
        if error is None
        else {"limit": error.limit, "place_m": error.place, "reason": error.reason}
    )


def _trajectory(
    place: FilePath, path: Path, problem: Problem, timing: dict[str, Any]
) -> Trajectory:
    table = read_table(place / "timing.csv", *_TABLES["timing.csv"])
    known = {limit.name: limit for limit in problem.limits}
    if problem.profile is not None:
        known[problem.profile.bound.name] = problem.profile.bound
    profile, square = None, table["sigma_dot_squared_m2_s2"]
    if np.isfinite(square).all():
        measure = Measure.of(Track(path, problem.robot, problem.scene.ground))
        pulls = (table[name][:-1] for name in _SIGMA[1:])
        profile = Profile(measure, table["u"], measure.sigma(table["u"]), square, *pulls)
    return Trajectory(
        path,
        tuple(known[name] for name in timing["limits"]),
        problem.robot,
        problem.scene.ground,
        table["u"],
        table["s_m"],
        table["s_dot_m_s"],
        table["s_ddot_m_s2"][:-1],
        timing["engine"],
        timing["slowdown"],
        problem.start_wheels,
        problem.start_steering,
        profile,
        timing["least_time_s"],
    )


def _route_table(path: Path) -> dict[str, Any]:
    """Values at the knots, then the rates at start and goal, which have no knot."""
    knots = np.asarray(path.basis.knots)
    yaw = np.full(len(path.coordinates), np.nan) if path.heading is None else path.heading
    return {
        "u": np.concatenate([knots, [np.nan, np.nan]]),
        "x_m": path.coordinates[:, 0],
        "y_m": path.coordinates[:, 1],
        "yaw_rad": yaw,
    }


def _route_path(place: FilePath, problem: Problem) -> Path:
    table = read_table(place / "route.csv", *_TABLES["route.csv"])
    knots, yaw = table["u"][:-2], table["yaw_rad"]
    return Path(
        SplineBasis(tuple(knots.tolist()), clamped_start=True, clamped_end=True),
        np.column_stack([table["x_m"], table["y_m"]]),
        None if np.isnan(yaw).any() else yaw,
        problem.robot.turning_length,
    )


def _history_table(history: History) -> dict[str, Any]:
    return {
        "evaluations": history.evaluations,
        "cost": history.cost,
        "violation": history.violation,
        "seconds_s": history.seconds,
    }


def _search(summary: dict[str, Any], place: FilePath, problem: Problem) -> OptimizeResult:
    facts, names = summary["search"], terminal_objective(problem).names
    table = read_table(place / "history.csv", *_TABLES["history.csv"])
    with np.load(place / "explored.npz") as stored:
        samples = stored["samples"]
    history = History(
        table["evaluations"].astype(np.int64),
        table["seconds_s"],
        table["cost"],
        table["violation"],
        samples,
    )
    return OptimizeResult(
        x=np.array([facts["decision"][name] for name in names], dtype=np.float64),
        fun=_number(summary["cost"], np.inf),
        violation=_number(facts["violation"], np.inf),
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


def _write_samples(samples: Array, file: FilePath) -> None:
    with whole_file(file) as part:
        np.savez_compressed(part, samples=samples)
