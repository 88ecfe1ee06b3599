"""Climb trials as a short table, a CSV file and a picture."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from rich import box
from rich.table import Table

from trajopt.arrays import Array
from trajopt.problem import Problem
from trajopt.provenance import commit, run_facts, versions
from trajopt.report.files import made_folder, write_json, write_text
from trajopt.report.intervals import wilson
from trajopt.report.viewer.motion import STEP, planned, recorded_columns, simulated
from trajopt.systems.smdw.entry import step_of
from trajopt.systems.smdw.planner import Plan
from trajopt.systems.smdw.trials import ClimbTrial

COLUMNS = (
    "number",
    "friction",
    "position_m",
    "yaw_rad",
    "phase_rad",
    "moved_back_m",
    "critical_up",
    "first_attempt",
    "all_up",
    "exploded",
    "reason",
)


def climb_trials_table(trials: Sequence[ClimbTrial], title: str) -> Table:
    """Final errors of the approaches (median, worst) and the share of climbs with Wilson's 95 %
    interval."""
    table = Table(
        title=title, box=box.SIMPLE, show_header=False, title_justify="left", pad_edge=False
    )
    arrived = [t.ending for t in trials if not t.ending.exploded]
    for name, values, unit in (
        ("final position error", [1e3 * e.position for e in arrived], "mm"),
        ("final yaw error", [math.degrees(e.yaw) for e in arrived], "deg"),
        ("critical wheel error", [e.phase for e in arrived], "rad"),
    ):
        if values:
            table.add_row(
                name, f"median {np.median(values):.3g} {unit}, worst {max(values):.3g} {unit}"
            )
    sound = [t.outcome for t in trials if t.outcome is not None and not t.exploded]
    for name, what in (
        ("critical wheels up", "critical_up"),
        ("at the first attempt", "first_attempt"),
        ("all four wheels up", "all_up"),
    ):
        up = sum(bool(getattr(o, what)) for o in sound)
        low, high = wilson(up, len(sound))
        table.add_row(name, f"{up} of {len(sound)} ({low:.0%} to {high:.0%})")
    lost = len(trials) - len(sound)
    if lost:
        table.add_row("left physics, not counted", str(lost))
    return table


def write_climb_trials(
    trials: Sequence[ClimbTrial], folder: FilePath, facts: dict[str, Any]
) -> FilePath:
    """Write trials.csv, one row a trial, and trials.json (``facts``, versions, commit, machine)
    into ``folder``; the path of trials.csv."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for t in trials:
        e, o = t.ending, t.outcome
        up = ("", "", "") if o is None else (o.critical_up, o.first_attempt, o.all_up)
        reason = t.approach.reason if o is None else o.reason
        writer.writerow(
            [
                t.number,
                t.friction,
                e.position,
                e.yaw,
                e.phase,
                t.moved_back,
                *up,
                t.exploded,
                reason,
            ]
        )
    file = made_folder(folder) / "trials.csv"
    write_text(file, text.getvalue())
    write_json(
        folder / "trials.json",
        {**facts, "versions": versions(), "commit": commit(), "run": run_facts()},
    )
    return file


def save_climb_trials_picture(
    trials: Sequence[ClimbTrial], problem: Problem, plan: Plan, folder: FilePath, kind: str = "png"
) -> FilePath:
    """Draw approaches and climbs from above into trials.png, or of another ``kind``; its path.

    A step in another direction is drawn turned, so that its normal points along x. Runs that left
    physics are not drawn.
    """
    from trajopt.report.style import in_style, save_figure
    from trajopt.systems.smdw.trial_pictures import Motions, motions_figure

    step, sound = step_of(problem), [t for t in trials if t.climb is not None and not t.exploded]
    edge = float(np.array(step.normal) @ np.array(step.place))
    ups = [t.outcome is not None and t.outcome.critical_up for t in sound]
    planned = _turned(plan.trajectory.at(np.linspace(0.0, plan.duration, 200)).pose, step.direction)
    note = "" if step.direction == 0.0 else "\n(turned: the step's normal points along x)"
    panels = [
        Motions(
            f"{plan.configuration.name}: approach",
            [_turned(t.approach.pose, step.direction) for t in sound],
            [True] * len(sound),
            planned,
            edge,
            "dashed: the plan" + note,
        ),
        Motions(
            "climb",
            [_turned(t.climb.pose, step.direction) for t in sound if t.climb is not None],
            ups,
            None,
            edge,
            f"blue: critical wheels up, {sum(ups)} of {len(sound)}",
        ),
    ]
    with in_style():
        figure = motions_figure(panels, problem.robot, columns=2)
        return save_figure(figure, made_folder(folder) / f"trials.{kind}")


def write_trial_page(
    trials: Sequence[ClimbTrial], problem: Problem, plan: Plan, folder: FilePath
) -> FilePath | None:
    """Write view.html of the first trial that stayed in physics: the plan, and the approach with
    the climb after it. None where no trial did."""
    from trajopt.report.viewer.motion_page import VIEW, view_data
    from trajopt.report.viewer.pages import write_page

    trial = next((t for t in trials if t.climb is not None and not t.exploded), None)
    if trial is None or trial.climb is None or trial.outcome is None:
        return None
    first, then = (recorded_columns(r, problem.robot) for r in (trial.approach, trial.climb))
    then["t_s"] = then["t_s"] + first["t_s"][-1] + STEP
    table = {name: np.concatenate([first[name], then[name]]) for name in first}
    driven = simulated(table, problem.robot, f"simulated ({trial.approach.engine})")
    ending = "critical wheels up" if trial.outcome.critical_up else trial.outcome.reason
    data = view_data(
        problem.robot, problem.scene, [planned(plan.trajectory), driven], problem.title,
        f"{plan.configuration.name}, trial {trial.number}, friction {trial.friction:.2f}: {ending}",
        plan.trajectory,
    )  # fmt: skip
    return write_page("motion", data, made_folder(folder) / VIEW)


def _turned(pose: Array, direction: float) -> Array:
    """Poses (N, 3) in axes turned by ``direction`` (rad)."""
    cos, sin = math.cos(direction), math.sin(direction)
    return np.column_stack(
        [
            cos * pose[:, 0] + sin * pose[:, 1],
            cos * pose[:, 1] - sin * pose[:, 0],
            pose[:, 2] - direction,
        ]
    )
