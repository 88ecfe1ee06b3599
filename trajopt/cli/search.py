"""``trajopt solve | validate | schema``: do a problem's job, check the motion in physics."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from trajopt.cli.shared import (
    FAULTY,
    INTERRUPTED,
    Bar,
    ControlOption,
    Force,
    FormatOption,
    Overrides,
    ProblemFile,
    console,
    control_mode,
    overrides,
    picture_kind,
    require_free,
)
from trajopt.errors import ArgumentError
from trajopt.report.words import words

if TYPE_CHECKING:
    from trajopt.arrays import Array
    from trajopt.optimize.base import Budget
    from trajopt.problem import Problem
    from trajopt.solution import Solution

Out = Annotated[
    Path | None, typer.Option("--out", help="folder for trajectory, summary and pictures")
]


def solve(
    problem: ProblemFile,
    optimizer: Annotated[
        str, typer.Option(help="auto, the name of an optimizer, or file.py:name")
    ] = "auto",
    plugin: Annotated[
        Path | None, typer.Option(help="Python file with own OPTIMIZERS, known by name")
    ] = None,
    seed: Annotated[int, typer.Option(help="seed of everything random")] = 0,
    out: Out = None,
    set_: Overrides = None,
    evaluations: Annotated[int | None, typer.Option(help="budget of objective evaluations")] = None,
    seconds: Annotated[float | None, typer.Option(help="budget of wall-clock seconds")] = None,
    target: Annotated[float | None, typer.Option(help="stop when the cost is this low")] = None,
    x0: Annotated[
        Path | None, typer.Option(help="start from a saved solution (its folder)")
    ] = None,
    resume: Annotated[
        bool, typer.Option(help="save the search in --out, and go on where it is saved there")
    ] = False,
    pictures: Annotated[bool, typer.Option(help="draw pictures into the folder")] = True,
    format_: FormatOption = None,
    force: Force = False,
) -> None:
    """Do the job of a problem (search, time a path, plan a climb), and write what was found."""
    from trajopt.optimize.base import Status
    from trajopt.pipeline import solve as solve_problem
    from trajopt.problem import load_problem
    from trajopt.report.run_folder import solution_summary
    from trajopt.report.tables import solution_table

    kind = picture_kind(pictures, format_)
    loaded = load_problem(problem, overrides(set_))
    optimizer = _of_plugin(optimizer, plugin)
    budget = _budget(evaluations, seconds, target)
    start = None if x0 is None else _searched(x0)
    state = _state(out) if resume else None
    if impossible := _impossible(loaded):
        console.print(impossible, soft_wrap=True)
    with Bar(f"{optimizer}", None if budget is None else budget.evaluations) as bar:
        solution = solve_problem(
            loaded,
            optimizer=optimizer,
            seed=seed,
            budget=budget,
            x0=start,
            state=state,
            progress=bar.update,
        )
    console.print(solution_table(solution))
    console.facts(solution_summary(solution, seed=seed))
    if out is not None:
        _write(solution, out, seed, kind, force)
    if not solution.holds:
        for fault in solution.faults:
            console.print(words(("does not hold:", "red"), f" {fault}"))
    if solution.search is not None and solution.search.status is Status.INTERRUPTED:
        raise typer.Exit(INTERRUPTED)
    if not solution.holds:
        raise typer.Exit(FAULTY)


def validate(
    folder: Annotated[Path, typer.Argument(help="folder written by solve --out")],
    engine: Annotated[
        str, typer.Option(help="mujoco, pybullet, or auto: what is installed")
    ] = "auto",
    control: ControlOption = "none",
    seed: Annotated[
        int, typer.Option(help="seed of the measured pose's noise, with --control")
    ] = 0,
    pictures: Annotated[bool, typer.Option(help="draw pictures into the folder")] = True,
    format_: FormatOption = None,
) -> None:
    """Drive a saved solution in a physics engine with real rollers and measure the deviation."""
    from trajopt.pipeline import validate as validate_trajectory
    from trajopt.report.run_folder import read_solution, validation_summary, write_validation
    from trajopt.report.tables import validation_table

    kind = picture_kind(pictures, format_)
    solution = read_solution(folder)
    if solution.trajectory is None:
        raise ArgumentError(
            "folder",
            str(folder),
            "a solution with a trajectory; this one has none: " + solution.status,
        )
    with Bar(f"{engine}", None):
        report = validate_trajectory(
            solution.trajectory,
            solution.problem,
            engine=engine,
            picture=pictures,
            control=control_mode(control),
            seed=seed,
        )
    console.print(validation_table(report, solution.problem.robot))
    console.facts(validation_summary(report, solution.problem.robot))
    write_validation(report, folder, solution.problem.robot)
    if kind:
        from trajopt.report.pictures import save_physics_picture

        save_physics_picture(solution, report, folder, kind)
        if report.recording.no_picture:
            console.print(f"no engine.png: {report.recording.no_picture}")
    console.print(f"written to {folder}", soft_wrap=True)


def schema(
    kind: Annotated[str, typer.Argument(help="problem, robot or sweep")] = "problem",
    out: Annotated[
        Path | None, typer.Option(help="file to write; standard output without it")
    ] = None,
    force: Force = False,
) -> None:
    """Print the JSON schema of problem, robot or sweep files, for editors."""
    from trajopt.problem import problem_schema
    from trajopt.robots.description import RobotDescription
    from trajopt.schema import json_schema
    from trajopt.sweeps.sweepfile import sweep_schema

    require_free("--out", out, force)
    kinds = {
        "problem": problem_schema,
        "robot": lambda: json_schema(RobotDescription),
        "sweep": sweep_schema,
    }
    if kind not in kinds:
        raise ArgumentError("kind", kind, "one of " + ", ".join(kinds))
    text = kinds[kind]()
    if out is None:
        sys.stdout.write(text)
    else:
        from trajopt.files import whole_file

        with whole_file(out) as part:
            part.write_text(text, encoding="utf-8")


def _write(solution: Solution, out: Path, seed: int, pictures: str | None, force: bool) -> None:
    from trajopt.report.run_folder import write_solution

    command = " ".join(sys.argv)
    write_solution(solution, out, seed=seed, command=command, pictures=pictures, force=force)
    console.print(f"written to {out}", soft_wrap=True)


def _searched(folder: Path) -> Array:
    """The decision that a saved search came to. Raises ArgumentError where nothing was searched."""
    from trajopt.report.run_folder import read_solution

    search = read_solution(folder).search
    if search is None:
        raise ArgumentError("--x0", str(folder), "the folder of a search")
    return search.x


def _state(out: Path | None) -> Path:
    """The file of a search that can go on."""
    if out is None:
        raise ArgumentError("--resume", True, "--out with it: the search is saved there")
    out.mkdir(parents=True, exist_ok=True)
    return out / "search.npz"


def _impossible(problem: Problem) -> str:
    """Why no motion reaches the goal, where that is known before searching."""
    from trajopt.solution import search_objective

    return search_objective(problem).impossible() if problem.actuator is not None else ""


def _of_plugin(optimizer: str, plugin: Path | None) -> str:
    """The optimizer's name, with the plugin file where it is that one's."""
    from trajopt.optimize.plugins import optimizers_of_file

    return (
        f"{plugin}:{optimizer}"
        if plugin is not None and optimizer in optimizers_of_file(plugin)
        else optimizer
    )


def _budget(evaluations: int | None, seconds: float | None, target: float | None) -> Budget | None:
    """None where nothing is asked for."""
    from trajopt.optimize.base import DEFAULT_EVALUATIONS, Budget

    if evaluations is None and seconds is None:
        if target is None:
            return None
        evaluations = DEFAULT_EVALUATIONS
    return Budget(evaluations, seconds, target)
