"""Golden figures: what the theses' pages print, kept in tests/data/golden.json.

    python -m tests.systems.golden_figures --write [GROUP ...]   # rewrites the file
    python -m tests.systems.golden_figures --table [GROUP ...]   # Markdown: kept, computed, change

Without groups: all of them, or with --fast all but the slow ones.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from tests.systems import golden_asoc, golden_powerbot, golden_smdw
from tests.systems.golden_data import ROOT, Figures

GOLDEN = ROOT / "tests" / "data" / "golden.json"


@dataclass(frozen=True)
class Group:
    """Figures, and how exactly they have to come back: relative, or absolute where that is more."""

    compute: Callable[[], Figures]
    relative: float
    absolute: float = 0.0
    slow: bool = False


EXACT = 1e-6  # formulas
TIMES = 1e-4  # durations: what another grid of the same accuracy may change
GROUPS: dict[str, Group] = {
    "smdw_costs": Group(golden_smdw.smdw_costs, EXACT),
    "smdw_wheel": Group(golden_smdw.smdw_wheel, EXACT),
    "smdw_plans": Group(golden_smdw.smdw_plans, TIMES, 1e-9),
    "smdw_plan_errors": Group(golden_smdw.smdw_plan_errors, 1e-3, 1e-6),
    "smdw_solutions": Group(golden_smdw.smdw_solutions, TIMES),
    "smdw_solution_errors": Group(golden_smdw.smdw_solution_errors, 0.0, 1e-6),
    # m and rad; engines differ by CPU and version
    "smdw_physics": Group(golden_smdw.smdw_physics, 0.0, 5e-3),
    "smdw_climbs": Group(golden_smdw.smdw_climbs, 0.0, 1.0, slow=True),  # one trial more or less
    "powerbot_limits": Group(golden_powerbot.powerbot_limits, EXACT),
    "powerbot_printed_times": Group(golden_powerbot.powerbot_printed_times, EXACT),
    "powerbot_times": Group(golden_powerbot.powerbot_times, TIMES),
    # s; a tenth of a second is less than a scan
    "powerbot_encounters": Group(golden_powerbot.powerbot_encounters, 1e-3, 0.1),
    "powerbot_following": Group(golden_powerbot.powerbot_following, 1e-3, 1e-6),
    "asoc_isotropy": Group(golden_asoc.asoc_isotropy, EXACT, 1e-9),
    "asoc_terrain": Group(golden_asoc.asoc_terrain, EXACT),
    "asoc_design": Group(golden_asoc.asoc_design, EXACT, 1e-9),
    "asoc_geometry": Group(golden_asoc.asoc_geometry, EXACT),
    "asoc_tracking": Group(golden_asoc.asoc_tracking, 1e-4, slow=True),
    "lecture_mobility": Group(golden_asoc.lecture_mobility, 0.0),
}


def kept() -> dict[str, Figures]:
    """Figures of the file, by group."""
    read: dict[str, Figures] = json.loads(GOLDEN.read_text(encoding="utf-8"))
    return read


def differences(name: str, expected: Figures, found: Figures) -> list[str]:
    """One line a figure of a group that is missing, new or beyond its tolerance; empty if none."""
    group, lines = GROUPS[name], []
    for figure in [*expected, *(f for f in found if f not in expected)]:
        if figure not in found or figure not in expected:
            lines.append(f"{figure}: {'gone' if figure not in found else 'not in the file'}")
            continue
        old, new = expected[figure], found[figure]
        if not abs(new - old) <= max(group.relative * abs(old), group.absolute):
            lines.append(f"{figure}: {new:.9g}, kept {old:.9g}")
    return lines


def markdown(
    names: Sequence[str], before: Mapping[str, Figures], after: Mapping[str, Figures]
) -> str:
    """One table a group: the file's figure, today's, and the change."""
    lines = []
    for name in names:
        lines += [f"### {name}", "", "| figure | kept | computed | change |", "|---|---|---|---|"]
        old, new = before.get(name, {}), after[name]
        for figure in [*new, *(f for f in old if f not in new)]:
            a, b = old.get(figure), new.get(figure)
            change = "" if a is None or b is None or a == b else f"{b - a:+.2g}"
            if change and a:
                assert a is not None
                assert b is not None
                change += f" ({b / a - 1:+.2g})"
            cells = ("-" if v is None else f"{v:.6g}" for v in (a, b))
            lines.append(f"| {figure} | {' | '.join(cells)} | {change} |")
        lines.append("")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Compute groups (default: all), and write or show them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=", ".join(GROUPS))
    parser.add_argument("--write", action="store_true", help=f"rewrite {GOLDEN.name}")
    parser.add_argument("--table", action="store_true", help="print Markdown tables")
    parser.add_argument("--fast", action="store_true", help="leave slow groups out")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.groups if name not in GROUPS]
    if unknown:
        parser.error(f"{unknown[0]!r} is no group; expected one of {', '.join(GROUPS)}")
    names = options.groups or [n for n, g in GROUPS.items() if not (options.fast and g.slow)]
    before = kept() if GOLDEN.exists() else {}
    after = {name: GROUPS[name].compute() for name in names}
    if options.table:
        print(markdown(names, before, after))
    for name in names:
        for line in differences(name, before.get(name, {}), after[name]):
            print(f"{name}: {line}")
    if options.write:
        merged = {name: after.get(name, before.get(name)) for name in GROUPS}
        text = json.dumps({k: v for k, v in merged.items() if v is not None}, indent=1)
        GOLDEN.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
