"""IPOPT behind the package's contract: interior points with derivatives as exact as there are.

Objectives with the capability SYMBOLIC are written in symbols once, plain functions where they run
on symbols: then first and second derivatives are exact. Otherwise first derivatives are the
objective's own or the run's differences, and IPOPT approximates the second. Each evaluation is one
of the run's, which stops IPOPT at any of them. Whole turns of a terminal objective are parameters
of the program, fixed at each start to the nearest ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, cast

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.objectives.base import (
    Capability,
    LatticeObjective,
    ResidualObjective,
    SymbolicObjective,
)
from trajopt.optimize.base import Status, Stop
from trajopt.optimize.derivatives import NoGradient, onto_constraints
from trajopt.optimize.functions import FunctionObjective
from trajopt.optimize.lattice import EXACT, has_influence, lattice_points
from trajopt.optimize.newton import solve_residuals
from trajopt.optimize.nlp import Nlp
from trajopt.optimize.run import Run
from trajopt.optimize.starts import Starts, starting_points
from trajopt.optimize.symbols import Expressions, expressions, function_in_symbols, values_of

_LARGE = 1e100  # stands for an infeasible evaluation
_BY_DIFFERENCES = 1e-7  # least tolerance where derivatives carry rounding, chosen


@dataclass(frozen=True)
class Ipopt:
    """IPOPT from several starts: x0 or the middle, then random points.

    ``starts``: number of starts in all. ``lattice_starts``: how many of them may be lattice points,
    where the objective has a lattice. ``polish``: Newton on the residuals after each start, where
    it has residuals; the remaining starts are skipped once one is exact (cost below 1e-9).
    ``tolerance``: IPOPT's tol.
    """

    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = True

    starts: int = 20  # chosen
    lattice_starts: int = 0
    max_iterations: int = 200
    tolerance: float = 1e-10
    polish: bool = False

    @property
    def name(self) -> str:
        parts = ("lattice", self.lattice_starts), ("ipopt", True), ("newton", self.polish)
        return "+".join(name for name, on in parts if on)

    def search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        """Search from each start in turn."""
        residual = Capability.RESIDUALS in run.objective.provides
        starts, exact, program = Starts(run), 0, None
        for start in self._starts(run, x0, rng):
            try:
                program = program or _Program(self, run, start)
                x, stats = program.solve(start)
            except NoGradient as error:
                starts.ended(False, str(error))
                continue
            run.nit += int(stats["iter_count"])
            if residual and self.polish:
                objective = cast(ResidualObjective, run.objective)
                turns = objective.nearest_turns(x[None])[0]
                x = solve_residuals(run, objective, x, turns, iterations=12).x
            if residual:
                run.propose(x)
            starts.ended(bool(stats["success"]), str(stats["return_status"]))
            if residual and float(run.objective.score(x).cost[0]) <= EXACT:
                exact += 1
                if self.polish:
                    break
        if not residual:
            return starts.verdict()
        status = Status.CONVERGED if exact else Status.NO_EXACT
        return status, f"{exact} of {starts.tried} starts exact"

    def _starts(self, run: Run, x0: Array | None, rng: Generator) -> Iterator[Array]:
        """x0; lattice points by peak wheel rate; then as other local methods."""
        given = 0
        if self.lattice_starts and hasattr(run.objective, "affine_part"):
            objective = cast(LatticeObjective, run.objective)
            part = objective.affine_part()
            points = np.zeros((0, len(part.variables)))
            if has_influence(part):
                points, _ = lattice_points(part, run.bounds[part.variables])
            candidates = np.tile(part.base, (len(points), 1))
            candidates[:, part.variables] = points
            if x0 is not None:
                yield x0
                given, x0 = 1, None
            if len(points):
                order = np.argsort(objective.effort(candidates), kind="stable")
                for start in candidates[order][: self.lattice_starts]:
                    yield start
                    given += 1
        yield from starting_points(run, x0, rng, self.starts - given)


class _Program:
    """One NLP, built once and solved from many starts."""

    def __init__(self, options: Ipopt, run: Run, start: Array) -> None:
        self.run, self.slacks = run, 0
        written: Expressions | None = None
        if Capability.SYMBOLIC in run.objective.provides:
            written = self._of_objective(cast(SymbolicObjective, run.objective), start)
            run.constructed()
        else:
            run.constructed()
            here = run.at(start)  # tells how many constraints there are
            self.limits = np.zeros((2, 0)) if run.limits is None else run.limits
            if np.sum(self.limits[0] == self.limits[1]) > len(start):
                raise NoGradient("IPOPT takes no more equalities than variables")
            self.values: Callable[[Array, Array], tuple[float, Array]] = self._by_run
            if isinstance(run.objective, FunctionObjective):
                written = _of_function(run, run.objective, start, float(here.cost[0]))
        tolerance = options.tolerance if written else max(options.tolerance, _BY_DIFFERENCES)
        ones = np.ones(self.slacks)
        self.nlp = Nlp(
            self.values,
            self._watch,
            np.concatenate([run.bounds[:, 0], 0.0 * ones]),
            np.concatenate([run.width, ones]),
            self.limits.shape[1],
            written,
            None if written else run.derivatives,
            tolerance,
            options.max_iterations,
        )

    def solve(self, start: Array) -> tuple[Array, dict[str, Any]]:
        """The decision variables (d,) where IPOPT ended from ``start`` (d,), and its account."""
        run, objective, d = self.run, self.run.objective, len(start)
        first, parameters = start, np.zeros(0)
        if Capability.SYMBOLIC in objective.provides:
            symbolic = cast(SymbolicObjective, objective)
            parameters = symbolic.parameters_at(start)
            first = np.concatenate([start, symbolic.slacks_at(start)])
        lower = np.concatenate([run.bounds[:, 0], np.zeros(self.slacks)])
        upper = np.concatenate([run.bounds[:, 1], np.full(self.slacks, np.inf)])
        try:
            x, stats = self.nlp.solve(first, parameters, lower, upper, self.limits)
        finally:
            if self.nlp.written is not None:
                run.ngev += int(self.nlp.account.get("n_call_nlp_grad_f", 0))
                run.nhev += int(self.nlp.account.get("n_call_nlp_hess_l", 0))
        x = np.clip(x[:d], run.bounds[:, 0], run.bounds[:, 1])
        run.at(x)
        return x if self.slacks else onto_constraints(run, x), stats

    def _of_objective(self, objective: SymbolicObjective, start: Array) -> Expressions:
        parameters, slacks = objective.parameters_at(start), objective.slacks_at(start)
        d, self.slacks = len(start), len(slacks)
        problems = []

        def write(z: object, p: object) -> tuple[object, object]:
            problems.append(objective.symbolic(z, p))
            return problems[0].cost, problems[0].constraints

        written = expressions(write, d + self.slacks, len(parameters))
        self.limits = np.stack([problems[0].lower, problems[0].upper])
        self._in_symbols = values_of(written)
        self.values = self._by_symbols
        return written

    def _by_symbols(self, z: Array, p: Array) -> tuple[float, Array]:
        self.run.spend(1)
        return self._in_symbols(z, p)

    def _by_run(self, x: Array, _: Array) -> tuple[float, Array]:
        found = self.run.at(x)
        rows = np.zeros(0) if found.constraints is None else found.constraints[0]
        return float(found.cost[0]), rows

    def _watch(self, z: Array) -> None:
        """Each iterate is evaluated as the objective sees it, for the history."""
        d = len(self.run.bounds)
        if not np.isfinite(z).all():
            return
        self.run.at(z[:d])


def _of_function(
    run: Run, function: FunctionObjective, start: Array, cost: float
) -> Expressions | None:
    """A plain function in symbols, where it runs on them and gives there what it gives for numbers.
    Calls with symbols count as evaluations."""
    if run.remaining() < 3 or function.gradient_of is True:
        return None
    functions = [lambda x: function.function(x, *function.arguments)]
    try:
        written = function_in_symbols(
            [*functions, *(c.function for c in function.constraints)],
            len(start),
            lambda: run.spend(1),
        )
        told, rows = values_of(written)(start, np.zeros(0))
    except Stop:
        raise
    except Exception:  # a function may fail in any way on symbols
        return None
    m = 0 if run.limits is None else run.limits.shape[1]
    same = bool(np.isclose(told, cost, rtol=1e-9, atol=1e-12)) and len(rows) == m
    return written if same else None


def polished() -> Ipopt:
    """IPOPT, and Newton on the residuals after each start."""
    return Ipopt(polish=True)


def from_lattice() -> Ipopt:
    """IPOPT from up to eight lattice points first, and Newton on the residuals after each start."""
    return Ipopt(polish=True, lattice_starts=8)
