"""Time scaling: our compiled engine against toppra and copp-py, in one run on one machine.

Run as ``python -m benchmarks.peers.time_scaling``. ``--quick`` takes fewer repetitions and stops at
10,000 points.

All engines solve the same rows on the same gridpoints in the interpolation scheme. Times are the
best of the repetitions, without building the rows, unless a row of the table says so.
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.common import OUT, ResultTable, publish
from benchmarks.peers.time_scaling_calls import calls, cold
from benchmarks.peers.time_scaling_cases import (
    ACCELERATION,
    SPEED,
    coordinate_rows,
    coordinate_stages,
    curve,
    force_stages,
    robot,
)
from benchmarks.peers.timing_picture import growth_exponent, growth_figure
from trajopt.arrays import Array
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.tip import Tip
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.report.style import in_style, save_figure
from trajopt.timing.compiled import compiled_profile, fastest_profiles
from trajopt.timing.scaling import time_scale
from trajopt.timing.stages import Stages
from trajopt.timing.toppra import toppra_profile

FIGURES = OUT / "time_scaling"
PACKAGES = ("trajopt", "numpy", "numba", "toppra", "copp-py")
POINTS = 1001
BATCH, BATCH_POINTS = 4000, 200  # profiles, points of each
SIZES = (100, 300, 1000, 3000, 10_000, 30_000, 100_000)
TOPPRA_UP_TO = 3000  # points; above, one run of toppra takes seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--quick", action="store_true", help="fewer repetitions, at most 10,000 points"
    )
    parser.add_argument("--calls", action="store_true", help="whole calls and new processes alone")
    options = parser.parse_args()
    quick = options.quick
    repetitions = 20 if quick else 200
    waited = [calls(10 if quick else 60), cold(10 if quick else 50)]
    if options.calls:
        for table in waited:
            print(table.title, *(" | ".join(entries) for entries in table.rows), sep="\n")
        return
    grown, note = growth(quick)
    tables = [
        *waited,
        with_forces(repetitions),
        coordinates(repetitions),
        batch(1 if quick else 3),
        whole_call(3 if quick else 10),
        grown,
    ]
    publish(
        "time_scaling",
        tables,
        packages=PACKAGES,
        notes=[
            "Ratios compare within this run. copp-py has no slip, tip or wheel rows. s'^2 differs from toppra's by "
            "what toppra takes off on purpose at each step (1e-8).",
            note,
        ],
    )


def best(run: Callable[[], Any], repetitions: int) -> float:
    """Least seconds of one run, after one for warming up."""
    run()
    times = []
    for _ in range(repetitions):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return min(times)


def duration(stages: Stages, sd2: Array) -> float:
    sd = np.sqrt(sd2)
    return float(np.sum(2 * np.diff(stages.s) / (sd[:-1] + sd[1:])))


def row(
    name: str, seconds: float, reference: float, stages: Stages, sd2: Array, exact: Array
) -> list[str]:
    return [
        name,
        f"{seconds * 1e3:.3f}",
        f"{reference / seconds:.1f}",
        f"{duration(stages, sd2):.7f}",
        f"{np.abs(sd2 - exact).max():.1e}",
    ]


HEADER = (
    "engine",
    "ms",
    "times faster than toppra",
    "duration s",
    "largest difference of s'^2 from ours",
)


def with_forces(repetitions: int) -> ResultTable:
    stages = force_stages(POINTS)
    exact = compiled_profile(stages, 0.0, 0.0)
    ours = best(lambda: compiled_profile(stages, 0.0, 0.0), repetitions)
    theirs = best(lambda: toppra_profile(stages, 0.0, 0.0), max(3, repetitions // 20))
    rows = [
        row("compiled", ours, theirs, stages, exact, exact),
        row("toppra (seidel)", theirs, theirs, stages, toppra_profile(stages, 0.0, 0.0), exact),
    ]
    return ResultTable(
        f"{POINTS} points, {stages.a.shape[1]} rows: slip 16-gon, tip, wheels", HEADER, rows
    )


def coordinates(repetitions: int) -> ResultTable:
    stages, q, dq, ddq = coordinate_stages(POINTS)
    exact = compiled_profile(stages, 0.0, 0.0)
    ours = best(lambda: compiled_profile(stages, 0.0, 0.0), repetitions)
    rows_too = best(
        lambda: compiled_profile(coordinate_rows(stages.s, dq, ddq), 0.0, 0.0), repetitions
    )
    built = best(lambda: compiled_profile(coordinate_stages(POINTS)[0], 0.0, 0.0), repetitions)
    theirs = best(lambda: toppra_profile(stages, 0.0, 0.0), max(3, repetitions // 20))
    rows = [
        row("compiled", ours, theirs, stages, exact, exact),
        row("compiled, with building rows", rows_too, theirs, stages, exact, exact),
        row("compiled, with building path samples and rows", built, theirs, stages, exact, exact),
        row("toppra (seidel)", theirs, theirs, stages, toppra_profile(stages, 0.0, 0.0), exact),
    ]
    if importlib.util.find_spec("copp_py"):
        problem, solve = copp_problem(stages.s, q, dq, ddq)
        copp = best(lambda: solve(problem), repetitions)
        both = best(lambda: solve(copp_problem(stages.s, q, dq, ddq)[0]), repetitions)
        result = np.asarray(solve(problem))
        rows += [
            row("copp-py", copp, theirs, stages, result, exact),
            row("copp-py, with building rows", both, theirs, stages, result, exact),
        ]
    return ResultTable(f"{POINTS} points, speed and acceleration of two coordinates", HEADER, rows)


def copp_problem(s: Array, q: Array, dq: Array, ddq: Array) -> tuple[Any, Callable[[Any], Any]]:
    import copp_py

    arm = copp_py.Robot(2, capacity=len(s))
    arm.append_s(s)
    arm.set_q(q, dq, ddq, 0)
    arm.add_velocity_limits(np.array(SPEED), -np.array(SPEED), start_idx_s=0, length=len(s))
    arm.add_acceleration_limits(
        np.array(ACCELERATION), -np.array(ACCELERATION), start_idx_s=0, length=len(s)
    )
    solver: Any = copp_py.solver.topp2_ra
    return solver.Problem(
        arm.constraints, idx_s_interval=(0, len(s) - 1), a_boundary=(0.0, 0.0)
    ), solver.solve


def batch(repetitions: int) -> ResultTable:
    members = [force_stages(BATCH_POINTS, seed) for seed in range(40)]
    s, a, b, c, top = (
        np.concatenate([np.stack([getattr(m, f) for m in members])] * (BATCH // 40))
        for f in ("s", "a", "b", "c", "sd2_max")
    )
    rest = np.zeros(BATCH)
    seconds = best(lambda: fastest_profiles(s, a, b, c, top, rest, rest), repetitions)
    one = best(lambda: toppra_profile(members[0], 0.0, 0.0), 3)
    found = int(np.sum(fastest_profiles(s, a, b, c, top, rest, rest)[1] < 0))
    return ResultTable(
        f"{BATCH} profiles of {BATCH_POINTS} points, {a.shape[2]} rows",
        ("engine", "s", "times faster than toppra", "profiles found"),
        [
            ["compiled, one batch", f"{seconds:.3f}", f"{one * BATCH / seconds:.0f}", str(found)],
            ["toppra, one profile times the batch (extrapolated)", f"{one * BATCH:.1f}", "1", ""],
        ],
    )


def whole_call(repetitions: int) -> ResultTable:
    """time_scale from path to checked trajectory: sampling, rows, refinement, margins on the fine
    grid."""
    limits = (Slip(0.332, rule="load"), Tip(), WheelAcceleration(8.0), WheelSpeed(12.0), Speed(1.5))
    rows = []
    for engine in ("compiled", "toppra"):
        result = time_scale(curve(), limits, robot=robot(), engine=engine)
        seconds = best(
            lambda name=engine: time_scale(curve(), limits, robot=robot(), engine=name),  # type: ignore[misc]  # mypy infers no lambda default
            repetitions if engine == "compiled" else 2,
        )
        rows.append(
            [
                engine,
                f"{seconds * 1e3:.0f}",
                str(len(result.s)),
                f"{result.duration:.6f}",
                f"{result.slowdown - 1:.1e}",
                f"{min(result.margins().values()):.1e}",
            ]
        )
    return ResultTable(
        "time_scale, from the path to the checked trajectory",
        ("engine", "ms", "gridpoints after refinement", "duration s", "slow-down", "least margin"),
        rows,
    )


def growth(quick: bool) -> tuple[ResultTable, str]:
    """Cost against the number of points, and a line for the notes with slope and picture."""
    rows, ours, theirs = [], [], []
    sizes = [points for points in SIZES if points <= (10_000 if quick else SIZES[-1])]
    for points in sizes:
        stages = force_stages(points)
        seconds = best(
            lambda stages=stages: compiled_profile(stages, 0.0, 0.0),  # type: ignore[misc]  # mypy infers no lambda default
            min(200, max(10, 200_000 // points)),
        )
        ours.append(seconds)
        if points <= TOPPRA_UP_TO:
            theirs.append(best(lambda stages=stages: toppra_profile(stages, 0.0, 0.0), 3))  # type: ignore[misc]  # mypy infers no lambda default
        rows.append(
            [
                str(points),
                f"{seconds * 1e3:.3f}",
                f"{seconds / points * 1e9:.0f}",
                f"{theirs[-1] * 1e3:.1f}" if points <= TOPPRA_UP_TO else "",
                f"{duration(stages, compiled_profile(stages, 0.0, 0.0)):.6f}",
            ]
        )
    FIGURES.mkdir(parents=True, exist_ok=True)
    with in_style():
        growth = growth_figure(
            {"compiled": (sizes, ours), "toppra": (sizes[: len(theirs)], theirs)}
        )
        picture = save_figure(growth, FIGURES / "growth.png")
    note = (
        f"Cost against N from {sizes[0]} to {sizes[-1]} points: compiled ~ N^{growth_exponent(sizes, ours):.3f}, "
        f"toppra ~ N^{growth_exponent(sizes[: len(theirs)], theirs):.3f} (least squares in log-log; 1 is linear). "
        f"![cost against N](time_scaling/{picture.name})"
    )
    return ResultTable(
        "Cost against the number of points",
        ("points", "compiled ms", "compiled ns a point", "toppra ms", "duration s"),
        rows,
    ), note


if __name__ == "__main__":
    main()
