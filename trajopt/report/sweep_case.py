"""One case out of a sweep: its row as JSON, its arrays as CSV, and its pictures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trajopt.arrays import Array
from trajopt.case import ProblemRun, run_case, seed_of, solve_case
from trajopt.errors import ArgumentError
from trajopt.files import file_name, whole_file
from trajopt.report.files import made_folder, write_json
from trajopt.report.pictures import save_physics_picture, save_pictures
from trajopt.report.run_folder import write_solution, write_validation
from trajopt.report.style import in_style, legend_beside, new_figure, save_figure
from trajopt.sweeps.cases import Case
from trajopt.sweeps.rows import DONE

if TYPE_CHECKING:
    from trajopt.sweeps.store import Store
    from trajopt.sweeps.sweepfile import SweepPlan

_SAME = 1e-9  # relative; a case solved again must cost what its row says, on any processor. chosen
_MOST_ARRAYS, _MOST_LINES = 8, 8  # panels of arrays.png and lines in one of them; chosen


def report_case(
    store: Store, prefix: str, folder: str | FilePath, plan: SweepPlan | None = None
) -> list[FilePath]:
    """Write what there is to see of the one case whose identity starts with ``prefix``; returns the
    files.

    ``case.json`` and, for arrays beside the row, ``<name>.csv`` and ``arrays.png``. With ``plan``,
    a finished case of a problem file is solved again (the same seed, so the same result) and gets
    the run folder and the pictures of ``trajopt solve``, and of ``trajopt validate`` where its row
    was driven. Raises StoreError for a case that is not there, ArgumentError for a plan that is
    another one's, or whose code now finds another cost.
    """
    row, arrays = store.case(prefix)
    place = made_folder(folder)
    files = []
    if plan is not None:
        case, run = _case(plan, str(row["case"])), plan.run
        if isinstance(run, ProblemRun) and run.func is run_case and row["status"] == DONE:
            files += _solved_again(run, case, row, place)
    write_json(
        place / "case.json",
        {
            **{k: _plain(v) for k, v in row.items() if v is not None},
            "arrays": {name: list(a.shape) for name, a in arrays.items()},
        },
    )
    files.append(place / "case.json")
    for name, array in arrays.items():
        table = array.reshape(len(array), -1) if array.ndim else array.reshape(1, 1)
        files.append(place / f"{file_name(name)}.csv")
        with whole_file(files[-1]) as part:
            np.savetxt(part, table, delimiter=",", fmt="%.17g")
    if arrays:
        with in_style():
            files.append(save_figure(arrays_figure(arrays), place / "arrays.png"))
    return files


def arrays_figure(arrays: Mapping[str, Array]) -> Figure:
    """Each array over its first index; over a column of times of the same length, where one is
    there.

    An array whose name ends in "pose" or "points" is drawn in the plane, to scale. Raises
    ArgumentError without arrays.
    """
    clocks = {len(a): a for n, a in arrays.items() if n.endswith("times") and a.ndim == 1}
    shown = [(n, a) for n, a in sorted(arrays.items()) if a.ndim and not n.endswith("times")][
        :_MOST_ARRAYS
    ]
    if not shown:
        raise ArgumentError("arrays", sorted(arrays), "at least one array besides times")
    columns = min(2, len(shown))
    rows = math.ceil(len(shown) / columns)
    figure = new_figure(0.3 + 2.6 * rows)
    for axes, (name, array) in zip(
        figure.subplots(rows, columns, squeeze=False).ravel(), shown, strict=False
    ):
        _draw(axes, name, array.reshape(len(array), -1), clocks.get(len(array)))
    for axes in figure.axes[len(shown) :]:
        axes.set_visible(False)
    return figure


def _draw(axes: Axes, name: str, table: Array, clock: Array | None) -> None:
    axes.set_title(name)
    if name.endswith(("pose", "points")) and table.shape[1] >= 2:
        axes.plot(table[:, 0], table[:, 1], marker="o" if len(table) < 20 else None, markersize=3)
        axes.set_xlabel("x (m)")
        axes.set_ylabel("y (m)")
        axes.set_aspect("equal", adjustable="datalim")
        return
    for number, column in enumerate(table.T[:_MOST_LINES]):
        axes.plot(
            np.arange(len(table)) if clock is None else clock,
            column,
            label=str(number) if table.shape[1] > 1 else None,
        )
    axes.set_xlabel("index" if clock is None else "time (s)")
    legend_beside(axes)


def _solved_again(
    run: ProblemRun, case: Case, row: Mapping[str, Any], place: FilePath
) -> list[FilePath]:
    """Run folder and pictures of a case that was solved."""
    solution, report = solve_case(case, run.changed(case))
    if not math.isclose(solution.cost, row["cost"], rel_tol=_SAME, abs_tol=_SAME):
        raise ArgumentError(
            "cost",
            solution.cost,
            f"{row['cost']!r}, as the case's row says; it was run by other "
            "code (see the store's runs/*.json)",
        )
    write_solution(solution, place, seed=seed_of(case), command="trajopt report")
    files = [place / "summary.json", *save_pictures(solution, place)]
    if report is not None:
        write_validation(report, place, solution.problem.robot)
        files += save_physics_picture(solution, report, place)
    return files


def _case(plan: SweepPlan, identity: str) -> Case:
    places = np.flatnonzero(plan.table.ids == identity.encode())
    if not len(places):
        raise ArgumentError(
            "case",
            identity,
            "a case of this sweep file, problem and code version; give the store's "
            "directory instead to see what is stored",
        )
    return plan.table.take(places).rows()[0]


def _plain(value: Any) -> Any:
    return value.isoformat() if hasattr(value, "isoformat") else value
