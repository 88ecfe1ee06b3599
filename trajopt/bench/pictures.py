"""The page of an optimizer benchmark: answers in words, tables (Markdown, CSV), profiles (PNG,
SVG)."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter

from trajopt.arrays import Array
from trajopt.bench.profiles import data_profile, ecdf, holm, performance_profile
from trajopt.bench.tables import GRADIENT_METHODS, NEAR, SOLVED, BenchTables, Share
from trajopt.report.files import markdown
from trajopt.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    in_style,
    new_figure,
)
from trajopt.sweeps.store import Store

_COLOURS = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK, GREY)
_DASHES = ("-", "--", ":")
_SMALL_COLOURS = 48  # of a small picture, chosen
_LEVEL = 0.05  # of significance
_BUILT_FOR = 5  # searches that share one construction: seeds in a row
_PEERS = ("pyswarms", "pyswarms-constriction", "pyswarms-equal", "pymoo-pso")
_SHOWN = (
    "pso",
    "pso-gbest",
    "pso-thesis-enhanced",
    "pyswarms",
    "cma-es",
    "differential-evolution",
    "hybrid",
    "lattice",
    "ipopt",
    "slsqp",
    "l-bfgs-b",
    "least-squares",
)  # in the small pictures, where they apply
PROFILE_SHARE = (
    1e-5  # of reference - best: the accuracy of data and performance profiles; Moré and Wild's tau
)


def write_report(store: Store, out: Path) -> Path:
    """Write index.md, the CSV tables and the figures of a benchmark's rows into ``out``; index.md's
    path."""
    out.mkdir(parents=True, exist_ok=True)
    tables = BenchTables(store.frame().to_dict("records"))
    figures = [_ecdf_figure(tables, out), _profile_figure(tables, out), _family_figure(tables, out)]
    text = [
        "# Optimizers compared",
        "",
        run_line(store, tables),
        "",
        "## Answers",
        "",
        *answer_lines(tables),
        "",
    ]
    text += ["## Share of searches solved", "", *share_lines(tables, out), ""]
    text += [
        "Each curve counts only the problems its optimizer can work on (the lattice needs affine wheel "
        "angles, for example), so compare curves of optimizers with the same problems: the table tells which."
    ]
    for title, file in figures:
        text += ["", f"## {title}", "", f"![{title}]({file})"]
    text += ["", "## Expected running time", "", *_running_table(tables, out)]
    text += ["", "## Construction", "", *_construction(tables, out)]
    text += ["", "## PSO against pyswarms", "", *peer_lines(tables)]
    text += [
        "",
        "## Best known costs",
        "",
        *markdown(
            ("problem", "best cost", "found by"),
            [(name, f"{cost:.6g}", who) for name, (cost, who) in tables.best.items()],
        ),
    ]
    text += ["", "## Searches that failed", "", *_failures(tables)]
    _raw(tables, out)
    page = out / "index.md"
    page.write_text("\n".join(text) + "\n", encoding="utf-8")
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
    for family, found in shares.items():
        names = [
            _best_of(found, wanted)
            for wanted in (
                lambda _: True,
                lambda n: n.startswith("pso"),
                lambda n: n in GRADIENT_METHODS,
                lambda n: n in _PEERS,
            )
        ]
        side = _compare(found, names[1], names[2]) if names[1] and names[2] else ""
        rows.append(
            (family, *(_told(name, found) if name else "none fits" for name in names), side)
        )
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
    exact = [(family, found) for family, found in shares.items() if "lattice" in found]
    parts = []
    for family, found in exact:
        other = _best_of(found, lambda n: n not in ("lattice", "ipopt"))
        if other:
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
    a, b = _rank(found[swarm])[:3], _rank(found[gradient])[:3]
    if a == b:
        return (
            "tie"
            if found[swarm].seconds == found[gradient].seconds
            else (
                "tie; PSO sooner"
                if found[swarm].seconds < found[gradient].seconds
                else "tie; gradients sooner"
            )
        )
    return "PSO" if a < b else "gradients"


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
        rows.append(
            (
                name,
                *(
                    "" if c is None else f"{c.solved:.0%}, {c.near:.0%}, {c.left:.0e}"
                    for c in cells
                ),
            )
        )
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
        (
            problem,
            name,
            f"{e.value:.4g}",
            f"{e.low:.4g}",
            f"{e.high:.4g}",
            f"{e.successes}/{e.runs}",
        )
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
    families = list(dict.fromkeys(family for family, *_ in found))
    table = {(family, name): seconds for family, name, seconds in found}
    rows = [
        (
            name,
            *(
                f"{table[family, name]:.2g}" if (family, name) in table else ""
                for family in families
            ),
        )
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
    shown = rows[:40]
    text = markdown(
        ("problem", "optimizer", "seed", "status", "failed evaluations", "first reason"), shown
    )
    return (
        text
        if len(rows) == len(shown)
        else [*text, "", f"and {len(rows) - len(shown)} more (searches.csv)"]
    )


def _raw(tables: BenchTables, out: Path) -> None:
    columns = (
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
    )
    rows = [[str(row.get(c)) for c in columns] for row in tables.rows]
    _write_csv(out / "searches.csv", columns, sorted(rows))


def _ecdf_figure(tables: BenchTables, out: Path) -> tuple[str, str]:
    with in_style():
        figure = new_figure(3.8, 9.5)
        left, middle, right = figure.subplots(1, 3, sharey=True)
        for axes, unit in (
            (left, "evaluations"),
            (middle, "evaluations and gradients"),
            (right, "seconds"),
        ):
            times = tables.times(unit)  # type: ignore[arg-type]
            if unit != "seconds":
                times = times / tables.dimension[:, None, None, None]
            _curves(axes, tables, times, lambda table, budget: ecdf(table, budget))
            axes.set_xlabel("seconds" if unit == "seconds" else f"{unit} / dimension")
        left.set_ylabel("share of targets reached")
        middle.set_title("gradients count as n evaluations")
        handles, labels = right.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper")
        return "Targets reached (ECDF over problems, seeds and targets)", _saved(
            figure, out, "ecdf"
        )


def _profile_figure(tables: BenchTables, out: Path) -> tuple[str, str]:
    with in_style():
        figure = new_figure(3.8, 9.5)
        left, right = figure.subplots(1, 2, sharey=True)
        evaluations = tables.times("evaluations", [PROFILE_SHARE])[..., 0]
        _curves(
            left,
            tables,
            evaluations,
            lambda table, b: data_profile(table, tables.dimension, b),
            scale=1 / 3,
        )
        left.set_xlabel("evaluations / (dimension + 1)")
        left.set_ylabel("share solved")
        left.set_title("data profile")
        ratios = np.geomspace(1.0, 1e4, 200)
        curves = performance_profile(tables.times("seconds", [PROFILE_SHARE])[..., 0], ratios)
        for k, name in enumerate(tables.optimizers):
            _steps(right, ratios, curves[:, k], k, name)
        right.set_xscale("log")
        right.set_xlabel("seconds / seconds of the fastest")
        right.set_title("performance profile")
        handles, labels = right.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right upper")
        return f"Data and performance profiles (accuracy {PROFILE_SHARE:g})", _saved(
            figure, out, "profiles"
        )


def _family_figure(tables: BenchTables, out: Path) -> tuple[str, str]:
    """One small picture a family: share of targets reached over seconds, of the methods people
    choose between."""
    with in_style():
        families = tables.families()
        figure = new_figure(2.4 * ((len(families) + 3) // 4) + 0.4, 10.0)
        grid = figure.subplots(
            (len(families) + 3) // 4, min(4, len(families)), squeeze=False
        ).ravel()
        chosen = [k for k, name in enumerate(tables.optimizers) if name in _SHOWN]
        times = tables.times("seconds")[:, chosen]
        for axes, (family, places) in zip(grid, families.items(), strict=False):
            part = times[places]
            finite = part[np.isfinite(part) & (part > 0)]
            axes.set_title(family.replace(", ", "\n"), fontsize=8)
            axes.set_ylim(0.0, 1.02)
            axes.set_xscale("log")
            axes.xaxis.set_minor_formatter(NullFormatter())
            if not finite.size:
                continue
            budgets = np.geomspace(finite.min(), finite.max(), 200)
            curves = ecdf(part, budgets)
            for i, k in enumerate(chosen):
                shown = _SHOWN.index(tables.optimizers[k])
                _steps(axes, budgets, curves[:, i], shown, tables.optimizers[k])
        for axes in grid[len(families) :]:
            axes.set_axis_off()
        handles, labels = grid[0].get_legend_handles_labels()
        for axes in grid[1:]:
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                if label not in labels:
                    handles.append(handle)
                    labels.append(label)
        figure.legend(handles, labels, loc="outside right upper", fontsize=8)
        figure.supxlabel("seconds of processor time", fontsize=9)
        figure.supylabel("share of targets reached", fontsize=9)
        return "Targets reached over time, family by family", _saved(figure, out, "families")


def _curves(
    axes: Axes, tables: BenchTables, times: Array, share: object, scale: float = 1.0
) -> None:
    finite = times[np.isfinite(times) & (times > 0)]
    if not finite.size or not callable(share):
        return
    budgets = np.geomspace(finite.min() * scale, finite.max(), 200)
    curves = share(times, budgets)
    for k, name in enumerate(tables.optimizers):
        _steps(axes, budgets, curves[:, k], k, name)
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.02)


def _steps(axes: Axes, x: Array, y: Array, place: int, name: str) -> None:
    """One optimizer's step curve; its ``place`` in the order chooses colour and dash."""
    style = {"color": _COLOURS[place % 8], "ls": _DASHES[place // 8 % 3]}
    axes.step(x, y, label=name, where="post", **style)  # type: ignore[arg-type]


def _saved(figure: object, out: Path, name: str) -> str:
    for kind in ("svg", "png"):
        figure.savefig(out / f"{name}.{kind}", format=kind)  # type: ignore[attr-defined]
    return f"{name}.png"


def small_picture(source: Path, target: Path) -> None:
    """The PNG ``source`` with few colours, for a page in a repository: a third of its size."""
    from PIL import Image

    with Image.open(source) as picture:
        picture.convert("RGB").quantize(_SMALL_COLOURS).save(target, optimize=True)


def _write_csv(path: Path, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(rows)
