"""Counts of climbs on the SMDW page: pooled, in order, in words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

from benchmarks.common import ResultTable
from benchmarks.theses.smdw_figures import SOURCE_NAMES, phase_shares
from benchmarks.theses.smdw_trial_figures import ClimbCell
from trajopt.report.intervals import wilson

CLIMBS = 0.5  # share of its runs from which a phase counts as one that climbs, chosen
THESIS_COUNTS = {
    ("lateral", 0.035): "4/10, 2/10",
    ("forward", 0.035): "most of 20, 20/20",
    ("lateral", 0.05): "0/10",
    ("forward", 0.05): "10-11/20",
}  # sections 6.1.1 and 6.2; section 6.1
# Counts of 10 that an order can be read from: section 6.1 (5 cm), section 6.2 (3.5 cm, scenario 2).
THESIS_ORDER = {
    0.05: {"lateral": 0, "forward35": 5, "forward45": 6},
    0.035: {"lateral": 2, "forward35": 10, "forward45": 10},
}


def pooled(cells: Sequence[ClimbCell]) -> dict[tuple[str, float, str], dict[str, tuple[int, int]]]:
    """(climbs, trials) of each planner, by engine, step (m) and motion; forward configurations
    together."""
    found: dict[tuple[str, float, str], dict[str, tuple[int, int]]] = {}
    for cell in cells:
        line = found.setdefault(
            (cell.engine, cell.height, cell.configuration.rstrip("0123456789")), {}
        )
        good, trials = line.get(cell.source, (0, 0))
        line[cell.source] = (good + cell.successes, trials + cell.trials)
    return found


def headline(cells: Sequence[ClimbCell]) -> ResultTable:
    """Climbs of the three planners, forward configurations pooled, beside the thesis's counts."""
    rows = []
    for (engine, height, motion), line in pooled(cells).items():
        shares = [_share(*line.get(source, (0, 0))) for source in SOURCE_NAMES.values()]
        rows.append((engine, f"{100 * height:g}", motion, *shares, THESIS_COUNTS[motion, height]))
    return ResultTable(
        "Climbs of trials, forward at 35 and 45 deg together",
        ("engine", "step, cm", "motion", *SOURCE_NAMES.values(), "thesis"),
        rows,
    )


def reading(cells: Sequence[ClimbCell]) -> str:
    """In words: in which lines of the headline the intervals of exact planning and of each other
    planner are apart."""
    exact, *others = SOURCE_NAMES.values()
    sentences = []
    for other in others:
        lines = {
            key: (line[exact], line[other])
            for key, line in pooled(cells).items()
            if exact in line and other in line
        }
        apart = [
            f"{engine}, {100 * height:g} cm, {motion} ({ours[0]}/{ours[1]} against {theirs[0]}/{theirs[1]})"
            for (engine, height, motion), (ours, theirs) in lines.items()
            if wilson(*ours)[0] > wilson(*theirs)[1] or wilson(*theirs)[0] > wilson(*ours)[1]
        ]
        where = "apart in no line" if not apart else "apart in " + "; ".join(apart)
        sentences.append(f'Intervals of "{exact}" and "{other}" are {where}, of {len(lines)}.')
    return " ".join(sentences)


def _share(good: int, trials: int) -> str:
    if not trials:
        return "not run"
    low, high = wilson(good, trials)
    return f"{good}/{trials} ({low:.2f}-{high:.2f})"


def orders(cells: Sequence[ClimbCell]) -> ResultTable:
    """Configurations from often to seldom; ">" only where Wilson's intervals of neighbours do not
    overlap."""
    rows = []
    for engine, height in dict.fromkeys((c.engine, c.height) for c in cells):
        found = []
        for source in SOURCE_NAMES.values():
            found.append(
                ordered(
                    {
                        c.configuration: (c.successes, c.trials)
                        for c in cells
                        if (c.engine, c.height, c.source) == (engine, height, source)
                    }
                )
            )
        thesis = ordered({name: (count, 10) for name, count in THESIS_ORDER[height].items()})
        rows.append((engine, f"{100 * height:g}", *found, thesis))
    return ResultTable(
        "Order of the configurations (> where the intervals do not overlap)",
        ("engine", "step, cm", *SOURCE_NAMES.values(), "thesis"),
        rows,
    )


def regimes(engines: Iterable[str]) -> ResultTable:
    """Where phase decides: how many phases climb (in at least half of their runs) at each torque
    and friction."""
    rows: list[tuple[str, ...]] = []
    for engine in engines:
        phases, panels = phase_shares(engine)
        for (name, height), panel in panels.items():
            found: dict[str, list[str]] = {"all": [], "some": [], "none": []}
            for (torque, friction), shares in panel.items():
                good = sum(share >= CLIMBS for share in shares)
                kind = "all" if good == len(phases) else "some" if good else "none"
                text = f"{torque:g} N m, {friction:g}" + (
                    f" ({good} of {len(phases)})" if kind == "some" else ""
                )
                found[kind].append(text)
            rows.append(
                (engine, name, f"{100 * height:g}", *("; ".join(v) or "-" for v in found.values()))
            )
    header = (
        "engine",
        "configuration",
        "step, cm",
        "every phase climbs",
        "phase decides (phases that climb)",
        "none climbs",
    )
    return ResultTable("Torques and frictions at which phase decides", header, rows)


def ordered(counts: Mapping[str, tuple[int, int]]) -> str:
    """Names with their (climbs, trials) from often to seldom, e.g. "forward35 = forward45 >
    lateral"."""
    ranked = sorted(counts.items(), key=lambda item: -item[1][0] / item[1][1])
    text = ranked[0][0] if ranked else "not run"
    for (_, above), (name, below) in pairwise(ranked):
        apart = wilson(*above)[0] > wilson(*below)[1]
        same = above[0] * below[1] == below[0] * above[1]
        text += f" {'=' if same else '>' if apart else '~'} {name}"
    return text
