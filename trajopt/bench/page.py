"""The page of an optimizer benchmark: answers in words, tables (Markdown, CSV)."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from trajopt.bench.pictures import PROFILE_SHARE, save_bench_pictures
from trajopt.bench.profiles import holm
from trajopt.bench.tables import GRADIENT_METHODS, NEAR, SOLVED, BenchTables, Share
from trajopt.files import whole_file
from trajopt.report.files import markdown
from trajopt.report.viewer.bench_page import write_bench_page
from trajopt.sweeps.store import Store

_LEVEL = 0.05  # of significance
_BUILT_FOR = 5  # searches that share one construction: seeds in a row
_PEERS = ("pyswarms", "pyswarms-constriction", "pyswarms-equal", "pymoo-pso")


def write_report(store: Store, out: Path) -> Path:
    """Write index.md, a page of all of it (index.html), the CSV tables and the figures of a
    benchmark's rows into ``out``; index.md's path."""
    out.mkdir(parents=True, exist_ok=True)
    tables = BenchTables(store.frame().to_dict("records"))
    figures = save_bench_pictures(tables, out)
    curves = (
        "Each curve counts only the problems its optimizer can work on (the lattice needs affine wheel "
        "angles, for example), so compare curves of optimizers with the same problems: the table tells which."
    )
    best = [(name, f"{cost:.6g}", who) for name, (cost, who) in tables.best.items()]
    sections = {
        "Answers": answer_lines(tables),
        "Share of searches solved": [*share_lines(tables, out), "", curves],
        **{title: [f"![{title}]({file})"] for title, (file, _) in figures.items()},
        "Expected running time": _running_table(tables, out),
        "Construction": _construction(tables, out),
        "PSO against pyswarms": peer_lines(tables),
        "Best known costs": markdown(("problem", "best cost", "found by"), best),
        "Searches that failed": _failures(tables),
    }
    write_bench_page(
        out / "index.html", run_line(store, tables), [f for _, f in figures.values()], sections
    )
    text = ["# Optimizers compared", "", run_line(store, tables)]
    for title, lines in sections.items():
        text += ["", f"## {title}", "", *lines]
    _raw(tables, out)
    page = out / "index.md"
    with whole_file(page) as part:
        part.write_text("\n".join(text) + "\n", encoding="utf-8")
    return page


def run_line(store: Store, tables: BenchTables) -> str:
    """What ran, where, with what, and how long."""
    runs = store.runs()
    last = runs[-1] if runs else {}
    versions = ", ".join(f"{k} {v}" for k, v in dict(last.get("versions", {})).items())
    cpus = ", ".join(sorted({str(row.get("cpu")) for row in tables.done}))
    spent = sum(
        float(row["seconds"]) + float(row["construct_seconds"]) / _BUILT_FOR for row in tables.done
    )
    seeds = len({row["seed"] for row in tables.rows})
    planned = f" of {int(last['cases'])} planned" if "cases" in last else ""
    return (
        f"{len(tables.done)} finished searches{planned}, {len(tables.rows) - len(tables.done)} others: "
        f"{len(tables.problems)} problems, {len(tables.optimizers)} optimizers, {seeds} seeds; about "
        f"{spent / 60:.0f} min of processor time, in {len(runs)} run(s). Seconds are processor time of one "
        f"thread. {cpus}; commit {str(last.get('commit'))[:7]}; {versions}. Rows: searches.csv."
    )


def answer_lines(tables: BenchTables) -> list[str]:
    """Where PSO wins, where gradients do, what exactness buys, what to take: Markdown from the
    numbers."""
    shares = tables.shares()
    rows = []
    kinds: tuple[Callable[[str], bool], ...] = (
        lambda _: True,
        lambda name: name.startswith("pso"),
        lambda name: name in GRADIENT_METHODS,
        lambda name: name in _PEERS,
    )
    for family, found in shares.items():
        names = [_best_of(found, wanted) for wanted in kinds]
        side = _compare(found, names[1], names[2]) if names[1] and names[2] else ""
        told = (_told(name, found) if name else "none fits" for name in names)
        rows.append((family, *told, side))
    header = (
        "family",
        "best of all",
        "best PSO",
        "best gradient method",
        "best peer's PSO",
        "PSO or gradients",
    )
    text = markdown(header, rows)
    text += [
        "",
        f"In brackets: searches solved (at most {SOLVED:g} of the way from a median random point to the best "
        "known cost is left), median share left, median seconds.",
    ]
    parts = []
    for family, found in shares.items():
        other = _best_of(found, lambda n: n not in ("lattice", "ipopt"))
        if "lattice" in found and other:
            parts.append(
                f"- {family}: {_told('lattice', found)}; best that knows nothing of exactness: "
                f"{_told(other, found)}"
            )
    if parts:
        text += ["", "What exactness buys:", "", *parts]
    overall = {
        name: float(np.mean([found[name].near for found in shares.values()]))
        for name in tables.optimizers
        if all(name in found for found in shares.values())
    }
    if overall:
        ranked = sorted(overall, key=lambda n: -overall[n])
        text += [
            "",
            f"Methods that work on every family, by the mean share of searches nearly solved (to {NEAR:g}): "
            + ", ".join(f"{name} {overall[name]:.0%}" for name in ranked)
            + ".",
        ]
    return text


def _best_of(found: dict[str, Share], wanted: Callable[[str], bool]) -> str:
    names = [name for name in found if wanted(name)]
    return min(names, key=lambda n: _rank(found[n])) if names else ""


def _rank(share: Share) -> tuple[float, ...]:
    """Less left in the median search first, then more solved, more nearly solved, less time."""
    return _leading(share.left), -share.solved, -share.near, share.seconds


def _leading(left: float) -> float:
    """Two digits of the share left, at least SOLVED: what is below differs by rounding alone."""
    return max(float(f"{left:.1e}"), SOLVED) if np.isfinite(left) else left


def _told(name: str, found: dict[str, Share]) -> str:
    share = found[name]
    return f"{name} ({share.solved:.0%}; {share.left:.1e}; {share.seconds:.2g} s)"


def _compare(found: dict[str, Share], swarm: str, gradient: str) -> str:
    a, b = _rank(found[swarm]), _rank(found[gradient])
    if a[:3] != b[:3]:
        return "PSO" if a < b else "gradients"
    if a[3] == b[3]:
        return "tie"
    return "tie; PSO sooner" if a[3] < b[3] else "tie; gradients sooner"


def peer_lines(tables: BenchTables) -> list[str]:
    """PSO beside pyswarms with the same coefficients on the classical functions: rank-sum test,
    Holm's correction."""
    text = []
    for name in ("pso-gbest", "pso"):
        tested = tables.compared(name, "pyswarms-constriction")
        if not tested:
            continue
        corrected = holm([p for *_, p in tested])
        rows = [
            (problem, f"{ours:.3g}", f"{theirs:.3g}", f"{p:.3f}", "yes" if p < _LEVEL else "no")
            for (problem, ours, theirs, _), p in zip(tested, corrected, strict=True)
        ]
        header = (
            "problem",
            f"{name}, median cost",
            "pyswarms, same coefficients",
            "p (Holm)",
            "significantly worse",
        )
        text += [*markdown(header, rows), ""]
    return text[:-1] or ["Not in this benchmark."]


