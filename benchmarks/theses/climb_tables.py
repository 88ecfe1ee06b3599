"""Tables of the trials of `python -m benchmarks.theses.climb`."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from benchmarks.common import ResultTable
from benchmarks.theses.climb_trials import FRICTION, Trial
from trajopt.systems.smdw.climb import Rate
from trajopt.systems.smdw.trials import NEAREST

# [guzman2015], sections 6.1, 6.1.1, 6.2: climbs in 10 runs (scenario 1 for 5 cm; both scenarios for
# 3.5 cm).
THESIS = {
    ("lateral", 0.05): "0/10",
    ("forward35", 0.05): "5/10",
    ("forward45", 0.05): "5-6/10",
    ("lateral", 0.035): "4/10, 2/10",
    ("forward35", 0.035): "most, 10/10",
    ("forward45", 0.035): "most, 10/10",
}
PHASES = np.linspace(-2.4, 2.4, 9)  # rad, along the rotation, where the wheel meets the step
# N m, -: chosen, where climbs are in doubt
CAUSES_TORQUES = {"lateral": 3.0, "forward35": 2.0}
CAUSES_FRICTION = 0.8


def rate_table(title: str, trials: Sequence[Trial]) -> ResultTable:
    """Rates with Wilson intervals, one row a cell, the thesis's count beside."""
    rows = []
    for key in dict.fromkeys((t.engine, t.height, t.configuration, t.source) for t in trials):
        cell = [t for t in trials if (t.engine, t.height, t.configuration, t.source) == key]
        shares = [
            _share(
                [bool(getattr(t, what)) for t in cell if not t.exploded],
                sum(t.exploded for t in cell),
            )
            for what in ("critical_up", "first_attempt", "all_up")
        ]
        cost = "" if math.isnan(cell[0].seconds) else f"{cell[0].seconds:.2f}"
        rows.append(
            (
                key[0],
                f"{100 * key[1]:g}",
                key[2],
                key[3],
                *(_text(s) for s in shares),
                str(shares[0].exploded),
                cost,
                "" if cell[0].part == "causes" else THESIS[key[2], key[1]],
            )
        )
    return ResultTable(
        title,
        (
            "engine",
            "step, cm",
            "configuration",
            "planned by",
            "critical wheels up",
            "first attempt",
            "all four up",
            "exploded",
            "s a trial",
            "thesis",
        ),
        rows,
    )


def _share(values: list[bool], exploded: int) -> Rate:
    return Rate(sum(values), len(values), exploded)


def _text(share: Rate) -> str:
    low, high = share.interval
    return f"{share.successes}/{share.trials} ({low:.2f}-{high:.2f})"


def phase_table(trials: Sequence[Trial]) -> ResultTable:
    """Critical wheels up over phase: one row a torque and friction."""
    rows = []
    labels = [f"{phase:+.2f}" for phase in PHASES]
    for key in dict.fromkeys(
        (t.engine, t.height, t.configuration, t.torque, t.friction) for t in trials
    ):
        cell = [
            t for t in trials if (t.engine, t.height, t.configuration, t.torque, t.friction) == key
        ]
        counts = []
        for label in labels:
            sound = [t for t in cell if t.source == label and not t.exploded]
            counts.append(f"{sum(t.critical_up for t in sound)}/{len(sound)}")
        rows.append((key[0], f"{100 * key[1]:g}", key[2], f"{key[3]:g}", f"{key[4]:g}", *counts))
    return ResultTable(
        "Critical wheels up over phase where the wheel meets the step (rad along the rotation)",
        ("engine", "step, cm", "configuration", "torque, N m", "friction", *labels),
        rows,
    )


NOTE = (
    "A wheel is up when its centre stays risen by 0.7 of the step's height over the last 0.2 s. First attempt: "
    "within half a turn of meeting the step (forward: the leading wheel; lateral: both). Brackets: Wilson, 95 %. "
    f"Friction {FRICTION[0]}-{FRICTION[1]}, 8 N m, unless the row says otherwise. A heading error turns the robot "
    f"about its centre; where a corner then is within {1e3 * NEAREST:g} mm of the step the robot is moved back, so "
    "gaps and phases at contact change with it. Exploded runs are counted apart. "
    "Thesis: runs that climbed, in another simulator."
)


def table_of(part: str, rows: Sequence[Trial]) -> ResultTable:
    if part == "phases":
        return phase_table(rows)
    titles = {
        "planned": "Sub-test 2 from planned states",
        "driven": "Sub-test 1 open loop, then sub-test 2",
        "causes": f"What else sets the rate: friction {CAUSES_FRICTION:g}, "
        + ", ".join(f"{name} at {torque:g} N m" for name, torque in CAUSES_TORQUES.items()),
    }
    return rate_table(titles[part], rows)
