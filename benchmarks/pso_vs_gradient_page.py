"""Bring docs/pso_vs_gradient.md up to date with the rows of a benchmark.

Run as ``python -m benchmarks.pso_vs_gradient_page [STORE]`` after ``trajopt bench
benchmarks/pso_vs_gradient.toml`` and ``python -m benchmarks.peers.pso_statistics``. Replaces what stands between the markers of the page and of README (tables) and
the page's three pictures; the words around them are written by hand, so read them again. The whole report
(CSV, SVG, every table) goes to STORE/report.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from PIL import Image

from benchmarks.common import OUT, ROOT
from trajopt.bench.answers import answer_lines, beaten_lines, budget_lines, part_lines
from trajopt.bench.page import run_line, share_lines, write_report
from trajopt.bench.tables import SOLVED, BenchTables
from trajopt.report.files import markdown
from trajopt.sweeps.store import open_store

PAGE, README = ROOT / "docs" / "pso_vs_gradient.md", ROOT / "README.md"
PICTURES = ("families", "ecdf", "profiles")
COLOURS = 48  # of a picture, chosen


def main() -> None:
    """Rewrite the generated parts of the page."""
    parser = argparse.ArgumentParser(description="Generated parts of docs/pso_vs_gradient.md.")
    parser.add_argument(
        "store", nargs="?", type=Path, default=ROOT / "out" / "bench" / "pso_vs_gradient"
    )
    store = open_store(parser.parse_args().store, create=False)
    report = store.path / "report"
    write_report(store, report)
    budgets = BenchTables.by_budget(store.frame().to_dict("records"))
    tables = list(budgets.values())[-1]
    statistics = (OUT / "pso_statistics.md").read_text(encoding="utf-8")
    parts = {
        "run": [run_line(store, budgets)],
        "answers": answer_lines(tables),
        "budgets": budget_lines(budgets),
        "parts": part_lines(tables),
        "shares": share_lines(tables, report),
        "peers": statistics.replace("## ", "### ").split("\n", 2)[2].splitlines(),
        "best": beaten_lines(tables)[:1],
    }
    text = PAGE.read_text(encoding="utf-8")
    for name, lines in parts.items():
        text = replaced(text, name, "\n".join(lines))
    PAGE.write_text(text, encoding="utf-8")
    told = [*readme_lines(tables, list(budgets)[-1]), "", parts["run"][0]]
    readme = README.read_text(encoding="utf-8")
    README.write_text(replaced(readme, "optimizers", "\n".join(told)), encoding="utf-8")
    for name in PICTURES:
        small_picture(
            report / f"{name}.png", PAGE.parent / "pictures" / f"pso_vs_gradient_{name}.png"
        )


def readme_lines(tables: BenchTables, budget: str) -> list[str]:
    """How each optimizer does on the searches of the double wheel, by family."""
    shares = {name: found for name, found in tables.shares().items() if "newton" in found}
    shares = {name: found for name, found in shares.items() if "SMDW" in name}
    rows = []
    for name in sorted({name for found in shares.values() for name in found}):
        cells = [found.get(name) for found in shares.values()]
        told = (
            "" if c is None else f"{c.solved:.0%}; {c.left:.0e}; {c.seconds:.2g} s" for c in cells
        )
        rows.append((name, *told))
    return [
        f"Searches solved (to {SOLVED:g} of the way from a median random point to the best known cost), median share "
        f"left, median seconds, within {budget} of processor time; {tables.seeds} seeds.",
        "",
        *markdown(("optimizer", *shares), rows),
    ]


def small_picture(source: Path, target: Path) -> None:
    """The PNG ``source`` with few colours, for a page in a repository: a third of its size."""
    with Image.open(source) as picture:
        picture.convert("RGB").quantize(COLOURS).save(target, optimize=True)


def replaced(text: str, name: str, new: str) -> str:
    """``text`` with ``new`` between the markers called ``name``."""
    begin, end = f"<!-- {name}: generated -->\n", f"\n<!-- {name}: end -->"
    before, found, rest = text.partition(begin)
    _, closed, after = rest.partition(end)
    if not found or not closed:
        raise SystemExit(f"the markers of '{name}' are missing")
    return before + begin + new + end + after


if __name__ == "__main__":
    main()
