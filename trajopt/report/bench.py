"""The page of an optimizer benchmark: answers in words, tables (Markdown, CSV), profiles (PNG, SVG)."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from trajopt.report.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, in_style, new_figure
from trajopt.study.bench_tables import GRADIENT_METHODS, SOLVED, BenchTables
from trajopt.study.profiles import data_profile, ecdf, performance_profile
from trajopt.study.store import Store

Array = NDArray[np.float64]

_COLOURS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK, GREY)
_DASHES = ("-", "--", ":")
PROFILE_SHARE = 1e-5  # of reference - best: the accuracy of data and performance profiles; Moré and Wild's tau


def write_report(store: Store, out: Path) -> Path:
    """Write index.md, the CSV tables and the figures of a benchmark's rows into ``out``; index.md's path."""
    out.mkdir(parents=True, exist_ok=True)
    tables = BenchTables(store.frame().to_dict("records"))
    figures = [_ecdf_figure(tables, out), _profile_figure(tables, out)]
    text = ["# Optimizers compared", "", _where(store, tables), "", "## Answers", ""]
    text += [f"- {line}" for line in answers(tables)]
    text += ["", "## Share of searches solved", "", f"Solved: at most {SOLVED:g} of the way from a median random point "
             "to the best known cost is left. In brackets: median share left; median seconds.", ""]
    text += _share_table(tables, out)
    text += ["", "Each curve counts only the problems its optimizer can work on (the lattice needs affine wheel "
             "angles, for example), so compare curves of optimizers with the same problems: the table tells which."]
    for title, file in figures:
        text += ["", f"## {title}", "", f"![{title}]({file})"]
    text += ["", "## Expected running time", "", *_running_table(tables, out)]
    text += ["", "## Best known costs", "", *_markdown(("problem", "best cost", "found by"), [
        (name, f"{cost:.6g}", who) for name, (cost, who) in tables.best.items()])]
    text += ["", "## Searches that failed", "", *_failures(tables)]
    _raw(tables, out)
    page = out / "index.md"
    page.write_text("\n".join(text) + "\n", encoding="utf-8")
    return page


def _where(store: Store, tables: BenchTables) -> str:
    runs = store.runs()
    last = runs[-1] if runs else {}
    versions = ", ".join(f"{k} {v}" for k, v in dict(last.get("versions", {})).items())
    cpus = ", ".join(sorted({str(row.get("cpu")) for row in tables.done}))
    return (f"{len(tables.done)} finished searches, {len(tables.rows) - len(tables.done)} others; {cpus}; commit "
            f"{last.get('commit')}; {versions}. Rows: searches.csv.")


def answers(tables: BenchTables) -> list[str]:
    """Where PSO wins, where gradients do, what exactness buys, what to take: one sentence each, from the numbers."""
    shares, lines = tables.shares(), []
    for family, found in shares.items():
        swarm = _best_of(found, lambda n: n.startswith("pso"))
        gradient = _best_of(found, lambda n: n in GRADIENT_METHODS)
        winner = _best_of(found, lambda _: True)
        text = f"**{family}**: best is {_told(winner, found)}"
        if swarm and gradient:
            side = _compare(found, swarm, gradient)
            text += f"; {side} (PSO {_told(swarm, found)}, gradients {_told(gradient, found)})"
        lines.append(text + ".")
    exact = [family for family, found in shares.items() if "lattice" in found and found["lattice"][0] > 0]
    if exact:
        parts = []
        for family in exact:
            found = shares[family]
            other = _best_of(found, lambda n: n not in ("lattice", "ipopt"))
            if other:
                parts.append(f"{family}: lattice solves {found['lattice'][0]:.0%} in {found['lattice'][2]:.3g} s, "
                             f"{other} {found[other][0]:.0%} in {found[other][2]:.3g} s")
        lines.append("**What exactness buys**: " + "; ".join(parts) + ".")
    tested = tables.compared("pso", "pyswarms-constriction")
    if tested:
        worse = [name for name, *_, p in tested if p < 0.05 / len(tested)]
        lines.append(f"**Against pyswarms with equal parameters** on {len(tested)} classical functions: PSO is "
                     f"significantly worse on {len(worse)}{' (' + ', '.join(worse) + ')' if worse else ''} (rank-sum "
                     "test, 5 %, Bonferroni).")
    overall = {name: float(np.mean([found[name][0] for found in shares.values() if name in found]))
               for name in tables.optimizers if any(name in found for found in shares.values())}
    anywhere = [n for n in overall if all(n in found for found in shares.values())]
    general = max(anywhere, key=lambda n: overall[n]) if anywhere else ""
    first = "take lattice where critical wheel angles are affine or nearly so; " if exact else ""
    lines.append("**Recommendation**: " + first
                 + (f"where nothing is known of the objective, {general} solved most over all families "
                    f"({overall[general]:.0%})." if general else "no optimizer ran on every family."))
    return lines


def _best_of(found: dict[str, tuple[float, float, float]], wanted: object) -> str:
    names = [name for name in found if callable(wanted) and wanted(name)]
    return min(names, key=lambda n: (-found[n][0], found[n][1], found[n][2])) if names else ""


def _told(name: str, found: dict[str, tuple[float, float, float]]) -> str:
    share, gap, seconds = found[name]
    return f"{name} ({share:.0%} solved, median left {gap:.1e}, {seconds:.2g} s)"


def _compare(found: dict[str, tuple[float, float, float]], swarm: str, gradient: str) -> str:
    a, b = found[swarm], found[gradient]
    if (a[0], -a[1]) == (b[0], -b[1]):
        return "PSO and gradients tie"
    return "PSO wins over gradients" if (a[0], -a[1]) > (b[0], -b[1]) else "gradients win over PSO"


def _share_table(tables: BenchTables, out: Path) -> list[str]:
    shares = tables.shares()
    rows = []
    for name in tables.optimizers:
        cells = [shares[f].get(name) for f in shares]
        rows.append((name, *("" if c is None else f"{c[0]:.0%} ({c[1]:.0e}; {c[2]:.2g} s)" for c in cells)))
    flat = [(family, name, f"{v[0]:.4f}", f"{v[1]:.6e}", f"{v[2]:.6f}") for family, found in shares.items()
            for name, v in found.items()]
    _write_csv(out / "shares.csv", ("family", "optimizer", "solved", "median_left", "median_seconds"), flat)
    return _markdown(("optimizer", *shares), rows)


def _running_table(tables: BenchTables, out: Path) -> list[str]:
    rows = [(problem, name, f"{e.value:.4g}", f"{e.low:.4g}", f"{e.high:.4g}", f"{e.successes}/{e.runs}")
            for problem, name, e in tables.running_times(PROFILE_SHARE)]
    header = ("problem", "optimizer", "evaluations", "95 % from", "to", "successes")
    _write_csv(out / "expected_running_time.csv", header, rows)
    reached = [row for row in rows if not row[5].startswith("0/")]
    return [f"Evaluations until {PROFILE_SHARE:g} is left, failures counted (inf where no search got there: "
            "expected_running_time.csv has all rows).", "", *_markdown(header, reached)]


def _failures(tables: BenchTables) -> list[str]:
    if not tables.failed:
        return ["None."]
    rows = [(str(r["problem"]), str(r["optimizer"]), str(r["seed"]), str(r["status"]), str(r.get("failures") or ""),
             str(r.get("first_failure") or r.get("error_message") or "").replace("|", "/")[:160])
            for r in tables.failed]
    shown = rows[:40]
    text = _markdown(("problem", "optimizer", "seed", "status", "failed evaluations", "first reason"), shown)
    return text if len(rows) == len(shown) else [*text, "", f"and {len(rows) - len(shown)} more (searches.csv)"]


def _raw(tables: BenchTables, out: Path) -> None:
    columns = ("problem", "optimizer", "seed", "status", "cost", "violation", "nfev", "gradients", "seconds",
               "construct_seconds", "stop", "failures", "first_failure", "error_message", "cpu")
    rows = [[str(row.get(c)) for c in columns] for row in tables.rows]
    _write_csv(out / "searches.csv", columns, sorted(rows))


def _ecdf_figure(tables: BenchTables, out: Path) -> tuple[str, str]:
    with in_style():
        figure = new_figure(3.8, 9.5)
        left, middle, right = figure.subplots(1, 3, sharey=True)
        for axes, unit in ((left, "evaluations"), (middle, "evaluations and gradients"), (right, "seconds")):
            times = tables.times(unit)  # type: ignore[arg-type]
            if unit != "seconds":
                times = times / tables.dimension[:, None, None, None]
            _curves(axes, tables, times, lambda table, budget: ecdf(table, budget))
            axes.set_xlabel("seconds" if unit == "seconds" else f"{unit} / dimension")
        left.set_ylabel("share of targets reached")
        middle.set_title("gradients count as n evaluations")
        handles, labels = right.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper")
        return "Targets reached (ECDF over problems, seeds and targets)", _saved(figure, out, "ecdf")


def _profile_figure(tables: BenchTables, out: Path) -> tuple[str, str]:
    with in_style():
        figure = new_figure(3.8, 9.5)
        left, right = figure.subplots(1, 2, sharey=True)
        evaluations = tables.times("evaluations", [PROFILE_SHARE])[..., 0]
        _curves(left, tables, evaluations, lambda table, b: data_profile(table, tables.dimension, b), scale=1 / 3)
        left.set_xlabel("evaluations / (dimension + 1)")
        left.set_ylabel("share solved")
        left.set_title("data profile")
        ratios = np.geomspace(1.0, 1e4, 200)
        curves = performance_profile(tables.times("seconds", [PROFILE_SHARE])[..., 0], ratios)
        for k, name in enumerate(tables.optimizers):
            right.step(ratios, curves[:, k], color=_COLOURS[k % 8], ls=_DASHES[k // 8 % 3], label=name, where="post")
        right.set_xscale("log")
        right.set_xlabel("seconds / seconds of the fastest")
        right.set_title("performance profile")
        handles, labels = right.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper")
        return f"Data and performance profiles (accuracy {PROFILE_SHARE:g})", _saved(figure, out, "profiles")


def _curves(axes: Axes, tables: BenchTables, times: Array, share: object, scale: float = 1.0) -> None:
    finite = times[np.isfinite(times) & (times > 0)]
    if not finite.size or not callable(share):
        return
    budgets = np.geomspace(finite.min() * scale, finite.max(), 200)
    curves = share(times, budgets)
    for k, name in enumerate(tables.optimizers):
        axes.step(budgets, curves[:, k], color=_COLOURS[k % 8], ls=_DASHES[k // 8 % 3], label=name, where="post")
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.02)


def _saved(figure: object, out: Path, name: str) -> str:
    for kind in ("svg", "png"):
        figure.savefig(out / f"{name}.{kind}", format=kind)  # type: ignore[attr-defined]
    return f"{name}.png"


def _markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return lines + ["| " + " | ".join(row) + " |" for row in rows]


def _write_csv(path: Path, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(rows)