def share_lines(tables: BenchTables, out: Path) -> list[str]:
    """The table of shares as Markdown, and as shares.csv in ``out``."""
    shares = tables.shares()
    rows = []
    for name in tables.optimizers:
        cells = [shares[f].get(name) for f in shares]
        told = ("" if c is None else f"{c.solved:.0%}, {c.near:.0%}, {c.left:.0e}" for c in cells)
        rows.append((name, *told))
    flat = [
        (family, name, f"{v.solved:.4f}", f"{v.near:.4f}", f"{v.left:.6e}", f"{v.seconds:.6f}")
        for family, found in shares.items()
        for name, v in found.items()
    ]
    _write_csv(
        out / "shares.csv",
        ("family", "optimizer", "solved", "near", "median_left", "median_seconds"),
        flat,
    )
    return [
        f"Searches solved (to {SOLVED:g}), nearly solved (to {NEAR:g}), and the median share left. Empty: the "
        "optimizer does not work on this family.",
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


def _raw(tables: BenchTables, out: Path) -> None:
    columns = [
        "problem",
        "optimizer",
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
    rows = [[str(row.get(c)) for c in columns] for row in tables.rows]
    _write_csv(out / "searches.csv", columns, sorted(rows))


def _write_csv(path: Path, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    with whole_file(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(rows)
