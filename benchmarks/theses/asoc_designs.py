"""Optimizers and Pareto fronts on [udengaard2008]'s design problem."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from benchmarks.common import ResultTable
from benchmarks.theses.asoc_study import full_factorial
from benchmarks.theses.asoc_tables_tracking import FULL, Effort
from benchmarks.theses.pareto import ParetoFront, pareto_front
from trajopt.errors import TrajoptError
from trajopt.optimize.base import Budget, Optimizer
from trajopt.optimize.ipopt import Ipopt
from trajopt.optimize.pso import thesis_enhanced, thesis_first
from trajopt.optimize.search import minimize, optimizer_names
from trajopt.systems.asoc.design import TERMS, AsocDesign
from trajopt.systems.asoc.soil import soil_named

RESTARTED = 200_000  # evaluations of the thesis's undamped swarms in restarts; ten seeds end at most 0.44 % short


def optimizers(effort: Effort) -> ResultTable:
    rows = []
    design = AsocDesign(soil_named("sandy_loam"))
    _ = design.peaks
    began = time.perf_counter()
    best, total = full_factorial(design)
    rows.append(
        (
            "full factorial 31^4",
            f"{total:.5f}",
            "",
            "923521",
            f"{1e3 * (time.perf_counter() - began):.0f}",
            " ".join(f"{v:.4f}" for v in best),
            "",
        )
    )
    evaluations = 25_000 if effort is FULL else 6_000
    special: dict[str, tuple[Optimizer, int]] = {
        "ipopt, 1 start": (Ipopt(starts=1), evaluations),
        "pso-thesis-first, restarts": (
            replace(thesis_first(), stagnation=20, restart=True),
            RESTARTED,
        ),
        "pso-thesis-enhanced, restarts": (
            replace(thesis_enhanced(), stagnation=20, restart=True),
            RESTARTED,
        ),
    }
    for name in (*special, *optimizer_names()):
        method, allowed = special.get(name, (name, evaluations))
        budget = Budget(evaluations=allowed)
        try:
            minimize(
                design, design.bounds, optimizer=method, budget=Budget(evaluations=10)
            )  # loads packages
            began = time.perf_counter()
            found = minimize(design, design.bounds, optimizer=method, seed=1, budget=budget)
        except TrajoptError as refusal:
            rows.append((name, "", "", "", "", "", str(refusal)))
            continue
        rows.append(
            (
                name,
                f"{-found.fun:.5f}",
                f"{100 * (-found.fun / total - 1):+.3f} %",
                str(found.nfev),
                f"{1e3 * (time.perf_counter() - began):.0f}",
                " ".join(f"{v:.4f}" for v in found.x),
                found.status.name.lower(),
            )
        )
    return ResultTable(
        "Design problem, sandy loam, three ASOCs, physical reading: the same J by every optimizer",
        (
            "optimizer",
            "J",
            "against factorial",
            "evaluations",
            "ms",
            "offset split gap width, m",
            "note",
        ),
        rows,
    )


def pareto(effort: Effort) -> tuple[ResultTable, ParetoFront, AsocDesign]:
    design = AsocDesign(soil_named("sandy_loam"))
    front = pareto_front(
        design.term_values, design.bounds, len(TERMS), seed=1, generations=effort.pareto
    )
    peaks = np.array([design.peaks[t] for t in TERMS])
    rows = []
    for k, name in enumerate(TERMS):
        i = int(np.argmax(front.terms[:, k]))
        rows.append(
            (
                f"most {name}",
                *(f"{v:.3f}" for v in front.terms[i] / peaks),
                " ".join(f"{v:.3f}" for v in front.designs[i]),
            )
        )
    return (
        ResultTable(
            f"Pareto front (NSGA-II, {len(front.terms)} designs), terms as shares of the factorial's best",
            ("design", *TERMS, "offset split gap width, m"),
            rows,
        ),
        front,
        design,
    )
