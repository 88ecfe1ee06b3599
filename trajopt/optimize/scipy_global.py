"""Global methods of scipy.optimize behind the package's contract."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.objectives.base import Capability
from trajopt.optimize.base import Status
from trajopt.optimize.run import Run
from trajopt.optimize.scipy import loaded

_LARGE = 1e100  # stands for an infeasible evaluation


@dataclass(frozen=True)
class ScipyGlobal:
    """A global method of scipy.optimize with its own defaults, until it or the budget ends.

    "differential-evolution" (``population`` as popsize), "dual-annealing" (generalised annealing
    and L-BFGS-B) or "direct" (division of rectangles, locally biased [gablonsky2001]; starts in the middle, x0 is
    only evaluated first).
    """

    needs: ClassVar[frozenset[Capability]] = frozenset()

    method: Literal["differential-evolution", "dual-annealing", "direct"]
    population: int = 15  # SciPy's default
    tolerance: float = 1e-12  # SciPy's tol on the population's spread; tight: budgets end searches

    @property
    def name(self) -> str:
        return self.method

    @property
    def stochastic(self) -> bool:
        return self.method != "direct"

    @property
    def only_bounds(self) -> bool:
        return self.method != "differential-evolution"

    @property
    def saves(self) -> bool:
        return self.method == "differential-evolution"

    def search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        """Search until the budget ends."""
        optimize = loaded(run)

        def cost(x: Array) -> float:
            return float(min(run.at(x).cost[0], _LARGE))

        if self.method == "differential-evolution":
            return self._evolve(optimize, run, x0, rng)
        if self.method == "dual-annealing":
            unit = optimize.Bounds(np.zeros(len(run.width)), np.ones(len(run.width)))
            result = optimize.dual_annealing(
                lambda u: cost(run.bounds[:, 0] + run.width * u),
                unit,
                x0=None if x0 is None else (x0 - run.bounds[:, 0]) / run.width,
                rng=rng,
                maxiter=1_000_000,
                maxfun=1_000_000_000,
            )
            run.nit = int(result.nit)
            return _flagged(result), str(result.message[0])
        return self._divide(optimize, run, x0, cost)

    def _divide(
        self, optimize: Any, run: Run, x0: Array | None, cost: Callable[[Array], float]
    ) -> tuple[Status, str]:
        ended: list[Exception] = []

        def kept(x: Array) -> float:  # what is raised must not pass SciPy's C code
            if not ended:
                try:
                    if run.nfev == 0:
                        run.constructed()  # room for all rectangles: 60 ms for a million
                        if x0 is not None:
                            run.at(x0)
                    return cost(x)
                except Exception as stop:
                    ended.append(stop)
            return _LARGE

        result = optimize.direct(
            kept,
            optimize.Bounds(*run.bounds.T),
            maxfun=min(2 * run.remaining() + 100, 1_000_000),
            maxiter=100_000,
            vol_tol=0.0,
            len_tol=0.0,
            callback=lambda _: bool(ended) and _raise(ended[0]),
        )
        if ended:
            raise ended[0]
        return Status.CONVERGED, f"no rectangle is left to divide ({result.message})"

    def _evolve(
        self, optimize: Any, run: Run, x0: Array | None, rng: Generator
    ) -> tuple[Status, str]:
        from scipy.optimize._differentialevolution import DifferentialEvolutionSolver

        constrained = run.objective.constrained

        def costs(x: Array) -> Any:
            """SciPy hands one candidate (d,) where there are constraints, else columns (d, n)."""
            if x.ndim == 1:
                return float(min(run.at(x).cost[0], _LARGE))
            return np.minimum(run.evaluate(x.T).cost, _LARGE)

        extra: dict[str, Any] = {"vectorized": True, "updating": "deferred"}
        if constrained:  # SciPy evaluates constraints one by one unless both are vectorised
            kept = optimize.NonlinearConstraint(
                lambda x: float(min(run.at(x).violation[0], _LARGE)), -np.inf, 0.0
            )
            extra = {"constraints": (kept,)}
        with DifferentialEvolutionSolver(
            costs,
            optimize.Bounds(*run.bounds.T),
            x0=x0,
            rng=rng,
            popsize=self.population,
            tol=self.tolerance,
            polish=False,
            **extra,
        ) as solver:
            keeper = _Kept(solver, rng)
            run.keep(keeper)
            while not solver.converged():
                next(solver)
                run.nit += 1
                keeper.remember()
                run.checkpoint()
        return Status.CONVERGED, "the population has collapsed"


class _Kept:
    """What differential evolution needs to go on bit by bit, as it was after the last generation."""

    _NAMES = (
        "population",
        "population_energies",
        "feasible",
        "constraint_violation",
        "_random_population_index",
    )

    def __init__(self, solver: Any, rng: Generator) -> None:
        self.solver, self.rng = solver, rng
        self.remember()

    def remember(self) -> None:
        self.saved = {n: np.array(getattr(self.solver, n)) for n in self._NAMES}
        self.saved_rng = self.rng.bit_generator.state

    def pack(self) -> dict[str, Any]:
        return {**self.saved, "rng": self.saved_rng}

    def unpack(self, kept: Mapping[str, Any]) -> None:
        for name in self._NAMES:
            setattr(self.solver, name, kept[name])
        self.rng.bit_generator.state = kept["rng"]
        self.remember()


def _flagged(result: Any) -> Status:
    """SciPy's own flag as a status: its ``success`` says whether its stopping rule was met."""
    return Status.CONVERGED if result.success else Status.STALLED


def _raise(error: Exception) -> bool:
    raise error
