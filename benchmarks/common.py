"""What all benchmarks share: where and on what they ran, and how their tables are printed and
kept."""

from __future__ import annotations

import csv
import datetime
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from trajopt.provenance import commit, processor, versions
from trajopt.report.files import markdown

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "out" / "benchmarks"
PROBLEMS = ROOT / "problems"


@dataclass(frozen=True)
class ResultTable:
    """A table of text cells: ``rows`` have as many cells as ``header``."""

    title: str
    header: tuple[str, ...]
    rows: Sequence[Sequence[str]]


def provenance(packages: Sequence[str]) -> str:
    """One line: date, commit ("+" behind it where files differ), CPU, versions."""
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    head, _, changed = (commit() or "unknown").partition("+")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    found = ", ".join(f"{name} {version}" for name, version in versions(packages).items())
    return f"{now}; commit {head[:7]}{'+' * bool(changed)}; {processor()}, {cores} cores; {found}"


def publish(
    name: str, tables: Sequence[ResultTable], *, packages: Sequence[str], notes: Sequence[str] = ()
) -> Path:
    """Print ``tables`` and write them to out/benchmarks/<name>.md and .csv; the Markdown file's
    path.

    The CSV file holds all tables in one: a first column names the table, columns are the union of
    all headers.
    """
    console = Console(width=180)
    where = provenance(packages)
    OUT.mkdir(parents=True, exist_ok=True)
    text = [f"# Benchmark: {name}", "", where, ""]
    for table in tables:
        shown = Table(*table.header, title=table.title, title_justify="left")
        for row in table.rows:
            shown.add_row(*row)
        console.print(shown)
        text += [f"## {table.title}", "", *markdown(table.header, table.rows), ""]
    text += [line for note in notes for line in (note, "")]
    for line in (*notes, where):
        console.print(line, highlight=False)
    path = OUT / f"{name}.md"
    path.write_text("\n".join(text), encoding="utf-8")
    _write_csv(OUT / f"{name}.csv", tables, where)
    return path


def _write_csv(path: Path, tables: Sequence[ResultTable], where: str) -> None:
    columns = list(dict.fromkeys(name for table in tables for name in table.header))
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ["table", *columns, "run"], restval="")
        writer.writeheader()
        for table in tables:
            for row in table.rows:
                writer.writerow(
                    {
                        "table": table.title,
                        **dict(zip(table.header, row, strict=True)),
                        "run": where,
                    }
                )
