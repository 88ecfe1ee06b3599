"""Climb trials as a short table, a CSV file and a picture."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path as FilePath

import numpy as np
from rich import box
from rich.table import Table

from trajopt.maneuver import Plan
from trajopt.maneuver_problem import ManeuverProblem
from trajopt.report.files import made_folder, write_text
from trajopt.simulate.climb import wilson
from trajopt.study.climb_trials import ClimbTrial

COLUMNS = ("number", "friction", "position_m", "yaw_rad", "phase_rad", "critical_up", "first_attempt", "all_up",
           "exploded", "reason")


def climb_trials_table(trials: Sequence[ClimbTrial], title: str) -> Table:
    """Final errors of the approaches (median, worst) and the share of climbs with Wilson's 95 % interval."""
    table = Table(title=title, box=box.SIMPLE, show_header=False, title_justify="left", pad_edge=False)
    arrived = [t.ending for t in trials if not t.ending.exploded]
    for name, values, unit in (("final position error", [1e3 * e.position for e in arrived], "mm"),
                               ("final yaw error", [math.degrees(e.yaw) for e in arrived], "deg"),
                               ("critical wheel error", [e.phase for e in arrived], "rad")):
        if values:
            table.add_row(name, f"median {np.median(values):.3g} {unit}, worst {max(values):.3g} {unit}")
    sound = [t.outcome for t in trials if t.outcome is not None and not t.exploded]
    for name, what in (("critical wheels up", "critical_up"), ("at the first attempt", "first_attempt"),
                       ("all four wheels up", "all_up")):
        up = sum(bool(getattr(o, what)) for o in sound)
        low, high = wilson(up, len(sound))
        table.add_row(name, f"{up} of {len(sound)} ({low:.0%} to {high:.0%})")
    lost = len(trials) - len(sound)
    if lost:
        table.add_row("left physics, not counted", str(lost))
    return table


def write_climb_trials(trials: Sequence[ClimbTrial], folder: FilePath) -> FilePath:
    """Write trials.csv into ``folder``, one row a trial; its path."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for t in trials:
        e, o = t.ending, t.outcome
        up = ("", "", "") if o is None else (o.critical_up, o.first_attempt, o.all_up)
        reason = t.approach.reason if o is None else o.reason
        writer.writerow([t.number, t.friction, e.position, e.yaw, e.phase, *up, t.exploded, reason])
    file = made_folder(folder) / "trials.csv"
    write_text(file, text.getvalue())
    return file


def save_climb_trials_picture(trials: Sequence[ClimbTrial], problem: ManeuverProblem, plan: Plan,
                              folder: FilePath) -> FilePath:
    """Draw approaches and climbs from above into trials.png; its path."""
    from trajopt.report.smdw_trials import Motions, motions_figure
    from trajopt.report.style import in_style, save_figure

    edge = problem.obstacle.place[0] if problem.obstacle.direction == 0.0 else None  # drawn for steps along +x
    planned = plan.trajectory.at(np.linspace(0.0, plan.duration, 200)).pose
    climbs = [(t.climb.pose, t.outcome.critical_up) for t in trials if t.climb is not None and t.outcome is not None]
    up = sum(good for _, good in climbs)
    panels = [Motions(f"{plan.configuration.name}: approach", [t.approach.pose for t in trials],
                      [not t.ending.exploded for t in trials], planned, edge, "dashed: the plan")]
    if climbs:
        panels.append(Motions("climb", [pose for pose, _ in climbs], [good for _, good in climbs], None, edge,
                              f"blue: critical wheels up, {up} of {len(climbs)}"))
    with in_style():
        return save_figure(motions_figure(panels, problem.platform, columns=2), made_folder(folder) / "trials.png")
