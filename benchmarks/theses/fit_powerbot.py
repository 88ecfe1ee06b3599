"""Fits the knots that [waheed2006] only draws, and writes problems/powerbot/experiment_*.toml.

    python -m benchmarks.theses.fit_powerbot [--quick] [--write]

Start, goal and headings are met exactly. Inner knots and the two end rates are chosen by least
squares from many starts, so that length and the unscaled maxima of speed, acceleration and
deceleration (one second a segment) meet the print; the sliding speed of eq. 2.15 (sharpest bend)
counts less. Ends keep a small speed along the heading: with none, as in the thesis's example, the
curvature at the ends is infinite.
"""

from __future__ import annotations

import argparse
import csv
import math
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
import scipy.optimize

from trajopt.arrays import Array
from trajopt.paths.path import Path
from trajopt.systems.powerbot.constants import FRICTION
from trajopt.systems.powerbot.limits import GRAVITY

ROOT = FilePath(__file__).resolve().parents[2]
TABLE = ROOT / "tests" / "data" / "powerbot" / "experiments.csv"
TARGETS = (
    "length",
    "unscaled_speed",
    "unscaled_acceleration",
    "unscaled_deceleration",
    "sliding_speed",
)
WEIGHT = 20.0  # one over 5 %, the aim
SLIDING_WEIGHT = {
    1: 2.0,
    2: 2.0,
    4: 10.0,
    5: 10.0,
}  # chosen: it binds only without the safety speed (4 and 5)
RAMP_LENGTH, RAMP_HEIGHT = 4.29, 0.45  # m, [waheed2006], section 4.4
RAMP_FOOT, RAMP_DIRECTION = (
    (-44.63, -30.4),
    math.radians(-91.0),
)  # m, rad; chosen: the straightest stretch
SAMPLES = 201


@dataclass(frozen=True)
class Case:
    """What the thesis prints of an experiment."""

    number: int
    knots: int
    start: Array
    goal: Array
    headings: tuple[float, float]  # rad
    printed: Array  # TARGETS
    row: dict[str, str]


def cases() -> list[Case]:
    """Experiments 1, 2, 4 and 5 of the table."""
    found = []
    with TABLE.open(encoding="utf-8") as file:
        for row in csv.DictReader(line for line in file if not line.startswith("#")):
            if row["experiment"] == "6":
                continue
            at = {name: float(value) for name, value in row.items() if value}
            printed = np.array(
                [
                    at["distance"],
                    at["unscaled_v_max"],
                    at["unscaled_a_max"],
                    -at["unscaled_d_max"],
                    at["v_slide"],
                ]
            )
            found.append(
                Case(
                    int(at["experiment"]),
                    int(at["knots"]),
                    np.array([at["start_x"], at["start_y"]]),
                    np.array([at["goal_x"], at["goal_y"]]),
                    (math.radians(at["heading_start"]), math.radians(at["heading_goal"])),
                    printed,
                    row,
                )
            )
    return found


def path_of(case: Case, x: Array) -> Path:
    """The path for inner knots and end rates ``x``."""
    knots = np.vstack([case.start, x[:-2].reshape(-1, 2), case.goal])
    ends = [
        rate * np.array([math.cos(h), math.sin(h)])
        for rate, h in zip(x[-2:], case.headings, strict=True)
    ]
    return Path.through(
        knots,
        knots=np.arange(case.knots, dtype=float),
        start_direction=ends[0],
        end_direction=ends[1],
    )


def measured(path: Path, samples: int = SAMPLES) -> tuple[Array, float]:
    """TARGETS of a path run at one second a segment, and the angle it turns through (rad)."""
    u = np.linspace(0.0, path.end, samples)
    v, a = path.position(u, 1)[:, :2], path.position(u, 2)[:, :2]
    speed = np.hypot(v[:, 0], v[:, 1])
    along = np.sum(v * a, axis=1) / speed
    curvature = np.abs(v[:, 0] * a[:, 1] - v[:, 1] * a[:, 0]) / speed**3
    slide = math.sqrt(FRICTION * GRAVITY / curvature.max())
    values = np.array([np.trapezoid(speed, u), speed.max(), along.max(), -along.min(), slide])
    return values, float(np.trapezoid(curvature * speed, u))


