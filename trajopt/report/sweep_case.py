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
from trajopt.paths.path import Path
from trajopt.paths.spline import uniform_basis
from trajopt.report.files import made_folder, write_json
from trajopt.report.pictures import save_physics_picture, save_pictures
from trajopt.report.run_folder import write_solution, write_validation
from trajopt.report.style import (
    BLUE,
    MOST_LINES,
    VERMILION,
    in_style,
    legend_beside,
    new_figure,
    save_figure,
)
from trajopt.sweeps.cases import Case
from trajopt.sweeps.rows import DONE

if TYPE_CHECKING:
    from trajopt.sweeps.store import Store
    from trajopt.sweeps.sweepfile import SweepPlan

_SAME = 1e-9  # relative; a case solved again must cost what its row says, on any processor. chosen
_MOST_ARRAYS = 8  # panels of arrays.png, chosen
_SAMPLES = 200  # of a path that is drawn, chosen


def report_case(
    store: Store,
    prefix: str,
    folder: str | FilePath,
    plan: SweepPlan | None = None,
    kind: str = "png",
) -> list[FilePath]:
    """Write what there is to see of the one case whose identity starts with ``prefix``; returns the
    files.

    ``case.json`` and, for arrays beside the row, ``<name>.csv`` and ``arrays.png`` (pictures are of ``kind``). With ``plan``,
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
            files += _solved_again(run, case, row, place, kind)
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
            figure = arrays_figure(arrays, searched=bool(row.get("search")))
            files.append(save_figure(figure, place / f"arrays.{kind}"))
    return files


def arrays_figure(arrays: Mapping[str, Array], *, searched: bool = False) -> Figure:
    """Each array over its first index; over a column of times of the same length, where one is
    there.

    An array whose name ends in "pose" or "points" is drawn in the plane, to scale, points with the path through them
    where they were ``searched`` for. Raises ArgumentError without arrays.
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
        table = array.reshape(len(array), -1)
        if name.endswith(("pose", "points")) and table.shape[1] >= 2:
            _draw_plane(axes, name, table, searched=searched)
        else:
            _draw_columns(axes, table, clocks.get(len(array)))
        axes.set_title(name)
    for axes in figure.axes[len(shown) :]:
        axes.set_visible(False)
    return figure


def _draw_plane(axes: Axes, name: str, table: Array, *, searched: bool) -> None:
    points = name.endswith("points")
    if name == "control_points" and searched and len(table) > 2:
        path = Path(uniform_basis(len(table)), table[:, :2], None)
        line = path.position(np.linspace(path.start, path.end, _SAMPLES))
        axes.plot(line[:, 0], line[:, 1], label="path")
    look: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 4} if points else {}
    axes.plot(table[:, 0], table[:, 1], **look, color=VERMILION if points else BLUE)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.set_aspect("equal", adjustable="datalim")


def _draw_columns(axes: Axes, table: Array, clock: Array | None) -> None:
    for number, column in enumerate(table.T[:MOST_LINES]):
        axes.plot(
            np.arange(len(table)) if clock is None else clock,
            column,
            label=str(number) if table.shape[1] > 1 else None,
        )
    axes.set_xlabel("index (–)" if clock is None else "time (s)")
    axes.set_ylabel("value, as stored (–)")
    legend_beside(axes)


def _solved_again(
    run: ProblemRun, case: Case, row: Mapping[str, Any], place: FilePath, kind: str
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
    files = [place / "summary.json", *save_pictures(solution, place, kind)]
    if report is not None:
        write_validation(report, place, solution.problem.robot)
        files += save_physics_picture(solution, report, place, kind)
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
