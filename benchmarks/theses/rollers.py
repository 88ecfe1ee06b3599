"""Deviation from kinematics and speed of the roller-level simulators ([guzman2015], section 5.3).

Run as ``python -m benchmarks.theses.rollers``: drives LOC8 5 m forward, lateral and diagonal at 1
to 5 km/h, on Mecanum and SMDW wheels, with every roller shape, in every engine. ``--quick`` takes 3
km/h only.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from benchmarks.common import provenance
from trajopt.report.files import markdown
from trajopt.robots import Robot, robot
from trajopt.robots.description import Shape
from trajopt.simulate.engine import ENGINES, Command, Recording
from trajopt.simulate.stepping import drive
from trajopt.simulate.straight import DIRECTIONS, deviation, straight_command
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

DISTANCE = 5.0  # m, [guzman2015] section 5.3
SPEEDS = (1.0, 2.0, 3.0, 4.0, 5.0)  # km/h, [guzman2015] Table 5.1
QUICK_SPEEDS = (3.0,)  # km/h, the thesis's climbing speed
WHEELS = ("Mecanum", "SMDW")
# A shape is called good where it stays within this share along and across in all its runs (chosen:
# the accuracy asked of the SMDW in pybullet).
GOOD = 0.03
KMH = 1.0 / 3.6  # m/s
FRICTION = 0.8  # chosen: that of the climbs
SHAPES: tuple[Shape, ...] = get_args(Shape)


@dataclass(frozen=True)
class Case:
    """One run to make."""

    engine: str
    wheel: str
    shape: Shape
    direction: str
    speed: float  # km/h


@dataclass(frozen=True)
class Row:
    """One run made: shares of the distance, yaw error, ripple of the wheel speed, speed of the
    engine."""

    case: Case
    along: float
    across: float
    yaw: float  # rad
    ripple: float  # rms wheel speed error at full speed over the commanded speed
    saturated: float  # share of the time in which a wheel is at its torque limit
    real_time_factor: float
    reason: str


def machine(wheel: str, shape: Shape) -> Robot:
    """LOC8 on the wheels called ``wheel`` with rollers of ``shape``."""
    name = "loc8" if wheel == "Mecanum" else "loc8-smdw"
    return robot(name, {"wheels.all.rollers.shape": shape})


def cases(speeds: Sequence[float], engines: Sequence[str]) -> list[Case]:
    """All combinations that exist (URDF, and so pybullet, has no ellipsoid)."""
    directions = [name for name, _ in DIRECTIONS]
    found = itertools.product(engines, WHEELS, SHAPES, directions, speeds)
    return [Case(*parts) for parts in found if parts[:3:2] != ("pybullet", "ellipsoid")]


def measure(case: Case) -> Row:
    """Drive one case and compare it with kinematics."""
    loc8 = machine(case.wheel, case.shape)
    direction = dict(DIRECTIONS)[case.direction]
    command = straight_command(loc8, direction, DISTANCE, case.speed * KMH)
    run = drive(loc8, Scene(FRICTION, Flat()), command, engine=case.engine)
    off = deviation(run, direction, DISTANCE)
    ripple, saturated = _effort(run, command, float(loc8.motor_array("torque")[0]))
    return Row(
        case, off.along, off.across, off.yaw, ripple, saturated, run.real_time_factor, run.reason
    )


def _effort(run: Recording, command: Command, limit: float) -> tuple[float, float]:
    """Ripple of the driven wheels at full speed, and the share of time with a wheel at its torque
    limit."""
    steady = (run.times > command.times[1]) & (run.times < command.times[-2])
    wanted = command.wheel_speeds[1]
    driven = np.abs(wanted) > 1e-6
    error = (run.wheel_speeds[steady][:, driven] - wanted[driven]) / np.abs(wanted[driven])
    at_limit = np.any(np.abs(run.wheel_torques[steady]) > 0.99 * limit, axis=1)
    if not np.any(steady):
        return math.inf, 1.0
    return float(np.sqrt(np.mean(error**2))), float(np.mean(at_limit))


HEADER = (
    "engine", "wheel", "rollers", "motion", "km/h", "along %", "across %", "yaw deg", "ripple %",
    "at torque limit %", "real-time factor", "note",
)  # fmt: skip


def cells(row: Row) -> tuple[str, ...]:
    """One row as text."""
    case = row.case
    return (
        case.engine,
        case.wheel,
        case.shape,
        case.direction,
        f"{case.speed:g}",
        f"{100 * row.along:+.2f}",
        f"{100 * row.across:+.2f}",
        f"{math.degrees(row.yaw):+.2f}",
        f"{100 * row.ripple:.2f}",
        f"{100 * row.saturated:.1f}",
        f"{row.real_time_factor:.2f}",
        row.reason,
    )


SUMMARY_HEADER = (
    "engine", "wheel", "rollers", "worst along %", "worst across %", "worst ripple %",
    "at torque limit %", "median real-time factor", "verdict",
)  # fmt: skip


def summary(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """Worst values over motions and speeds for each engine, wheel and shape."""
    lines: list[tuple[str, ...]] = []
    for key in dict.fromkeys((r.case.engine, r.case.wheel, r.case.shape) for r in rows):
        group = [r for r in rows if (r.case.engine, r.case.wheel, r.case.shape) == key]
        along = max((r.along for r in group), key=abs)
        across = max((r.across for r in group), key=abs)
        good = max(abs(along), abs(across)) <= GOOD and not any(r.reason for r in group)
        lines.append(
            (
                *key,
                f"{100 * along:+.2f}",
                f"{100 * across:+.2f}",
                f"{100 * max(r.ripple for r in group):.1f}",
                f"{100 * float(np.mean([r.saturated for r in group])):.1f}",
                f"{float(np.median([r.real_time_factor for r in group])):.2f}",
                f"within {100 * GOOD:g} %" if good else "fails",
            )
        )
    return lines


def write(rows: Sequence[Row], conditions: str, folder: Path) -> None:
    """``rollers.csv`` and ``rollers.md`` in ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "rollers.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow((*HEADER, "conditions"))
        writer.writerows((*cells(row), conditions) for row in rows)
    lines = [
        "# Roller shapes in the simulators",
        "",
        f"LOC8 over {DISTANCE:g} m, friction {FRICTION:g}. Spheres are the package's default. Real-time "
        "factors are of wall time: other load lowers them. " + conditions,
        "",
    ]
    for title, header, body in (
        ("Worst over motions and speeds", SUMMARY_HEADER, summary(rows)),
        ("All runs", HEADER, [cells(row) for row in rows]),
    ):
        lines += [f"## {title}", "", *markdown(header, body), ""]
    (folder / "rollers.md").write_text("\n".join(lines), encoding="utf-8")


def show(rows: Sequence[Row], conditions: str, console: Console) -> None:
    """Both tables on the terminal."""
    for title, header, body in (
        ("Roller shapes, all runs", HEADER, [cells(row) for row in rows]),
        ("Worst over motions and speeds", SUMMARY_HEADER, summary(rows)),
    ):
        table = Table(*header, title=title, caption=conditions)
        for line in body:
            table.add_row(*line)
        console.print(table)


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.theses.rollers", description=__doc__
    )
    parser.add_argument("--quick", action="store_true", help="3 km/h only")
    parser.add_argument(
        "--engine", choices=ENGINES, action="append", help="only this engine (repeatable)"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out/benchmarks"), help="folder of the results"
    )
    chosen = parser.parse_args(arguments)
    console = Console()
    todo = cases(QUICK_SPEEDS if chosen.quick else SPEEDS, chosen.engine or ENGINES)
    rows = [measure(case) for case in track(todo, description="driving", console=console)]
    conditions = provenance(("pybullet", "mujoco", "numpy"))
    show(rows, conditions, console)
    write(rows, conditions, chosen.out)
    console.print(f"written: {chosen.out / 'rollers.md'} and rollers.csv")


if __name__ == "__main__":
    main()
