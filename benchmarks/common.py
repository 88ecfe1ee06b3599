"""What all benchmarks share: where and on what they ran, and how their tables are printed and
kept."""

from __future__ import annotations

import csv
import datetime
import importlib.metadata
import os
import platform
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "out" / "benchmarks"
PROBLEMS = ROOT / "problems"


@dataclass(frozen=True)
class ResultTable:
    """A table of text cells: ``rows`` have as many cells as ``header``."""

    title: str
    header: tuple[str, ...]
    rows: Sequence[Sequence[str]]


def cpu() -> str:
    """Model name of the processor and how many cores this process may use."""
    name = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        name = next(
            (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), name
        )
    except OSError:
        pass
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{name}, {cores} cores"


def commit() -> str:
    """Commit of the checkout, "+" when it has changes; "unknown" outside git."""
    try:
        head = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=True,
            timeout=10,
        ).stdout.strip()
        changed = subprocess.run(
            ["git", "status", "--porcelain", "--untracked-files=no"],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=True,
            timeout=10,
        ).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return head + ("+" if changed else "")


def versions(packages: Sequence[str]) -> str:
    """Versions of Python and of the packages that are installed."""
    found = [f"Python {platform.python_version()}"]
    for name in packages:
        try:
            found.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            found.append(f"{name} not installed")
    return ", ".join(found)


def provenance(packages: Sequence[str]) -> str:
    """One line: date, commit, CPU, versions."""
    now = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    return f"{now}; commit {commit()}; {cpu()}; {versions(packages)}"


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
        text += [f"## {table.title}", "", *markdown(table), ""]
    text += [line for note in notes for line in (note, "")]
    for line in (*notes, where):
        console.print(line, highlight=False)
    path = OUT / f"{name}.md"
    path.write_text("\n".join(text), encoding="utf-8")
    _write_csv(OUT / f"{name}.csv", tables, where)
    return path


def markdown(table: ResultTable) -> list[str]:
    """Lines of a Markdown table."""
    lines = ["| " + " | ".join(table.header) + " |", "|" + "---|" * len(table.header)]
    return lines + ["| " + " | ".join(row) + " |" for row in table.rows]


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
