"""``trajopt plan``: how to meet a step, every configuration with an exact, timed path; ``trajopt
climb``: how often that climbs in physics."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from trajopt.cli.shared import (
    FAULTY,
    Bar,
    ControlOption,
    FormatOption,
    Overrides,
    ProblemFile,
    console,
    control_mode,
    overrides,
    picture_kind,
    simple_table,
)
from trajopt.errors import ArgumentError
from trajopt.report.words import words

if TYPE_CHECKING:
    from trajopt.problem import Problem
    from trajopt.systems.smdw.planner import Maneuver, Plan
    from trajopt.systems.smdw.trials import ClimbTrial


def plan(
    problem: ProblemFile,
    set_: Overrides = None,
    optimizer: Annotated[str, typer.Option(help="lattice, or any optimizer by name")] = "lattice",
    seed: Annotated[int, typer.Option(help="seed of everything random")] = 0,
    out: Annotated[
        Path | None, typer.Option("--out", help="folder for pictures and a run folder a plan")
    ] = None,
    pictures: Annotated[bool, typer.Option(help="draw pictures into the folders")] = True,
    format_: FormatOption = None,
) -> None:
    """Plan every configuration that can climb a step, best first."""
    from trajopt.pipeline import solve
    from trajopt.problem import load_problem

    kind = picture_kind(pictures, format_)
    solution = solve(_climb(load_problem(problem, overrides(set_))), optimizer=optimizer, seed=seed)
    found = cast("Maneuver", solution.details)
    console.print(
        words((found.problem.title, "bold"), f": {found.status} ({found.wall_time:.2f} s)")
    )
    table = simple_table()
    for column in (
        "configuration",
        "duration (s)",
        "target x, y (m), yaw (deg)",
        "wheel error (rad)",
        "room (cm)",
        "phase margin (rad)",
        "climb rate",
    ):
        table.add_column(column, justify="left" if column == "configuration" else "right")
    for one in found.plans:
        x, y, yaw = one.target.pose
        table.add_row(
            one.configuration.name,
            f"{one.duration:.2f}",
            f"{x:.3f}, {y:.3f}, {math.degrees(yaw):.1f}",
            f"{one.wheel_error:.1e}",
            f"{100 * one.room:.1f}",
            f"{one.margin:.2f}",
            f"{one.climb_rate:.0%}",
        )
    if found.plans:
        console.print(table)
    for none in (
        found.refused if found.plans else ()
    ):  # the status names why there is no plan at all
        console.print(f"no plan for {none.configuration.name}: {none.reason}")
    if out is not None:
        from trajopt.report.run_folder import write_solution

        every = (solution, *solution.alternatives)
        for rank, (one, solved) in enumerate(zip(found.plans, every, strict=False), start=1):
            folder = out / f"{rank}_{one.configuration.name.replace(' ', '_')}"
            alone = replace(
                solved, details=None
            )  # what all plans share stands beside their folders
            write_solution(alone, folder, seed=seed, command=" ".join(sys.argv), pictures=kind)
        found.save(out, pictures=kind)
        console.print(f"written to {out}", soft_wrap=True)
    if not found.plans:
        raise typer.Exit(FAULTY)


def climb(
    problem: ProblemFile,
    set_: Overrides = None,
    configuration: Annotated[
        str | None, typer.Option(help="name in the table of plan; default: best")
    ] = None,
    trials: Annotated[int, typer.Option(help="number of trials")] = 20,
    first: Annotated[
        int, typer.Option(help="number of the first trial: each draws from its own")
    ] = 0,
    control: ControlOption = "pose-and-phase",
    engine: Annotated[str, typer.Option(help="mujoco or pybullet")] = "mujoco",
    workers: Annotated[int, typer.Option(help="worker processes")] = 1,
    out: Annotated[
        Path | None, typer.Option("--out", help="folder for trials.csv and a picture")
    ] = None,
    pictures: Annotated[bool, typer.Option(help="draw a picture into the folder")] = True,
    format_: FormatOption = None,
) -> None:
    """Drive a plan in physics and climb from where it ends, many times with random errors."""
    from trajopt.problem import load_problem
    from trajopt.report.files import made_folder
    from trajopt.simulate.engine import make_engine
    from trajopt.systems.smdw.planner import plan_climb
    from trajopt.systems.smdw.trial_files import (
        climb_trials_table,
        save_climb_trials_picture,
        write_climb_trials,
        write_trial_page,
    )
    from trajopt.systems.smdw.trials import climb_trials

    kind = picture_kind(pictures, format_)
    for name, value, least in (
        ("--trials", trials, 1),
        ("--first", first, 0),
        ("--workers", workers, 1),
    ):
        if value < least:
            raise ArgumentError(name, value, f"a whole number >= {least}")
    mode = control_mode(control)
    make_engine(
        engine
    )  # an unknown one is refused before anything is planned, as is a folder that cannot be made
    if out is not None:
        made_folder(out)
    found = plan_climb(_climb(load_problem(problem, overrides(set_))))
    chosen = _chosen(found, configuration)
    facts = {
        "problem": found.problem.source,
        "title": found.problem.title,
        "configuration": chosen.configuration.name,
        "control": control,
        "engine": engine,
        "command": " ".join(sys.argv),
    }
    with Bar(f"{engine}", trials) as bar:

        def keep(done: list[ClimbTrial]) -> None:
            """Nothing that is finished is lost when the rest is not."""
            bar.count(len(done))
            if out is not None:
                write_climb_trials(done, out, facts)

        done = climb_trials(
            found.problem,
            chosen,
            range(first, first + trials),
            control=mode,
            engine=engine,
            workers=workers,
            progress=keep,
        )
    console.print(
        climb_trials_table(done, f"{chosen.configuration.name} in {engine}, control: {control}")
    )
    if out is not None:
        if kind:
            save_climb_trials_picture(done, found.problem, chosen, out, kind)
            write_trial_page(done, found.problem, chosen, out)
        console.print(f"written to {out}", soft_wrap=True)


def _climb(problem: Problem) -> Problem:
    if problem.climb is None:
        raise ArgumentError(
            "problem", problem.source, "a problem with [climb]; trajopt solve others"
        )
    return problem


def _chosen(maneuver: Maneuver, name: str | None) -> Plan:
    """The best plan, or the one with this configuration's name."""
    if not maneuver.plans:
        raise ArgumentError(
            "problem", maneuver.problem.title, f"a manoeuvre with a plan; {maneuver.status}"
        )
    plans = {plan.configuration.name: plan for plan in maneuver.plans}
    if name is not None and name not in plans:
        why = "".join(
            f" ({name}: {r.reason})" for r in maneuver.refused if r.configuration.name == name
        )
        raise ArgumentError(
            "--configuration", name, "one that has a plan: " + ", ".join(plans) + why
        )
    return maneuver.plans[0] if name is None else plans[name]


COMMANDS = (plan, climb)  # what the command line gets from this system
