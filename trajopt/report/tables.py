"""Short tables for the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from rich import box
from rich.table import Table

from trajopt.optimize.base import OptimizeResult
from trajopt.report.motion import (
    MOST_ROWS,
    SAMPLE_TIME,
    binding_shares,
    sampled,
    turning_wheels,
)
from trajopt.report.words import words
from trajopt.robots.robot import Robot
from trajopt.solution import Solution

if TYPE_CHECKING:
    from trajopt.simulate.check import ValidationReport


def solution_table(solution: Solution) -> Table:
    """Cost with its terms, duration, margins with the limit that binds, evaluations, status."""
    search = solution.search
    table = _table(solution.problem.title)
    if search is not None:
        _search_rows(table, solution, search)
    if solution.path is not None:
        table.add_row("path length", f"{solution.path.length:.3f} m")
    table.add_row(
        "duration", "none" if solution.trajectory is None else f"{solution.duration:.4f} s"
    )
    if solution.trajectory is not None and solution.duration > SAMPLE_TIME * MOST_ROWS:
        table.add_row("trajectory.csv", sampled(solution.trajectory))
    if np.isfinite(solution.energy):
        table.add_row("work of the motors", f"{solution.energy:.4g} J")
    _margin_rows(table, solution)
    for name, facts in ({} if solution.details is None else solution.details.notes).items():
        table.add_row(words(name.replace("_", " ")), words(_facts(facts)))
    if search is not None:
        failed = f", {search.failures} failed" if search.failures else ""
        table.add_row("optimizer", words(search.optimizer))
        table.add_row("evaluations", f"{search.nfev}{failed}, {search.nit} iterations")
    table.add_row("time taken", f"{solution.wall_time:.2f} s")
    verdict = ("holds", "green") if solution.holds else ("does not hold", "red")
    table.add_row("status", words(verdict, f": {solution.status}"))
    return table


def _search_rows(table: Table, solution: Solution, search: OptimizeResult) -> None:
    unit = solution.problem.objective.unit
    table.add_row("cost", f"{_number(solution.cost)}{unit}")
    if len(solution.terms) > 1:
        for name, value in solution.terms.items():
            table.add_row(words(f"  {name}"), _number(value))
    if not search.violation <= 0.0:
        table.add_row("violation", _number(search.violation))
    for i, point in enumerate(solution.control_points[1:-1], start=1):
        table.add_row(f"P{i}", f"({point[0]:.4f}, {point[1]:.4f}) m, yaw {point[2]:.4f} rad")


def _facts(facts: Any) -> str:
    """Nested facts in one line."""
    if isinstance(facts, dict):
        return ", ".join(f"{name} {_facts(value)}" for name, value in facts.items())
    return f"{facts:.4g}" if isinstance(facts, float) else str(facts)


def validation_table(report: ValidationReport, robot: Robot) -> Table:
    """Deviations of the simulated from the planned motion."""
    feedback = "" if report.control is None else f", {report.control}, seed {report.seed}"
    table = _table(f"Check in {report.engine} {report.recording.version}{feedback}")
    share = 100 / report.length if report.length > 0 else np.nan
    table.add_row("path length", f"{report.length:.3f} m")
    table.add_row(
        "final error along", f"{1e3 * report.along:+.2f} mm ({share * report.along:+.2f} %)"
    )
    table.add_row(
        "final error across", f"{1e3 * report.across:+.2f} mm ({share * report.across:+.2f} %)"
    )
    table.add_row("final yaw error", f"{1e3 * report.yaw:+.2f} mrad")
    table.add_row(
        "off the path", f"rms {1e3 * report.path_rms:.2f} mm, most {1e3 * report.path_max:.2f} mm"
    )
    for name, value in zip(robot.wheel_names, report.wheel_deviation, strict=True):
        table.add_row(words(f"wheel {name}"), f"{1e3 * value:+.3f} mrad")
    worst = int(report.slip.argmax())
    table.add_row("most slip", words(f"{report.slip[worst]:.3f} m/s, wheel {report.wheels[worst]}"))
    if turning_wheels(robot):
        error, names = report.steering_error, turning_wheels(robot)
        name = max(names, key=lambda name: error[report.wheels.index(name)])
        most = 1e3 * error[report.wheels.index(name)]
        table.add_row("most steering error", f"{most:.2f} mrad, wheel {name}")
    for hit in report.contacts:
        x, y = hit.place
        table.add_row(
            "contact", words(f"{hit.name} after {hit.time:.2f} s at ({x:.3f}, {y:.3f}) m")
        )
    table.add_row("real-time factor", f"{report.real_time_factor:.2f}")
    return table


def _table(title: str) -> Table:
    table = Table(
        title=words(title),
        title_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        show_header=False,
        pad_edge=False,
    )
    table.add_column(style="dim", no_wrap=True)
    table.add_column(overflow="fold")
    return table


def _margin_rows(table: Table, solution: Solution) -> None:
    if solution.trajectory is None:
        if solution.infeasible is not None:
            table.add_row("limits", words((str(solution.infeasible), "red")))
        return
    shares = binding_shares(solution.trajectory)
    for name, margin in sorted(solution.margins.items(), key=lambda item: item[1]):
        binds = f", binds {shares[name]:.0%} of the time" if name in shares else ""
        text = (
            words(f"{max(margin, 0.0):.1%}{binds}")
            if margin > -1e-9
            else words((f"broken by {-margin:.1%}", "red"))
        )
        table.add_row(words(f"margin {name}"), text)


def _number(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else "none"
