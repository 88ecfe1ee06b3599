"""The page of an optimizer benchmark: all sections, tables (Markdown, CSV)."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from trajopt.bench.answers import answer_lines, beaten_lines, budget_lines, part_lines, peer_lines
from trajopt.bench.pictures import PROFILE_SHARE, save_bench_pictures
from trajopt.bench.tables import NEAR, SOLVED, BenchTables, Row
from trajopt.files import whole_file
from trajopt.report.files import markdown
from trajopt.report.viewer.bench_page import write_bench_page
from trajopt.sweeps.store import Store

_BUILT_FOR = 5  # searches that share one construction: seeds in a row


def write_report(store: Store, out: Path) -> Path:
    """Write index.md, a page of all of it (index.html), the CSV tables and the figures of a
    benchmark's rows into ``out``; index.md's path."""
    out.mkdir(parents=True, exist_ok=True)
    budgets = BenchTables.by_budget(store.frame().to_dict("records"))
    told, tables = list(budgets.items())[-1]
    figures = save_bench_pictures(tables, out)
    curves = (
        "Each curve counts only the problems its optimizer can work on (the lattice needs affine wheel "
        "angles, for example), so compare curves of optimizers with the same problems: the table tells which."
    )
    best = [(name, f"{cost:.6g}", who) for name, (cost, who) in tables.best.items()]
    sections = {
        "Answers": answer_lines(tables),
        "Several budgets": budget_lines(budgets),
        "What exactness buys": part_lines(tables),
        "Share of searches solved": [*share_lines(tables, out), "", curves],
        **{title: [f"![{title}]({file})"] for title, (file, _) in figures.items()},
        "Expected running time": _running_table(tables, out),
        "Construction": _construction(tables, out),
        "PSO against pyswarms": peer_lines(tables),
        "Best known costs": [
            *beaten_lines(tables),
            *markdown(("problem", "best cost", "found by"), best),
        ],
        "Searches that failed": _failures(tables),
    }
    where = run_line(store, budgets)
    if len(budgets) > 1:
        where += f" Sections without a budget of their own, and the pictures: {told}."
    write_bench_page(out / "index.html", where, [f for _, f in figures.values()], sections)
    text = ["# Optimizers compared", "", where]
    for title, lines in sections.items():
        text += ["", f"## {title}", "", *lines]
    _raw([row for one in budgets.values() for row in one.rows], out)
    page = out / "index.md"
    with whole_file(page) as part:
        part.write_text("\n".join(text) + "\n", encoding="utf-8")
    return page


def run_line(store: Store, budgets: Mapping[str, BenchTables]) -> str:
    """What ran, where, with what, and how long."""
    runs = store.runs()
    last = runs[-1] if runs else {}
    versions = ", ".join(f"{k} {v}" for k, v in dict(last.get("versions", {})).items())
    rows = [row for tables in budgets.values() for row in tables.rows]
    done = [row for tables in budgets.values() for row in tables.done]
    one = next(iter(budgets.values()))
    cpus = ", ".join(sorted({str(row.get("cpu")) for row in done}))
    spent = sum(
        float(row["seconds"]) + float(row["construct_seconds"]) / _BUILT_FOR for row in done
    )
    planned = f" of {int(last['cases'])} planned" if "cases" in last else ""
    return (
        f"{len(done)} finished searches{planned}, {len(rows) - len(done)} others: "
        f"{len(one.problems)} problems, {len(one.optimizers)} optimizers, {one.seeds} seeds, budgets of "
        f"{', '.join(budgets)}; about {spent / 60:.0f} min of processor time, in {len(runs)} run(s). Seconds "
        f"are processor time of one thread. {cpus}; commit {str(last.get('commit'))[:7]}; {versions}. Rows: "
        "searches.csv."
    )


def share_lines(tables: BenchTables, out: Path) -> list[str]:
    """The table of shares as Markdown, and as shares.csv in ``out``."""
    shares = tables.shares()
    rows = []
    for name in tables.optimizers:
        cells = [shares[f].get(name) for f in shares]
        told = ("" if c is None else f"{c.solved:.0%}, {c.near:.0%}, {c.left:.0e}" for c in cells)
        rows.append((name, *told))
    flat = [
        (
            *(family, name, str(v.searches), f"{v.solved:.4f}", f"{v.near:.4f}"),
            *(f"{v.left:.6e}", f"{v.seconds:.6f}"),
        )
        for family, found in shares.items()
        for name, v in found.items()
    ]
    _write_csv(
        out / "shares.csv",
        ("family", "optimizer", "searches", "solved", "near", "median_left", "median_seconds"),
        flat,
    )
    return [
        f"Searches solved (to {SOLVED:g}), nearly solved (to {NEAR:g}), and the median share left. Empty: the "
        f"optimizer does not work on this family. {tables.seeds} seeds of methods that draw, one of others.",
        "",
        *markdown(("optimizer", *shares), rows),
    ]


def _running_table(tables: BenchTables, out: Path) -> list[str]:
    rows = [
        (problem, name, *(f"{x:.4g}" for x in (e.value, e.low, e.high)), f"{e.successes}/{e.runs}")
        for problem, name, e in tables.running_times(PROFILE_SHARE)
    ]
    header = ("problem", "optimizer", "evaluations", "95 % from", "to", "successes")
    _write_csv(out / "expected_running_time.csv", header, rows)
    reached = [row for row in rows if not row[5].startswith("0/")]
    return [
        f"Evaluations until {PROFILE_SHARE:g} is left, failures counted (inf where no search got there: "
        "expected_running_time.csv has all rows).",
        "",
        *markdown(header, reached),
    ]


def _construction(tables: BenchTables, out: Path) -> list[str]:
    found = tables.construction()
    _write_csv(
        out / "construction.csv",
        ("family", "optimizer", "median_seconds"),
        [(family, name, f"{seconds:.6f}") for family, name, seconds in found],
    )
    table = {(family, name): f"{seconds:.2g}" for family, name, seconds in found}
    families = list(dict.fromkeys(family for family, _ in table))
    rows = [
        (name, *(table.get((family, name), "") for family in families))
        for name in tables.optimizers
    ]
    return [
        "Median seconds to load, build and compile before the first search of a process, apart from all other "
        "figures.",
        "",
        *markdown(("optimizer", *families), rows),
    ]


def _failures(tables: BenchTables) -> list[str]:
    if not tables.failed:
        return ["None."]
    rows = [
        (
            str(r["problem"]),
            str(r["optimizer"]),
            str(r["seed"]),
            str(r["status"]),
            str(r.get("failures") or ""),
            str(r.get("first_failure") or r.get("error_message") or "").replace("|", "/")[:160],
        )
        for r in tables.failed
    ]
    header = ("problem", "optimizer", "seed", "status", "failed evaluations", "first reason")
    more = ["", f"and {len(rows) - 40} more (searches.csv)"] if len(rows) > 40 else []
    return markdown(header, rows[:40]) + more


def _raw(searches: Sequence[Row], out: Path) -> None:
    columns = [
        "problem",
        "optimizer",
        "budget",
        "seed",
        "status",
        "cost",
        "violation",
        "nfev",
        "gradients",
        "seconds",
        "construct_seconds",
        "stop",
        "failures",
        "first_failure",
        "error_message",
        "cpu",
    ]
    rows = [[str(row.get(c)) for c in columns] for row in searches]
    _write_csv(out / "searches.csv", columns, sorted(rows))


def _write_csv(path: Path, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    with whole_file(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(rows)
