"""What a benchmark of optimizers answers: who leads where and under which budget, what exactness
buys, and swarms beside other packages'."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from trajopt.arrays import Array
from trajopt.bench.problems import best_known
from trajopt.bench.profiles import superiority
from trajopt.bench.tables import GRADIENT_METHODS, NEAR, SOLVED, BenchTables, Share
from trajopt.report.files import markdown

COMPARED = ("problem", "seeds", "median cost", "theirs", "ours lower", "ours is")
# What exactness buys, part by part: from random starts and from lattice points.
_PARTS = (
    *("newton", "ipopt", "ipopt+newton", "lattice", "lattice+ipopt+newton"),
    *("least-squares", "slsqp", "pso", "auto"),
)
_PEERS = ("pyswarms", "pyswarms-constriction", "pyswarms-equal", "pymoo-pso")
_CELLS = f"Searches solved (to {SOLVED:g}); median share left; median seconds."


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
        f"known cost is left), median share left, median seconds. {tables.seeds} seeds of methods that draw.",
    ]
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


def budget_lines(budgets: Mapping[str, BenchTables]) -> list[str]:
    """Over all budgets: which side leads on each family, and how each optimizer does on all of
    them."""
    shares = {text: tables.shares() for text, tables in budgets.items()}
    one = next(iter(budgets.values()))
    leads = []
    for family in one.families():
        cells = []
        for text in budgets:
            found = shares[text].get(family, {})
            swarm = _best_of(found, lambda n: n.startswith("pso"))
            gradient = _best_of(found, lambda n: n in GRADIENT_METHODS)
            both = f"{_compare(found, swarm, gradient)}: " if swarm and gradient else ""
            names = (f"{n} {found[n].left:.0e}" for n in (swarm, gradient) if n)
            cells.append(both + ", ".join(names))
        leads.append((family, *cells))
    rows = []
    for name in one.optimizers:
        cells = []
        for families in shares.values():
            mine = [group[name] for group in families.values() if name in group]
            solved, near = (np.mean([getattr(s, k) for s in mine]) for k in ("solved", "near"))
            cells.append(f"{solved:.0%}, {near:.0%} ({len(mine)})" if mine else "")
        rows.append((name, *cells))
    return [
        f"Best swarm and best gradient method, with the median share left ({one.seeds} seeds). Budgets "
        "in evaluations have no cap on time, so that overhead does not count; budgets in seconds have "
        "none on evaluations.",
        "",
        *markdown(("family", *budgets), leads),
        "",
        "Searches solved and nearly solved, the mean over the families that an optimizer works on (how "
        f"many), {one.seeds} seeds.",
        "",
        *markdown(("optimizer", *budgets), rows),
    ]


def part_lines(tables: BenchTables) -> list[str]:
    """What each part of the exact methods does alone and with the others, beside methods that know
    nothing of exactness."""
    shares = {f: found for f, found in tables.shares().items() if "newton" in found}
    names = [name for name in _PARTS if name in tables.optimizers]
    if not shares:
        return ["No problem here has residuals."]
    rows = [(name, *(_cell(found.get(name)) for found in shares.values())) for name in names]
    return [
        "Newton and IPOPT from uniform random starts, alone and both; the lattice; all three; and "
        f"methods that know nothing of exactness. {_CELLS} {tables.seeds} seeds.",
        "",
        *markdown(("optimizer", *shares), rows),
    ]


def _cell(share: Share | None) -> str:
    if share is None:
        return ""
    return f"{share.solved:.0%}; {share.left:.0e}; {share.seconds:.2g} s"


def beaten_lines(tables: BenchTables) -> list[str]:
    """Which best known costs a search of this benchmark beat, so that they are out of date."""
    known = best_known()
    found = [
        f"{name} {known[name]['cost']:.9g} by {cost:.9g} ({who})"
        for name, (cost, who) in tables.best.items()
        if name in known and cost < known[name]["cost"] - SOLVED * tables.spread(name)
    ]
    if not found:
        return [f"No search beat a known cost by more than {SOLVED:g} of its scale.", ""]
    return [f"Beaten, so keep these rows (`trajopt bench best`): {'; '.join(found)}.", ""]


def peer_lines(tables: BenchTables) -> list[str]:
    """PSO beside pyswarms with the same coefficients on the classical functions."""
    text = []
    for name in ("pso-gbest", "pso"):
        rows = compared(tables.compared(name, "pyswarms-constriction"))
        if rows:
            text += [f"{name} (ours) and pyswarms with the coefficients of pso-gbest:", ""]
            text += [*markdown(COMPARED, rows), ""]
    return text[:-1] or ["Not in this benchmark."]


def compared(found: Sequence[tuple[str, Array, Array]]) -> list[tuple[str, ...]]:
    """Rows of COMPARED from problem, our costs and theirs: the probability that ours is lower, with
    a two-sided interval of 95 % for all rows together."""
    rows = []
    for problem, ours, theirs in found:
        likely = superiority(ours, theirs, of=len(found))
        seeds = f"{len(ours)}" if len(ours) == len(theirs) else f"{len(ours)}, {len(theirs)}"
        medians = (f"{np.median(costs):.3g}" for costs in (ours, theirs))
        rows.append((problem, seeds, *medians, str(likely), likely.verdict))
    return rows
