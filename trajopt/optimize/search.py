"""``minimize``: the one entry to every optimizer, and the list of optimizers, one line each."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import require_whole
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Objective
from trajopt.optimize.base import Budget, Optimizer, OptimizeResult, checked_bounds, checked_x0
from trajopt.optimize.functions import as_objective
from trajopt.optimize.plugins import installed_optimizers, optimizers_of_file
from trajopt.optimize.run import Callback, Progress, Run
from trajopt.optimize.state import StateFile
from trajopt.optimize.workers import Pool

# name -> module, class or preset function that makes it, and what that is to be told
OPTIMIZERS: dict[str, tuple[str, ...]] = {
    "auto": ("portfolio", "Auto"),
    "pso": ("pso", "local_best"),
    "pso-gbest": ("pso", "constriction"),
    "pso-thesis-first": ("pso", "thesis_first"),
    "pso-thesis-enhanced": ("pso", "thesis_enhanced"),
    "pso-ring": ("pso", "ring"),
    "pso-inertia": ("pso", "falling_inertia"),
    "lattice": ("lattice", "Lattice"),
    "newton": ("newton", "Newton"),
    "ipopt": ("ipopt", "Ipopt"),
    "ipopt+newton": ("ipopt", "polished"),
    "lattice+ipopt+newton": ("ipopt", "from_lattice"),
    "slsqp": ("scipy", "ScipyLocal", "SLSQP"),
    "l-bfgs-b": ("scipy", "ScipyLocal", "L-BFGS-B"),
    "trust-constr": ("scipy", "ScipyLocal", "trust-constr"),
    "cobyqa": ("scipy", "ScipyLocal", "COBYQA"),
    "nelder-mead": ("scipy", "ScipyLocal", "Nelder-Mead"),
    "differential-evolution": ("scipy_global", "ScipyGlobal", "differential-evolution"),
    "dual-annealing": ("scipy_global", "ScipyGlobal", "dual-annealing"),
    "direct": ("scipy_global", "ScipyGlobal", "direct"),
    "least-squares": ("scipy", "LeastSquares"),
    "cma-es": ("cma_es", "CmaEs"),
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
        module, attribute, *told = OPTIMIZERS[name]
        made = getattr(importlib.import_module(f"trajopt.optimize.{module}"), attribute)
        return checked_optimizer(name, made(*told))
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
        raise ArgumentError("optimizer", name, "one of " + ", ".join([*known, *offered]))
    return checked_optimizer(name, offered[wanted]())


def checked_optimizer(name: str, made: Any) -> Optimizer:
    """``made``, if it keeps the contract of optimizers. Raises ArgumentError naming what is
    missing."""
    for attribute in ("name", "needs", "stochastic", "search"):
        if not hasattr(made, attribute):
            raise ArgumentError(
                "optimizer", name, f"an object with '{attribute}' (optimize.base.Optimizer)"
            )
    return cast(Optimizer, made)


def minimize(
    objective: Objective | Callable[..., Any],
    bounds: ArrayLike,
    *,
    jac: Callable[..., Any] | bool | None = None,
    constraints: Any = (),
    args: tuple[Any, ...] = (),
    callback: Callback | None = None,
    workers: Any = None,
    optimizer: str | Optimizer = "auto",
    x0: ArrayLike | None = None,
    seed: int = 0,
    budget: Budget | None = None,
    state: str | Path | None = None,
    progress: Progress | None = None,
) -> OptimizeResult:
    """Minimise an objective, or a plain function, inside ``bounds`` (d, 2).

    A function maps one candidate (d,) and ``args`` to a number, or a batch (n, d) to (n,); it may
    be a function or an expression of CasADi. ``jac`` gives its gradient (d,); True: the function
    returns (cost, gradient). ``constraints``: one or a list of SciPy's NonlinearConstraint,
    LinearConstraint or dictionaries, pairs of functions (g, its Jacobian or None) for g(x) >= 0,
    ("ineq", g) or ("eq", g).

    ``callback(x, cost, violation)`` sees the best so far after each evaluation (of a batch) and
    ends the search by returning True. ``workers`` (a number of processes, an executor, a Dask
    client) evaluate slow objectives at the same time. ``optimizer`` is a name
    (``optimizer_names``), an optimizer with options, or "auto", which says in the message what it
    took. The same ``seed`` and a budget in evaluations give the same bits, whatever the number of
    threads and workers. ``state`` names a file (*.npz) from which a population method goes on where
    it exists, and to which it saves itself; the budget counts anew. ``progress(evaluations,
    best_cost)`` is called where ``callback`` is.

    Ctrl-C, SIGTERM, the callback and the budget end a search without loss: the best so far is
    returned, with a status that says why. Raises ArgumentError for bad input.

    >>> found = minimize(lambda x: (x[0] - 1) ** 2 + x[1] ** 2, [[-2, 2]] * 2,
    ...                  constraints=[("ineq", lambda x: x[1] - x[0])], optimizer="slsqp")
    >>> found.x.round(3).tolist(), round(found.fun, 4)
    ([0.5, 0.5], 0.5)
    """
    box = checked_bounds(bounds)
    asked = as_objective(objective, box, jac=jac, constraints=constraints, args=args)
    box = checked_bounds(box, asked.dimension)
    start = checked_x0(x0, box)
    require_whole("seed", seed, 0, "a whole number >= 0")
    if not (budget is None or isinstance(budget, Budget)):
        raise ArgumentError("budget", budget, "a Budget, e.g. Budget(evaluations=1000)")
    for name, function in (("callback", callback), ("progress", progress)):
        if not (function is None or callable(function)):
            raise ArgumentError(name, function, "a function, or None")
    if isinstance(optimizer, str):
        method = optimizer_named(optimizer)
    else:
        method = checked_optimizer(repr(optimizer), optimizer)
    refuse_unfit(method, asked)
    kept = None
    if state is not None:
        if not getattr(method, "saves", False):
            able = ", ".join(n for n in OPTIMIZERS if getattr(optimizer_named(n), "saves", False))
            raise ArgumentError("state", str(state), f"None for {method.name}: only {able} save")
        kept = StateFile(state, method, asked, box)
    if hasattr(asked, "prepare"):
        asked.prepare()  # compiles, say, before the clock runs
    pool = Pool.of(workers, asked)
    try:
        run = Run(asked, box, budget or Budget(), progress, callback, pool, kept)
        rng = np.random.default_rng(seed)
        note = getattr(asked, "impossible", str)()
        name = str(optimizer) if optimizer in tuple(OPTIMIZERS) else method.name
        return run.finish(name, lambda: method.search(run, start, rng), note)
    finally:
        if pool is not None:
            pool.close()


def refuse_unfit(method: Optimizer, objective: Objective) -> None:
    """Raises ArgumentError where an optimizer cannot work on an objective, saying why."""
    missing = method.needs - objective.provides
    if missing:
        lacks = ", ".join(sorted(c.name.lower() for c in missing))
        expected = f"an optimizer that works without {lacks}, which this objective does not offer"
        raise ArgumentError("optimizer", method.name, expected)
    if objective.constrained and getattr(method, "only_bounds", False):
        expected = "a method that handles constraints: pso, cma-es, slsqp, trust-constr or cobyqa"
        raise ArgumentError("optimizer", method.name, expected)
