"""Tables of docs/compared.md and docs/climbing.md from the last benchmark runs: `python -m
benchmarks.readme_tables`.

Run first: `python -m benchmarks.optimizers`, `python -m benchmarks.peers.time_scaling`, `python -m
benchmarks.peers.swarm_speed`, `python -m benchmarks.theses.climb` with both engines, `python -m
benchmarks.theses.closed_loop`. The tables stand between markers.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.theses.climb import SOURCES
from benchmarks.theses.climb_tables import THESIS
from benchmarks.theses.closed_loop import SETTINGS
from trajopt.report.intervals import wilson

DOCS, RESULTS = Path("docs"), Path("out/benchmarks")
COMPARED, CLIMBING, WHOLE = DOCS / "compared.md", DOCS / "climbing.md", DOCS / "optimizers.md"
START, END = "<!-- tables: python -m benchmarks.readme_tables -->", "<!-- end of tables -->"
CLIMBS, END_OF_CLIMBS = (
    "<!-- climbs: python -m benchmarks.readme_tables -->",
    "<!-- end of climbs -->",
)


def peers() -> list[str]:
    """Speed beside the peers', each pair measured in one run."""
    timing, swarm = (
        pd.read_csv(RESULTS / f"{name}.csv") for name in ("time_scaling", "swarm_speed")
    )
    rows = ["| work | trajopt | peer | ratio |", "|---|---|---|---|"]
    for title, group in timing.dropna(subset=["ms"]).groupby("table", sort=False):
        ours = group[group["engine"] == "compiled"]["ms"]
        if ours.empty:
            continue
        for engine in ("toppra (seidel)", "copp-py"):
            other = group[group["engine"] == engine]["ms"]
            if len(other) and not str(title).startswith("time_scale"):
                rows.append(
                    _row(f"time scaling, {title}", ours.iloc[0], engine, other.iloc[0], "ms")
                )
    batch = swarm[(swarm["free"] == "p2")].iloc[0]
    rows.append(
        _row(
            "one batch of 50 particles, 252 steps",
            batch["evaluate"],
            "the same in NumPy",
            batch["NumPy"],
            "ms",
        )
    )
    whole = swarm.dropna(subset=["search"]).set_index("search")["seconds"]
    rows.append(
        _row(
            "PSO, 50 particles x 500",
            whole["trajopt pso"],
            "pyswarms on the NumPy objective",
            whole["pyswarms, NumPy objective"],
            "s",
        )
    )
    alone = swarm.dropna(subset=["package"]).set_index("package")["seconds"]
    for name in ("pyswarms", "pymoo"):
        rows.append(
            _row(
                "PSO's own overhead, 40 x 20-D x 500",
                alone["trajopt pso, history kept"],
                name,
                alone[name],
                "s",
            )
        )
    runs = [frame["run"].dropna().iloc[0] for frame in (timing, swarm)]
    return [*rows, "", *(f"Measured {run}." for run in runs)]


def _row(work: str, ours: float, peer: str, theirs: float, unit: str) -> str:
    return f"| {work} | {ours:.3g} {unit} | {peer}: {theirs:.3g} {unit} | {theirs / ours:.3g} |"


