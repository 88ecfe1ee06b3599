"""``trajopt explain | export | compare``: the timing of a problem with a given path, or of a saved
solution."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from trajopt.cli.shared import Force, Overrides, console, overrides, require_free, simple_table
from trajopt.errors import ArgumentError
from trajopt.report.words import words

if TYPE_CHECKING:
    from rich.table import Table

    from trajopt.timing.trajectory import Trajectory

Plan = Annotated[
    Path, typer.Argument(help="problem file (*.toml) or folder written by solve --out")
]


def explain(
    plan: Plan,
    set_: Overrides = None,
    engine: Annotated[str, typer.Option(help="auto, toppra or compiled")] = "auto",
) -> None:
    """Show which limit binds on which stretch, and what a 1 % change of each limit would save."""
    from trajopt.report.explained import explained

    facts = explained(_timed(plan, set_, engine))
    gap = facts["gap"]
    near = "" if gap is None else f", at most {100 * gap:.2g} % above the least time"
    console.print(
        words(
            (str(plan), "bold"),
            f": {facts['duration_s']:.4f} s over {facts['length_m']:.3f} m "
            f"({facts['engine']}, slowed by {facts['slowdown'] - 1:.1e}{near})",
        )
    )
    if facts["why_gap"]:
        console.print(f"no nearer proof of the least time: {facts['why_gap']}", soft_wrap=True)
    stretches = _table("from s (m)", "to s (m)", "limit that binds")
    for part in facts["stretches"]:
        stretches.add_row(f"{part['from_m']:.3f}", f"{part['to_m']:.3f}", part["limit"])
    limits = _table("limit", "least margin", "at s (m)", "1 % more saves (s)")
    for limit in facts["limits"]:
        saved = limit["one_percent_saves_s"]
        limits.add_row(
            limit["limit"],
            f"{limit['margin']:.2%}",
            f"{limit['at_m']:.3f}",
            "not time-optimal" if saved is None else f"{saved:.4f}",
        )
    extremes = _table("on the way", "up to", "at s (m)")
    for extreme in facts["on_the_way"]:
        extremes.add_row(extreme["what"], extreme["up_to"], f"{extreme['at_m']:.3f}")
    for table in (stretches, limits, extremes):
        if table.rows:
            console.print(table)
    console.facts(facts)


def export(
    plan: Plan,
    out: Annotated[Path, typer.Option(help="file to write")],
    format_: Annotated[
        str | None,
        typer.Option(
            "--format",
            help="csv, json (commands); mcap, rosbag (ROS 2); choreo; tum (race line); urdf, mjcf "
            "(the robot). Without: what the file's name says",
        ),
    ] = None,
    sample_time: Annotated[
        float | None,
        typer.Option(help="seconds between commands (0.5) or samples (by format)"),
    ] = None,
    rule: Annotated[
        str | None,
        typer.Option(help="of commands: mean (exact wheel angles) or held (as Waheed 2006)"),
    ] = None,
    set_: Overrides = None,
    force: Force = False,
) -> None:
    """Write a motion for other programs; as CSV: t (s), v_<wheel> (m/s at the rim),
    steering_<wheel> (rad) where it steers, vx, vy, wz of the body."""
    from trajopt.formats import export as write

    require_free("--out", out, force)
    told = write(_timed(plan, set_, "auto"), out, format_, sample_time=sample_time, rule=rule)
    console.print(f"wrote {told} to {out}", soft_wrap=True)


def compare(
    plan: Plan,
    log: Annotated[Path, typer.Argument(help="CSV with columns t, x, y, yaw, v")],
    set_: Overrides = None,
) -> None:
    """Compare a plan with the log of what the robot did, in the terms of Waheed 2006."""
    from trajopt.control.commands import compare_log

    found = compare_log(_timed(plan, set_, "auto"), log)
    table = simple_table(show_header=False)
    for name, value in (
        ("speed error", f"{found.speed_error:.4f} m/s"),
        ("heading error", f"{found.heading_error:.4f} rad"),
        ("goal offset", f"{found.goal_offset:.4f} m"),
        ("time offset", f"{found.time_offset:.3f} s"),
        ("distance", f"{found.distance:.3f} m"),
    ):
        table.add_row(name, value)
    console.print(table)


def _timed(plan: Path, set_: list[str] | None, engine: str) -> Trajectory:
    """The timed motion of a problem file, or of a run folder."""
    from trajopt.pipeline import solve
    from trajopt.problem import load_problem

    if plan.is_dir():
        from trajopt.report.run_folder import read_solution

        if set_ or engine != "auto":
            expected = "neither with a run folder; give the problem file instead"
            raise ArgumentError("--set, --engine", (set_, engine), expected)
        solution = read_solution(plan)
    else:
        solution = solve(load_problem(plan, overrides(set_)), engine=engine)
    if solution.trajectory is None:
        raise ArgumentError(
            "plan", str(plan), "a problem with a feasible motion; " + solution.status
        )
    return solution.trajectory


def _table(*columns: str) -> Table:
    """With words to the left and numbers to the right."""
    table = simple_table()
    for column in columns:
        left = column.startswith(("limit", "on the way"))
        table.add_column(column, justify="left" if left else "right")
    return table
