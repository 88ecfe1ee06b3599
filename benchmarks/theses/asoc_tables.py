"""[udengaard2008] (active split offset casters) reproduced: tables and figures, printed values
beside ours.

Run as ``python -m benchmarks.theses.asoc_tables``. ``--quick`` takes coarser quadrature, fewer
seeds and no physics.
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.common import ResultTable, publish
from benchmarks.theses.asoc_designs import optimizers, pareto
from benchmarks.theses.asoc_draw import draw, mean, ring
from benchmarks.theses.asoc_reference import (
    FIGURE_9,
    FIGURE_11,
    TABLE_1,
    TABLE_2,
    TABLE_4,
    TABLE_5,
    TABLE_6,
)
from benchmarks.theses.asoc_study import best_ratio, best_width, full_factorial
from benchmarks.theses.asoc_suspension import POINT_DESIGN, FourBar, Linkage, suspension_travel
from benchmarks.theses.asoc_tables_tracking import (
    FULL,
    QUICK,
    Effort,
    physics,
    physics_knowledge,
    tables_9_and_10,
)
from benchmarks.theses.textbook import TEXTBOOK
from trajopt.robots.mobility import mobility_of
from trajopt.systems.asoc.design import TERMS, AsocDesign, Model
from trajopt.systems.asoc.isotropy import Contact, spread_modules
from trajopt.systems.asoc.modules import largest_pivot
from trajopt.systems.asoc.run import AsocRun
from trajopt.systems.asoc.soil import soil_named

PACKAGES = ("trajopt", "numpy", "scipy", "casadi", "pymoo", "mujoco", "pybullet")
BASELINE = (0.15, 0.20, 0.15, 0.03)  # m, Table VI: offset, split, radius, width


def mobility() -> ResultTable:
    rows = []
    for name, robot in TEXTBOOK.items():
        m = mobility_of(robot)
        rows.append((name, str(m.mobility), str(m.steerability), str(m.manoeuvrability)))
    return ResultTable(
        "Mobility of the textbook robots",
        ("robot", "mobility", "steerability", "manoeuvrability"),
        rows,
    )


def table_1(effort: Effort) -> ResultTable:
    """Every distinct placement of lost and partial modules; the thesis averages them in a way it
    does not say."""
    rows = []
    for (modules, lost, partial), printed in TABLE_1.items():
        seen: dict[float, str] = {}
        for gone in itertools.combinations(range(modules), lost):
            if lost and gone[0] != 0:
                continue
            rest = [i for i in range(modules) if i not in gone]
            for half in itertools.combinations(rest, partial):
                value = mean(spread_modules(modules), 2.0, effort, contact=Contact(gone, half))
                seen.setdefault(
                    round(value, 2), f"{value:.4f} (lost {list(gone)}, partial {list(half)})"
                )
        rows.append(
            (str(modules), str(lost), str(partial), f"{printed:.3f}", "; ".join(seen.values()))
        )
    return ResultTable(
        "Table I: isotropy under loss of contact",
        ("ASOCs", "lost", "partial", "printed", "ours"),
        rows,
    )


def table_2(effort: Effort) -> ResultTable:
    rows = []
    for degrees, (printed, ratio) in TABLE_2.items():
        tilt = np.radians(degrees)
        tilts = (-tilt, 0.0, tilt) if degrees else (0.0,)
        ratios = np.arange(1.9, 3.2, 0.05)
        quick = replace(effort, points=max(effort.points // 4, 256))
        values = np.array(
            [
                mean(spread_modules(4), float(r), quick, tilts=tilts, jacobian="forward")
                for r in ratios
            ]
        )
        top, value = best_ratio(values, ratios)
        rows.append((f"{degrees}", f"{printed:.3f}", f"{ratio:.2f}", f"{value:.4f}", f"{top:.2f}"))
    return ResultTable(
        "Table II: best isotropy and ratio by terrain angle (N = 4, tilts -max, 0, +max)",
        ("angle, deg", "printed isotropy", "printed ratio", "isotropy", "ratio"),
        rows,
    )


def figures_9_and_11(effort: Effort) -> ResultTable:
    rows = [
        ("Figure 9", f"ratio {r:g}", f"{v:.3f}", f"{mean(spread_modules(3), r, effort):.4f}")
        for r, v in FIGURE_9.items()
    ]
    rows += [
        (
            "Figure 11",
            f"modules at 0, {a}, {2 * a} deg",
            f"{v:.3f}",
            f"{mean(ring(a, 2 * a), 2.0, effort):.4f}",
        )
        for a, v in FIGURE_11.items()
    ]
    rows += [
        (
            "eq. 4",
            f"tilt {d} deg, ratio {2 / np.cos(np.radians(d)):.4f}",
            "1.000",
            f"{mean(spread_modules(3), float(2 / np.cos(np.radians(d))), effort, tilts=(np.radians(d),)):.4f}",
        )
        for d in (15, 30, 45)
    ]
    rows += [
        (
            "eq. 8",
            "split 0.20, offset 0.10, radius 0.20 m",
            "30",
            f"{np.degrees(largest_pivot(0.1, 0.2, 0.2)):.2f}",
        ),
        (
            "section 3.5",
            "point design's pivot, deg",
            "30",
            f"{np.degrees(largest_pivot(POINT_DESIGN.offset, POINT_DESIGN.split, POINT_DESIGN.wheel_radius)):.2f}",
        ),
    ]
    for kind in Linkage:
        travel = suspension_travel(kind, FourBar(), POINT_DESIGN)
        rows.append(
            (
                "section 3.4",
                f"travel of the {kind.value} linkage, m",
                "0.33" if kind is Linkage.SHAPED_SPLIT else "-",
                f"{travel.up:.3f} up ({travel.up_end}), {travel.down:.3f} down ({travel.down_end})",
            )
        )
    return ResultTable("Isotropy curves and geometry", ("where", "case", "printed", "ours"), rows)


def table_5() -> ResultTable:
    rows = []
    for soil, printed in TABLE_5.items():
        offset, split, radius, width = printed
        for model in Model:
            design = AsocDesign(soil_named(soil), model=model)
            best, total = full_factorial(design)
            base = design.terms(BASELINE[0], BASELINE[1], 1e-9, BASELINE[3])[3]
            fit = best_width(design, offset, split, radius)
            gain = 100 * (design.terms(offset, split, radius - offset, fit)[3] / base - 1)
            rows.append(
                (
                    soil,
                    model.value,
                    f"{width:.3f}",
                    f"{fit:.4f}",
                    f"{100 * (fit / width - 1):+.1f} %",
                    f"{TABLE_6[soil]:.1f}",
                    f"{gain:.1f}",
                    " ".join(f"{v:.3f}" for v in (best[0], best[1], best[0] + best[2], best[3])),
                    f"{total:.4f}",
                )
            )
    return ResultTable(
        "Tables V, VI: wheel width and gain of d_max at the printed other sizes; optimum of J on "
        "our design space",
        (
            "soil",
            "reading",
            "printed width, m",
            "width, m",
            "difference",
            "printed gain, %",
            "gain, %",
            "optimum offset split radius width, m",
            "J",
        ),
        rows,
    )


def table_4() -> ResultTable:
    rows = []
    for model in Model:
        found = {}
        for modules in (3, 4, 5):
            design = AsocDesign(soil_named("sandy_loam"), modules, model)
            found[modules] = design.describe(full_factorial(design)[0])
        for modules in (4, 5):
            change = [
                f"{100 * (found[modules][t] / found[3][t] - 1):+.1f} ({p:+.1f})"
                for t, p in zip(TERMS, TABLE_4[modules], strict=True)
            ]
            rows.append((model.value, str(modules), *change))
    return ResultTable(
        "Table IV: change against three ASOCs at the optimum of J, percent (printed)",
        ("reading", "ASOCs", *TERMS),
        rows,
    )


NOTES = (
    "Errors: RMS distance from the point that was due at the time; 'across' is the distance from the nearest point "
    "of the path. +- is a 95 % interval over seeds. The thesis does not define its error.",
    "Table I: 2 ASOCs with one partial (.464 printed) and 4 with two lost (.265) differ by the thesis's own average, "
    "which had not converged. Table II's last ratio (2.70 printed) lies at 2/cos(45 deg) = 2.83.",
    "Tables V, VI: the printed widths follow when wheel mass lacks pi and resistance lacks the diameter (reading "
    "'thesis'). The optimum of J itself depends on the bounds of the design space, which are not printed: not met, "
    "not tuned. Table IV and column K of Table VI are not reproduced.",
    "Section 3.5's pivot is 39.2 deg by eq. 8, not the printed 30. Linkage sizes are chosen: none are printed.",
    "Tables IX, X: order and trend are the result; absolute values depend on inertias, gains and mesh that are not "
    "printed, nor is Table X's sigma. Three commands: 1.5 m/s at friction 0.6, the same with wheels that never slide "
    "('no slip'), and planned corners at friction 0.6. The paired table compares the same fields; 20 of them, since "
    "with 10 the smallest differences lie within their intervals.",
    "Roughness (IX): at 1.5 m/s the error grows in every step, with slip and without (there the first step is 0.01 %, "
    "which time steps of 20 ms no longer show). With planned corners it is the same at 0 and 1.5 cm: what the motors "
    "lag behind is all there is; from 1.5 cm on it grows.",
    "Knowledge (X): without slip and with planned corners all four comparisons hold. What an absolute position is "
    "worth there when the ground is known rests on creep (chosen: 5 % at a pull of 0.6) and on wheels in the air: "
    "odometry sees neither, and without them it would be exact. At friction 0.6 and 1.5 m/s only the absolute "
    "position shows: every corner slides by more than knowledge of the ground is worth, odometry does not see it, and"
    " a robot that ignores the ground drives short, which makes up for part of the slide.",
    "Level ground at 1.5 m/s, 21.1 % where 8.67 is printed: in a corner one wheel of each module brakes and the other "
    "holds the axle, so the robot gets mu g/sqrt(2) = 4.2 m/s^2 for a change of velocity of 2.1 m/s and ends 0.53 m "
    "from the point that is due (2.1^2/(2 4.2); pybullet 0.52, MuJoCo 0.61), half outside the path, half late: of the "
    "21.1 %, 14.6 are across the path and 15.2 along it. A point mass with mu g/sqrt(2) and the same feedback ends at "
    "22.2 %, even one with all of mu g at 14.0 %: by this definition 8.67 % is out of reach at friction 0.6 with this "
    "command and feedback.",
    "Physics: in MuJoCo wheels hop on 3 cm bumps (half of the time off the ground), and what odometry then misses "
    "hides what terrain knowledge is worth by dead reckoning.",
    "Optimizers: the thesis's swarms have no inertia weight below 1, so nothing damps them. The first flies out of the "
    "space for good within some 200 iterations; the second, reset to the space, samples on. One swarm ends 1 to 3 % "
    "short whatever its budget; restarted from the best candidate after 20 iterations without improvement both come "
    "within 1 %.",
)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--quick", action="store_true", help="coarser quadrature, fewer seeds, no physics"
    )
    effort = QUICK if parser.parse_args(arguments).quick else FULL
    began = time.perf_counter()
    front_table, front, design = pareto(effort)
    tables = [
        mobility(),
        table_1(effort),
        table_2(effort),
        figures_9_and_11(effort),
        table_4(),
        table_5(),
        optimizers(effort),
        front_table,
        *tables_9_and_10(effort),
    ]
    physical: list[tuple[str, AsocRun]] = []
    if effort.physics:
        table, physical = physics(effort)
        tables += [table, physics_knowledge(effort)]
    draw(effort, front, design, physical)
    notes = (*NOTES, f"The page took {(time.perf_counter() - began) / 60:.1f} minutes.")
    publish(
        "asoc_tables" if effort is FULL else "asoc_tables_quick",
        tables,
        packages=PACKAGES,
        notes=notes,
    )


if __name__ == "__main__":
    main()
