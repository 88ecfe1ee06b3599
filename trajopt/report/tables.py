"""Short tables for the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich import box
from rich.markup import escape
from rich.table import Table

from trajopt.pipeline import Solution
from trajopt.report.run_folder import binding_shares, wheel_names

if TYPE_CHECKING:
    from trajopt.simulate.check import ValidationReport


def solution_table(solution: Solution) -> Table:
    """Cost with its terms, duration, margins with the limit that binds, evaluations, status."""
    search = solution.search
    table = _table(solution.problem.title)
    unit = " s" if solution.problem.objective.kind == "duration" else ""
    table.add_row("cost", f"{_number(solution.cost)}{unit}")
    if len(solution.terms) > 1:
        for name, value in solution.terms.items():
            table.add_row(f"  {escape(name)}", _number(value))
    if not search.violation <= 0.0:
        table.add_row("violation", _number(search.violation))
    for i, point in enumerate(solution.control_points[1:-1], start=1):
        table.add_row(f"P{i}", f"({point[0]:.4f}, {point[1]:.4f}) m, yaw {point[2]:.4f} rad")
    table.add_row(
        "duration", "none" if solution.trajectory is None else f"{solution.duration:.4f} s"
    )
    _margin_rows(table, solution)
    for name, value in zip(
        wheel_names(len(solution.dead_zone_effect)), solution.dead_zone_effect, strict=True
    ):
        drives = solution.problem.actuator
        if drives.dead_zone > 0 and not drives.enabled and name in solution.problem.goal.critical:
            table.add_row(
                f"dead-zone would add, {name}",
                f"{value:+.4f} rad" if np.isfinite(value) else "none",
            )
    table.add_row("optimizer", escape(search.optimizer))
    failed = f", {search.failures} failed" if search.failures else ""
    table.add_row(
        "evaluations", f"{search.nfev}{failed}, {search.nit} iterations, {solution.wall_time:.2f} s"
    )
    verdict = "[green]holds[/green]" if solution.holds else "[red]does not hold[/red]"
    table.add_row("status", f"{verdict}: {escape(search.message)}")
    return table


def validation_table(report: ValidationReport) -> Table:
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
    for name, value in zip(
        wheel_names(len(report.wheel_deviation)), report.wheel_deviation, strict=True
    ):
        table.add_row(f"wheel {name}", f"{1e3 * value:+.3f} mrad")
    table.add_row("real-time factor", f"{report.real_time_factor:.2f}")
    return table


def _table(title: str) -> Table:
    table = Table(
        title=escape(title),
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
            table.add_row("limits", f"[red]{escape(str(solution.infeasible))}[/red]")
        return
    shares = binding_shares(solution.trajectory)
    for name, margin in sorted(solution.margins.items(), key=lambda item: item[1]):
        binds = f", binds {shares[name]:.0%} of the time" if name in shares else ""
        text = (
            f"{max(margin, 0.0):.1%}{binds}"
            if margin > -1e-9
            else f"[red]broken by {-margin:.1%}[/red]"
        )
        table.add_row(f"margin {escape(name)}", text)


def _number(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else "none"