def optimizers() -> list[str]:
    """Every optimizer on every problem: median and worst cost, and the whole table folded away."""
    frame = pd.read_csv(RESULTS / "optimizers.csv")
    lines: list[str] = []
    for title in frame.dropna(subset=["optimizer"])["table"].unique():
        part = frame[frame["table"] == title].dropna(subset=["optimizer"])
        free = ", ".join(sorted(set(part["free"])))
        lines += [
            "",
            f"**{title}** ({free} free, {part['problem'].nunique()} problems)",
            "",
            "| optimizer | problems <= 1e-7 | median cost | worst cost | median evaluations | median seconds |",
            "|---|---|---|---|---|---|",
        ]
        for name, group in part.groupby("optimizer", sort=False):
            cost, used = (
                group["cost"],
                f"{group['evaluations'].median():.0f} | {group['seconds'].median():.3f}",
            )
            lines.append(
                f"| {name} | {(cost <= 1e-7).sum()} | {cost.median():.1e} | {cost.max():.1e} | {used} |"
            )
    whole = [
        "# All optimizers on all problems",
        "",
        f"Measured {frame['run'].dropna().iloc[0]}.",
        "",
        "| actuators | problem | free | optimizer | cost | violation | evaluations | seconds |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in frame.dropna(subset=["optimizer"]).itertuples():
        drives = "ideal" if "Without" in row.table else "limited"
        figures = (
            f"{row.cost:.1e} | {row.violation:.0e} | {row.evaluations:.0f} | {row.seconds:.3f}"
        )
        whole.append(f"| {drives} | {row.problem} | {row.free} | {row.optimizer} | {figures} |")
    WHOLE.write_text("\n".join(whole) + "\n", encoding="utf-8")
    run = frame["run"].dropna().iloc[0]
    return [
        *lines,
        "",
        f"Each search had 25,000 evaluations and 2 s. Measured {run}; a + after the commit means "
        f"uncommitted changes. Every row: [optimizers]({WHOLE.name}).",
    ]


def climbs() -> list[str]:
    """Share of climbs by what planned the wheel angles, both engines side by side; final errors
    with feedback."""
    engines = ("mujoco", "pybullet")
    trials = pd.concat([pd.read_csv(RESULTS / f"climb_{engine}_trials.csv") for engine in engines])
    trials = trials[(trials["part"] == "planned") & ~trials["exploded"]]
    lines = [
        "| step, cm | configuration | " + " | ".join(SOURCES) + " | thesis |",
        "|---|---|" + "---|" * 4,
    ]
    for (height, name), cell in trials.groupby(["height", "configuration"], sort=False):
        shares = [
            "; ".join(
                _share(cell[(cell["engine"] == e) & (cell["source"] == source)]["critical_up"])
                for e in engines
            )
            for source in SOURCES
        ]
        lines.append(
            f"| {100 * height:g} | {name} | {' | '.join(shares)} | {THESIS[name, height]} |"
        )
    lines += [
        "",
        "| control | within | of trials | position, mm | yaw, deg | wheel phase, rad |",
        "|---|" + "---|" * 5,
    ]
    ended = pd.read_csv(RESULTS / "closed_loop_mujoco_trials.csv")
    for control, (_, _, (position, yaw, phase)) in SETTINGS.items():
        mine = ended[(ended["control"] == control) & ~ended["exploded"]]
        good = (
            (mine["position"] <= position) & (mine["yaw"] <= yaw) & (mine["phase"] <= phase)
        ).sum()
        errors = [1e3 * mine["position"], np.degrees(mine["yaw"]), mine["phase"]]
        bounds = f"{1e3 * position:g} mm, {np.degrees(yaw):g} deg, {phase:g} rad"
        middle = " | ".join(f"{e.median():.2g} (worst {e.max():.2g})" for e in errors)
        lines.append(
            f"| {control} | {bounds} | {good}/{len(ended[ended['control'] == control])} | {middle} |"
        )
    return lines


def _share(up: pd.Series) -> str:
    low, high = wilson(int(up.sum()), len(up))
    return f"{up.sum()}/{len(up)} ({low:.2f}-{high:.2f})"


def main() -> None:
    """Rewrite the tables of both pages."""
    for page, start, end, lines in (
        (COMPARED, START, END, [*peers(), *optimizers()]),
        (CLIMBING, CLIMBS, END_OF_CLIMBS, climbs()),
    ):
        before, rest = page.read_text(encoding="utf-8").split(start)
        text = "\n".join([before + start, "", *lines, end + rest.split(end)[1]])
        page.write_text(text, encoding="utf-8")
        print(f"wrote the tables of {page}")


if __name__ == "__main__":
    main()
