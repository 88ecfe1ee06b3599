"""The SMDW thesis's tables and figures beside our own runs: `python -m
benchmarks.theses.smdw_tables [--quick]`.

Thesis, our re-run of its PSO (same options, sound actuator model), our exact planner; where they
differ the page says why. Climb counts come from the trial files of `python -m
benchmarks.theses.climb` and `benchmarks.theses.smdw_printed`, control from `python -m
benchmarks.theses.closed_loop`.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from benchmarks.common import OUT, PROBLEMS, ResultTable, provenance, publish
from benchmarks.theses import smdw_printed
from benchmarks.theses.climb_trials import NAMES
from benchmarks.theses.smdw_counts import headline, orders, regimes
from benchmarks.theses.smdw_figures import (
    TARGETS,
    Driven,
    climb_cells,
    driven,
    from_files,
    motions,
    wheel_and_set_ups,
)
from benchmarks.theses.smdw_geometry_tables import agreement, geometry
from benchmarks.theses.smdw_page import PACKAGES, Page
from benchmarks.theses.smdw_printed import TABLES as TABLES_6
from benchmarks.theses.smdw_printed import read
from benchmarks.theses.smdw_searches import (
    BETA,
    FIRST_BETA,
    FIRST_GAINS,
    GAINS,
    PSO,
    Swarms,
    scenario_searches,
    search_5_3,
    searches,
    swarms,
)
from benchmarks.theses.smdw_study import terminal_cost
from trajopt.arrays import fold
from trajopt.objectives.terminal import terminal_objective
from trajopt.optimize.search import minimize
from trajopt.problem import Problem, load_problem
from trajopt.report.style import in_style, save_figure
from trajopt.simulate.engine import ENGINES
from trajopt.systems.smdw.entry import WHEELS
from trajopt.systems.smdw.pictures import plans_figure
from trajopt.systems.smdw.planner import plan_climb
from trajopt.systems.smdw.thesis import through_drives

FIRST_GOAL = (2.0, 0.75, math.pi / 2)  # m, m, rad: Table 5.3
EXACT = 1e-6  # cost up to which a search counts as exact
SEARCH_COLUMNS = (
    "thesis",
    "recomputed from its deviations",
    "its PSO, re-run",
    "exact (P1, P2, heading free)",
)


def printed_cost(row: dict[str, str]) -> float:
    """Table 4.4 from printed deviations of Tables 5.5 and 5.6 (wheels 2 and 4)."""
    pose = np.array([float(row[k]) for k in ("dx_m", "dy_m", "dpsi_rad")])
    wheels = np.array([float(row[f"dtheta{i}_rad"]) for i in (1, 2, 3, 4)])
    return terminal_cost(pose, wheels, GAINS, np.array([0.0, BETA, 0.0, BETA]))


def _search_row(first: str, row: dict[str, str], duration: float, seed: int) -> tuple[str, ...]:
    exact, pso = (search_5_3(duration, name, seed)[1].fun for name in ("lattice", PSO))
    return (
        first,
        row["cost"],
        f"{printed_cost(row):.4f}",
        f"{pso:.4g}",
        f"{exact:.0e}" if exact < EXACT else f"none (best {exact:.2g})",
    )


def table_5_5(quick: bool) -> ResultTable:
    rows = [
        _search_row(row["time_s"], row, float(row["time_s"]), 0)
        for row in read("table_5_5_time_interval")[:: 5 if quick else 1]
    ]
    return ResultTable("Table 5.5: cost over time interval", ("T, s", *SEARCH_COLUMNS), rows)


def table_5_6(quick: bool) -> ResultTable:
    rows = [
        _search_row(row["test"], row, 1.0, int(row["test"]))
        for row in read("table_5_6_repeat_1s")[: 2 if quick else None]
    ]
    return ResultTable("Table 5.6: ten searches at 1 s", ("test", *SEARCH_COLUMNS), rows)


def figures_5_15(found: Swarms) -> ResultTable:
    """Costs printed under Figures 5.15-5.22, from the final states printed there, and of our
    re-runs."""
    rows = []
    ours = {"first": iter(found.first), "enhanced": iter(found.enhanced)}
    for row in read("figures_5_15_to_5_22"):
        first = row["implementation"] == "first"
        final = np.array([float(row[k]) for k in ("xf_m", "yf_m", "psif_rad")])
        wheels = np.array([float(row[f"theta{i}_rad"]) for i in (1, 2, 3, 4)])
        gains = np.full(4, FIRST_BETA) if first else np.array([0.0, BETA, 0.0, BETA])
        cost = terminal_cost(
            final - np.array(FIRST_GOAL), wheels, FIRST_GAINS if first else GAINS, gains
        )
        rerun = next(ours[row["implementation"]], None)
        rows.append(
            (
                row["figure"],
                row["implementation"],
                row["cost"],
                f"{cost:.4f}",
                "not run" if rerun is None else f"{rerun:.4g}",
            )
        )
    return ResultTable(
        "Figures 5.15-5.22: cost from the printed final states, and of the same search re-run",
        ("figure", "implementation", "thesis", "recomputed", "re-run"),
        rows,
    )


def tables_6(runs: Mapping[str, Driven]) -> ResultTable:
    """Final errors after open-loop execution in physics, scenario 1: mean and standard
    deviation."""
    rows = []
    for name, run in runs.items():
        printed = read(TABLES_6[name])
        thesis = np.array([[float(r[k]) for k in ("xf_m", "yf_m", "psif_rad")] for r in printed])
        shown = [WHEELS.index(w) for w in run.plan.configuration.critical]
        phases = np.array([[float(r[f"theta{i + 1}_rad"]) for i in shown] for r in printed])
        ours = np.array([a.pose[-1] for a in run.approaches]) - np.array(run.plan.target.pose)
        wheels = (
            np.array([a.wheel_angles[-1][shown] for a in run.approaches])
            - np.array(run.plan.target.wheels)[shown]
        )
        for who, errors, turned in (
            ("thesis", thesis - np.array(TARGETS[1][NAMES[name]]), phases),
            ("exact plan, open loop", ours, wheels),
        ):
            worst = np.abs(fold(turned))
            rows.append(
                (
                    name,
                    who,
                    *(
                        f"{m:+.3f} ({s:.3f})"
                        for m, s in zip(errors.mean(axis=0), errors.std(axis=0), strict=True)
                    ),
                    f"{np.median(worst):.2f}",
                )
            )
    return ResultTable(
        "Tables 6.2-6.4: final error of sub-test 1, mean (standard deviation)",
        ("configuration", "run", "x, m", "y, m", "yaw, rad", "median critical wheel error, rad"),
        rows,
    )


def scenarios() -> tuple[ResultTable, list[tuple[str, Figure]]]:
    """The thesis's six searches (Tables 6.1, 6.6): its PSO re-run against the exact planner;
    pictures of the plans."""
    rows: list[tuple[str, ...]] = []
    pictures = []
    for number in (1, 2):
        problem = load_problem(
            PROBLEMS / "smdw" / ("step_5cm.toml" if number == 1 else "step_3_5cm.toml")
        )
        maneuver = plan_climb(problem)
        worst = max(p.wheel_error for p in maneuver.plans)
        for name in ("lateral", "forward35", "forward45"):
            file = PROBLEMS / "smdw" / f"scenario_{number}_{name}.toml"
            rows.append(
                (
                    str(number),
                    name,
                    f"{_cost(through_drives(load_problem(file))):.3g}",
                    f"{worst:.0e}",
                    f"{maneuver.wall_time:.2f}",
                )
            )
        pictures.append(
            (
                f"scenario_{number}.png",
                plans_figure(
                    maneuver,
                    f"Scenario {number} (set-up of Figure {'6.3' if number == 1 else '6.10'}): all exact plans; "
                    "dashed: the space, dots: control points",
                ),
            )
        )
    return ResultTable(
        "Tables 6.1, 6.6: cost of the thesis's PSO (re-run) and the exact planner's wheel error",
        (
            "scenario",
            "configuration",
            "PSO's cost",
            "worst wheel error of all our plans, rad",
            "time for all plans, s",
        ),
        rows,
    ), pictures


def _cost(problem: Problem) -> float:
    objective = terminal_objective(problem)
    return minimize(objective, objective.bounds, optimizer=PSO, seed=0).fun


def _saved(folder: str, pictures: Iterable[tuple[str, Figure]]) -> list[str]:
    """Names of the pictures, written into ``folder`` as they come."""
    names = []
    (OUT / folder).mkdir(parents=True, exist_ok=True)
    for name, figure in pictures:
        save_figure(figure, OUT / folder / name)
        names.append(name)
    return names


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="every fifth row, 2 trials")
    quick = parser.parse_args(arguments).quick
    name = "smdw_tables" + ("_quick" if quick else "")
    cells, printed = climb_cells(), smdw_printed.kept()
    runs = {number: driven(number, 2 if quick else 10) for number in (1, 2)}
    with in_style():
        swarm = swarms(quick)
        made, plans = scenarios()
        pictures = _saved(
            name,
            [
                *from_files(),
                *wheel_and_set_ups(),
                ("swarms.png", swarm.figure),
                ("searches.png", searches(quick)),
                *scenario_searches(quick),
                *plans,
                *motions(runs, quick),
            ],
        )
    tables = {"headline": headline(cells), "order": orders(cells)} if cells else {}
    tables |= {
        "geometry": geometry(),
        "agreement": agreement(quick),
        "figures_5_15": figures_5_15(swarm),
        "table_5_6": table_5_6(quick),
        "table_5_5": table_5_5(quick),
        "scenarios": made,
        "tables_6": tables_6(runs[1]),
    }
    tables |= {"printed": smdw_printed.table(printed)} if printed else {}
    decided = regimes(ENGINES)
    tables |= {"phases": decided} if decided.rows else {}
    page = publish(name, list(tables.values()), packages=PACKAGES)
    page.write_text(
        Page(provenance(PACKAGES), cells, tables, name, pictures).text(), encoding="utf-8"
    )


if __name__ == "__main__":
    main()
