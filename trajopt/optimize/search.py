"""``minimize``: the one entry to every optimizer, and the list of optimizers, one line each."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import require_whole
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability, Objective
from trajopt.optimize.base import Budget, Optimizer, OptimizeResult, checked_bounds
from trajopt.optimize.functions import as_objective
from trajopt.optimize.plugins import installed_optimizers, optimizers_of_file

# name -> module and the class or preset function that makes it with default options
OPTIMIZERS: dict[str, tuple[str, str]] = {
    "pso": ("trajopt.optimize.pso", "local_best"),
    "pso-gbest": ("trajopt.optimize.pso", "constriction"),
    "pso-thesis-first": ("trajopt.optimize.pso", "thesis_first"),
    "pso-thesis-enhanced": ("trajopt.optimize.pso", "thesis_enhanced"),
    "pso-ring": ("trajopt.optimize.pso", "ring"),
    "pso-inertia": ("trajopt.optimize.pso", "falling_inertia"),
    "lattice": ("trajopt.optimize.lattice", "Lattice"),
    "ipopt": ("trajopt.optimize.ipopt", "Ipopt"),
    "slsqp": ("trajopt.optimize.scipy", "slsqp"),
    "l-bfgs-b": ("trajopt.optimize.scipy", "l_bfgs_b"),
    "trust-constr": ("trajopt.optimize.scipy", "trust_constr"),
    "nelder-mead": ("trajopt.optimize.scipy", "nelder_mead"),
    "differential-evolution": ("trajopt.optimize.scipy", "DifferentialEvolution"),
    "dual-annealing": ("trajopt.optimize.scipy", "DualAnnealing"),
    "least-squares": ("trajopt.optimize.scipy", "LeastSquares"),
    "cma-es": ("trajopt.optimize.cma_es", "CmaEs"),
    "direct": ("trajopt.optimize.nlopt", "direct"),
    "bobyqa": ("trajopt.optimize.nlopt", "bobyqa"),
    "hybrid": ("trajopt.optimize.hybrid", "hybrid"),
}


def optimizer_names() -> tuple[str, ...]:
    """All optimizers: the package's own, then those of installed packages and of files in
    TRAJOPT_PLUGINS."""
    return (*OPTIMIZERS, *(name for name in installed_optimizers() if name not in OPTIMIZERS))


def optimizer_named(name: str) -> Optimizer:
    """The optimizer called ``name`` with its default options.

    Also one of an installed package, or of a file: "file.py" or "file.py:name" (see
    ``optimize.plugins``). Raises ArgumentError for an unknown name.
    """
    if name in OPTIMIZERS:
        module, attribute = OPTIMIZERS[name]
        return checked_optimizer(name, getattr(importlib.import_module(module), attribute)())
    file, _, wanted = (
        name.partition(".py:") if ".py:" in name else (name.removesuffix(".py"), "", "")
    )
    if file != name:
        offered = optimizers_of_file(file + ".py")
        wanted = wanted or next(iter(offered))
    else:
        offered, wanted = installed_optimizers(), name
    if wanted not in offered:
        known = OPTIMIZERS if file == name else ()
        raise ArgumentError("optimizer", name, "auto or one of " + ", ".join([*known, *offered]))
    return checked_optimizer(name, offered[wanted]())


def checked_optimizer(name: str, made: Any) -> Optimizer:
    """``made``, if it keeps the contract of optimizers. Raises ArgumentError naming what is
    missing."""
    for attribute in ("name", "needs", "stochastic", "minimize"):
        if not hasattr(made, attribute):
            raise ArgumentError(
                "optimizer", name, f"an object with '{attribute}' (optimize.base.Optimizer)"
            )
    return cast(Optimizer, made)


def automatic(objective: Objective) -> str:
    """Name of the optimizer that suits an objective best.

    The lattice where it is exact by construction; otherwise the swarm, which asks nothing of the
    objective.
    """
    if hasattr(objective, "affine_part"):
        return "lattice"
    return "pso" if Capability.BATCH in objective.provides else "differential-evolution"


def minimize(
    objective: Objective | Callable[[Any], Any],
    bounds: ArrayLike,
    *,
    optimizer: str | Optimizer = "auto",
    x0: ArrayLike | None = None,
    seed: int = 0,
    budget: Budget | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> OptimizeResult:
    """Minimise an objective, or a plain function, inside ``bounds`` (d, 2).

    A function may map one candidate (d,) to a number, or a batch (n, d) to (n,). ``optimizer`` is a
    name (see ``OPTIMIZERS``), an optimizer with options, or "auto", which says in the message what
    it took. The same ``seed`` and a budget in evaluations give the same bits.
    ``progress(evaluations, best_cost)`` is called after every batch. Raises ArgumentError for bad
    input.
    """
    box = checked_bounds(bounds)
    problem = as_objective(objective, box)
    require_whole("seed", seed, 0, "a whole number >= 0")
    chosen = automatic(problem) if optimizer == "auto" else optimizer
    method = (
        optimizer_named(chosen)
        if isinstance(chosen, str)
        else checked_optimizer(repr(chosen), chosen)
    )
    if not (budget is None or isinstance(budget, Budget)):
        raise ArgumentError("budget", budget, "a Budget, e.g. Budget(evaluations=1000)")
    missing = method.needs - problem.provides
    if missing:
        raise ArgumentError(
            "optimizer",
            method.name,
            "an optimizer that works without "
            + ", ".join(sorted(c.name.lower() for c in missing))
            + ", which this objective does not offer",
        )
    return method.minimize(
        problem,
        box,
        x0=x0,
        rng=np.random.default_rng(seed),
        budget=budget or Budget(),
        progress=progress,
    )