def fit(case: Case, starts: int, rng: np.random.Generator) -> Array:
    """Inner knots and end rates from the best of many starts."""

    def residuals(x: Array) -> Array:
        path = path_of(case, x)
        values, turning = measured(path)
        miss = WEIGHT * (values / case.printed - 1)
        wider = values[-1] / case.printed[-1] - 1  # a wider bend than printed costs nothing
        miss[-1] = SLIDING_WEIGHT[case.number] * min(wider, 0.0)
        extra = [0.02 * turning, *(0.002 * x[-2:])]  # prefer plain paths among equal ones
        if case.number == 4:  # the last stretch follows the goal's heading
            end = path.position(np.linspace(path.end - 1.0, path.end, 11))[:, :2] - case.goal
            extra += list(0.5 * (end @ [-math.sin(case.headings[1]), math.cos(case.headings[1])]))
        return np.concatenate([miss, extra])

    inner = 2 * (case.knots - 2)
    low = np.concatenate([np.full(inner, -60.0), [0.05, 0.05]])
    high = np.concatenate([np.full(inner, 60.0), [3.0, 3.0]])
    best: tuple[float, Array] = (math.inf, low)
    directions = [np.array([math.cos(h), math.sin(h)]) for h in case.headings]
    for _ in range(starts):
        chord = np.linspace(case.start, case.goal, case.knots)[1:-1] + rng.normal(
            0, 1.5, (case.knots - 2, 2)
        )
        reach = rng.uniform(0.1, 0.4, 2) * case.printed[0]
        chord[0] = case.start + reach[0] * directions[0] + rng.normal(0, 0.1, 2)
        chord[-1] = case.goal - reach[1] * directions[1] + rng.normal(0, 0.1, 2)
        first = np.concatenate([chord.ravel(), rng.uniform(0.06, 0.8, 2)])
        found = scipy.optimize.least_squares(residuals, first, bounds=(low, high), max_nfev=40)
        if found.cost < best[0]:
            best = (float(found.cost), found.x)
    return np.round(best[1], 3)


def toml(case: Case, x: Array) -> str:
    """The problem file."""
    knots = np.vstack([case.start, x[:-2].reshape(-1, 2), case.goal])
    values, _ = measured(path_of(case, x), 2001)
    residuals = values / case.printed - 1
    row = case.row
    lines = [
        f"# [waheed2006], experiment {case.number} (section 4). Knots between start and goal are only drawn: fitted",
        "# by benchmarks/theses/fit_powerbot.py to the printed length and unscaled maxima; what is left is in [printed].",
        "# Lengths m, angles rad; x, y as in the thesis's map, yaw counter-clockwise.",
        f'title = "PowerBot thesis, experiment {case.number}"',
        "",
        "[path]",
        "knots = [" + ", ".join(f"[{a:g}, {b:g}]" for a, b in knots) + "]  # inner ones fitted",
        f"start_heading = {case.headings[0]:.6f}",
        f"goal_heading = {case.headings[1]:.6f}",
        f"start_rate = {x[-2]:g}  # fitted",
        f"goal_rate = {x[-1]:g}  # fitted",
        "",
    ]
    if case.number == 4:
        lines += [
            "[[ramps]]  # section 4.4; its place is drawn only: chosen, the straightest stretch",
            f"foot = [{RAMP_FOOT[0]}, {RAMP_FOOT[1]}]",
            f"direction = {RAMP_DIRECTION:.6f}",
            f"length = {RAMP_LENGTH}",
            f"height = {RAMP_HEIGHT}",
            "",
        ]
    lines += ["[limits]", 'variant = "thesis"', f"speed = {row['v_robot']}"]
    if row["v_safety"]:
        lines.append(f"safety_speed = {row['v_safety']}")
    lines += [
        f"acceleration = {row['a_robot']}",
        f"deceleration = {row['d_robot'].lstrip('-')}",
        f"friction = {FRICTION}",
        "tip = true",
        "",
        "[printed]",
        f"length = {row['distance']}",
        f"time = {row['time']}",
    ]
    lines += [
        f"{name} = {value:g}" for name, value in zip(TARGETS[1:], case.printed[1:], strict=True)
    ]
    shown = ", ".join(
        f"{name} = {value:.4f}" for name, value in zip(TARGETS, residuals, strict=True)
    )
    lines += ["fitted = true", f"residuals = {{ {shown} }}", ""]
    return "\n".join(lines)


def main() -> None:
    """Fit, print, and write the files with --write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="few starts")
    parser.add_argument("--only", type=int, choices=sorted(SLIDING_WEIGHT), help="one experiment")
    parser.add_argument(
        "--write", action="store_true", help="write problems/powerbot/experiment_*.toml"
    )
    arguments = parser.parse_args()
    for case in cases():
        if arguments.only not in (None, case.number):
            continue
        x = fit(case, 4 if arguments.quick else 70, np.random.default_rng(4))
        values, turning = measured(path_of(case, x), 2001)
        shown = ", ".join(
            f"{name} {value / print_ - 1:+.1%}"
            for name, value, print_ in zip(TARGETS, values, case.printed, strict=True)
        )
        print(f"experiment {case.number}: {shown}; turns {math.degrees(turning):.0f} deg")
        if arguments.write:
            file = ROOT / "problems" / "powerbot" / f"experiment_{case.number}.toml"
            file.write_text(toml(case, x), encoding="utf-8")


if __name__ == "__main__":
    main()
