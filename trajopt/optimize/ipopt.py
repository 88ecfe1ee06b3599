"""CasADi and IPOPT behind the package's contract: exact first and second derivatives of the same
formulas.

The objective's NumPy formulas run on CasADi symbols (CasADi's NumPy mode), so physics exists once.
Whole turns are parameters of the program, fixed at each start to the nearest ones; starts are
lattice points where the objective has a lattice, then x0, then seeded random points. A Newton
polish on the residuals makes the result exact where the objective has residuals. The only module
that imports casadi.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar, cast

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.objectives.base import (
    Capability,
    LatticeObjective,
    ResidualObjective,
    SymbolicObjective,
    SymbolicProblem,
)
from trajopt.optimize.base import (
    FEASIBLE,
    Run,
    Starts,
    Status,
)
from trajopt.optimize.lattice import EXACT, has_influence, lattice_points
from trajopt.optimize.method import Method
from trajopt.optimize.newton import solve_residuals


@dataclass(frozen=True)
class Ipopt(Method):
    """IPOPT from several starts, on objectives that can be written in symbols.

    ``nfev`` counts IPOPT's cost and constraint calls, one each iteration for the history, and the
    polish; ``ngev`` and ``nhev`` count its gradients and Hessians.

    ``starts``: number of starts in all. ``lattice_starts``: how many of them may be lattice points.
    ``polish``: Newton on the residuals after each start. ``stop_when_exact``: skip the remaining
    starts once the cost is below 1e-9. ``tolerance``: IPOPT's tol.
    """

    name: ClassVar[str] = "ipopt"
    needs: ClassVar[frozenset[Capability]] = frozenset({Capability.SYMBOLIC})
    stochastic: ClassVar[bool] = True

    starts: int = 20  # chosen
    lattice_starts: int = 8  # chosen
    max_iterations: int = 200
    tolerance: float = 1e-10
    polish: bool = True
    stop_when_exact: bool = True

    def _search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        program = _Program.of(self, run, cast(SymbolicObjective, run.objective))
        run.constructed()
        residual = Capability.RESIDUALS in run.objective.provides
        successes, starts = 0, Starts(run)
        for start in self._starts(run, x0, rng):
            x = program.solve(start)
            if self.polish and residual:
                with_residuals = cast(ResidualObjective, run.objective)
                turns = with_residuals.nearest_turns(x[None])[0]
                x = solve_residuals(run, with_residuals, x, turns, iterations=12).x
            run.propose(x)
            stats = program.solver.stats()
            starts.ended(bool(stats["success"]), str(stats["return_status"]))
            if residual:
                scored = run.objective.score(x)
                exact = bool(scored.cost[0] <= EXACT and scored.violation[0] <= FEASIBLE)
                successes += exact
                if exact and self.stop_when_exact:
                    break
        if not residual:
            return starts.verdict()
        status = Status.CONVERGED if successes else Status.NO_EXACT
        return status, f"{successes} of {starts.tried} starts exact"

    def _starts(self, run: Run, x0: Array | None, rng: Generator) -> list[Array]:
        """Lattice points by peak wheel rate, then x0 or the middle of the bounds, then random
        points."""
        found: list[Array] = []
        if self.lattice_starts and hasattr(run.objective, "affine_part"):
            objective = cast(LatticeObjective, run.objective)
            part = objective.affine_part()
            points = np.zeros((0, len(part.variables)))
            if has_influence(part):
                points, _ = lattice_points(part, run.bounds[part.variables])
            candidates = np.tile(part.base, (len(points), 1))
            candidates[:, part.variables] = points
            if len(points):
                order = np.argsort(objective.effort(candidates), kind="stable")
                found = list(candidates[order][: self.lattice_starts])
        found.insert(
            0 if x0 is not None else len(found), run.bounds.mean(axis=1) if x0 is None else x0
        )
        while len(found) < self.starts:
            found.append(rng.uniform(run.bounds[:, 0], run.bounds[:, 1]))
        return found[: self.starts]


@dataclass
class _Program:
    """One compiled NLP, solved from many starts."""

    run: Run
    objective: SymbolicObjective
    solver: Any
    slacks: int
    lower: Array
    upper: Array
    watch: Any

    @classmethod
    def of(cls, options: Ipopt, run: Run, objective: SymbolicObjective) -> _Program:
        """Write the objective in symbols and hand it to IPOPT."""
        import casadi as ca

        middle = run.bounds.mean(axis=1)
        parameters, slacks = objective.parameters_at(middle), objective.slacks_at(middle)
        z = ca.MX.sym("z", run.objective.dimension + len(slacks))
        p = ca.MX.sym("p", len(parameters))
        problem = _in_symbols(objective, z, p)
        constraints = ca.MX(0, 1) if problem.constraints is None else ca.MX(problem.constraints)
        watch = _watcher(ca, run, z.numel(), constraints.numel(), p.numel())
        settings: dict[str, Any] = {
            "print_time": False,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "ipopt.tol": options.tolerance,
            "ipopt.max_iter": options.max_iterations,
            "iteration_callback": watch,
            "ipopt.bound_relax_factor": 0.0,
            "error_on_fail": False,
        }
        if run.budget.seconds is not None:
            clock = "ipopt.max_wall_time" if run.budget.clock == "wall" else "ipopt.max_cpu_time"
            settings[clock] = run.budget.seconds
        nlp = {"x": z, "f": ca.MX(problem.cost), "g": constraints, "p": p}
        return cls(
            run,
            objective,
            ca.nlpsol("trajopt", "ipopt", nlp, settings),
            len(slacks),
            problem.lower,
            problem.upper,
            watch,
        )

    def solve(self, start: Array) -> Array:
        """The decision variables (d,) where IPOPT ended from ``start`` (d,)."""
        slacks = self.objective.slacks_at(start)
        d = len(start)
        self.watch.seen = 0
        solution = self.solver(
            x0=np.concatenate([start, slacks]),
            p=self.objective.parameters_at(start),
            lbx=np.concatenate([self.run.bounds[:, 0], np.zeros(self.slacks)]),
            ubx=np.concatenate([self.run.bounds[:, 1], np.full(self.slacks, np.inf)]),
            lbg=self.lower,
            ubg=self.upper,
        )
        stats = self.solver.stats()
        self.run.nit += int(stats["iter_count"])
        # IPOPT's own calls beyond the one an iterate that the watch has counted: line searches.
        self.run.nfev += max(0, int(stats.get("n_call_nlp_f", 0)) - self.watch.seen)
        self.run.ngev += int(stats.get("n_call_nlp_grad_f", 0))
        self.run.nhev += int(stats.get("n_call_nlp_hess_l", 0))
        if self.watch.stopped is not None:
            self.run.stop(self.watch.stopped)
        x = np.clip(
            np.asarray(solution["x"]).ravel()[:d], self.run.bounds[:, 0], self.run.bounds[:, 1]
        )
        if not np.all(np.isfinite(x)):
            return start
        self.run.evaluate(x[None])
        return np.asarray(x)


def _in_symbols(objective: SymbolicObjective, z: Any, p: Any) -> SymbolicProblem:
    try:
        with numpy_on_symbols(True):
            return objective.symbolic(z, p)
    except Exception as error:  # whatever a user's function raises on symbols
        raise ArgumentError(
            "objective",
            f"{type(error).__name__}: {error}",
            "a function written with NumPy "
            "functions and arithmetic on its components, so that it runs on CasADi symbols; "
            "take slsqp or pso otherwise",
        ) from error


@contextmanager
def numpy_on_symbols(on: bool) -> Iterator[None]:
    """Whether NumPy's functions and shapes hold for symbols inside the block (or the function, as a
    decorator).

    On: ``np.sin(x)`` runs on symbols, and vectors have NumPy's one dimension. Off: vectors are
    columns, and a NumPy vector times a column of symbols goes element by element, as the programs
    of this package are written. CasADi's switch is global, so each block sets what it needs and
    gives back what it found.
    """
    import casadi as ca

    before = ca.GlobalOptions.getNumpyMode()
    ca.GlobalOptions.setNumpyMode(1 if on else 0)
    try:
        yield
    finally:
        ca.GlobalOptions.setNumpyMode(before)


def _watcher(ca: Any, run: Run, nx: int, ng: int, np_: int) -> Any:
    """A CasADi callback that records each iterate in the run and stops IPOPT when the budget is
    used up."""
    d = run.objective.dimension

    class Watch(ca.Callback):  # type: ignore[misc]
        def __init__(self) -> None:
            ca.Callback.__init__(self)
            self.stopped: Status | None = None
            self.seen = 0  # iterates of this start
            self.construct("watch", {})

        def get_n_in(self) -> int:
            return int(ca.nlpsol_n_out())

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int) -> Any:
            sizes = {"f": 1, "x": nx, "lam_x": nx, "g": ng, "lam_g": ng, "p": np_, "lam_p": np_}
            return ca.Sparsity.dense(sizes.get(ca.nlpsol_out(i), 0), 1)

        def eval(self, arguments: Any) -> list[int]:
            x = np.asarray(arguments[0]).ravel()[:d]
            try:
                run.spend(1)  # IPOPT's own call
                self.seen += 1
                run.evaluate(np.clip(x, run.bounds[:, 0], run.bounds[:, 1])[None])
            except (
                Exception
            ) as stop:  # exceptions cannot cross CasADi: remember, and ask IPOPT to end
                self.stopped = getattr(stop, "status", Status.FAILED)
                return [1]
            return [0]

    return Watch()


@dataclass(frozen=True, eq=False)
class ProgramResult:
    """What IPOPT found: ``x`` (n,), ``cost``, ``solved`` (to its tolerance), its own ``status`` and
    iterations."""

    x: Array
    cost: float
    solved: bool
    status: str
    iterations: int


def variables(count: int) -> Any:
    """A column of ``count`` symbols; slices and arithmetic give expressions."""
    import casadi as ca

    return ca.MX.sym("x", count)


def stacked(parts: Sequence[Any]) -> Any:
    """One column of expressions."""
    import casadi as ca

    return ca.vertcat(*parts)


def matrix(values: Array) -> Any:
    """A matrix of numbers that multiplies expressions; zeros are left out."""
    import casadi as ca

    return ca.sparsify(ca.DM(values))


def total(column: Any) -> Any:
    """Sum of a column of expressions."""
    import casadi as ca

    return ca.sum1(column)


def smooth_table(grid: Array, values: Array) -> Callable[[Any], Any]:
    """Cubic B-spline through ``values`` (N, K) on ``grid`` (N,): expressions (1, M) -> (K, M)."""
    import casadi as ca

    table = ca.interpolant(
        "table", "bspline", [grid.tolist()], np.ascontiguousarray(values).ravel().tolist()
    )
    return lambda at: table.map(at.shape[1])(at)


def solve_program(
    x: Any,
    cost: Any,
    constraints: Any,
    *,
    start: Array,
    lower: Array,
    upper: Array,
    constraint_lower: Array,
    constraint_upper: Array,
    tolerance: float = 1e-8,
    max_iterations: int = 300,
) -> ProgramResult:
    """Minimise ``cost`` over the symbols ``x`` (n,) between bounds, with constraints between
    theirs, by IPOPT.

    Expressions come from ``variables``, ``stacked`` and ``smooth_table``. Warm start: ``start``
    (n,).
    """
    import casadi as ca

    settings: dict[str, Any] = {
        "print_time": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.tol": tolerance,
        "ipopt.max_iter": max_iterations,
        "ipopt.mu_strategy": "adaptive",
        "error_on_fail": False,
    }
    solver = ca.nlpsol("program", "ipopt", {"x": x, "f": cost, "g": constraints}, settings)
    found = solver(x0=start, lbx=lower, ubx=upper, lbg=constraint_lower, ubg=constraint_upper)
    stats = solver.stats()
    return ProgramResult(
        np.asarray(found["x"], dtype=np.float64).ravel(),
        float(found["f"]),
        bool(stats["success"]),
        str(stats["return_status"]),
        int(stats["iter_count"]),
    )
