"""Methods of scipy.optimize behind the package's contract. The only module that imports
scipy.optimize."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, cast

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.objectives.base import Capability, Evaluation, Objective, ResidualObjective
from trajopt.optimize.base import (
    Run,
    Starts,
    Status,
)
from trajopt.optimize.method import Method, require_unconstrained

_LARGE = 1e100  # stands for an infeasible evaluation, since line searches cannot work with inf


@dataclass
class _Point:
    """Cost and violation of the last candidate, so that a method asking for both pays once."""

    run: Run
    x: Array = field(default_factory=lambda: np.zeros(0))
    value: Evaluation | None = None

    def at(self, x: Array) -> Evaluation:
        inside = np.clip(
            x, self.run.bounds[:, 0], self.run.bounds[:, 1]
        )  # undo rounding beyond the bounds
        if self.value is None or not np.array_equal(inside, self.x):
            self.x, self.value = inside.copy(), self.run.evaluate(inside[None])
        return self.value

    def cost(self, x: Array) -> float:
        return float(min(self.at(x).cost[0], _LARGE))

    def violation(self, x: Array) -> float:
        return float(min(self.at(x).violation[0], _LARGE))


@dataclass(frozen=True)
class ScipyLocal(Method):
    """A local method of scipy.optimize.minimize, started from x0 (or the middle) and then from
    random points.

    ``starts``: number of starts; later ones are drawn uniformly from the bounds. Derivatives are
    the objective's own where it offers them, SciPy's finite differences (counted as evaluations)
    otherwise.
    """

    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = True

    method: Literal["SLSQP", "L-BFGS-B", "trust-constr", "Nelder-Mead"]
    starts: int = 10  # chosen
    tolerance: float = 1e-12  # SciPy's tol; tight, because budgets end searches here

    @property
    def name(self) -> str:
        return self.method.lower()

    def _require(self, objective: Objective) -> None:
        if self.method in ("L-BFGS-B", "Nelder-Mead"):  # which know only bounds
            require_unconstrained(self.name, objective)

    def _search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        from scipy import optimize

        point = _Point(run)
        offered = Capability.GRADIENT in run.objective.provides and self.method != "Nelder-Mead"
        low, high = run.bounds.T
        options: dict[str, Any] = {"maxiter": 10_000}
        starts = Starts(run)

        def gradient(x: Array) -> Array:
            run.ngev += 1
            return np.asarray(cast(Any, run.objective).gradient(x))

        for index in range(self.starts):
            start = (low + high) / 2 if x0 is None else x0
            if index > 0:
                start = rng.uniform(low, high)
            constraints = optimize.NonlinearConstraint(point.violation, -np.inf, 0.0)
            with (
                warnings.catch_warnings()
            ):  # trust-constr warns where a gradient stays, as on piecewise linear costs
                warnings.filterwarnings("ignore", "delta_grad == 0.0", UserWarning)
                result = optimize.minimize(
                    point.cost,
                    start,
                    method=self.method,
                    bounds=optimize.Bounds(low, high),
                    tol=self.tolerance,
                    jac=gradient if offered else None,
                    options=options,
                    **({"constraints": [constraints]} if run.objective.constrained else {}),
                )
            run.nit += int(result.nit)
            starts.ended(_flagged(result) is Status.CONVERGED, str(result.message))
        return starts.verdict()


@dataclass(frozen=True)
class DifferentialEvolution(Method):
    """scipy.optimize.differential_evolution with its own defaults, ``population`` as popsize."""

    name: ClassVar[str] = "differential-evolution"
    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = True

    population: int = 15  # SciPy's default
    tolerance: float = (
        1e-12  # SciPy's tol on the population's spread; tight, because budgets end searches
    )

    def _search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        from scipy import optimize

        constrained = run.objective.constrained
        point = _Point(run)

        def costs(x: Array) -> Any:
            """SciPy hands one candidate (d,) when polishing and candidates in columns (d, n)
            otherwise."""
            if x.ndim == 1:
                return point.cost(x)
            return np.minimum(run.evaluate(x.T).cost, _LARGE)

        extra: dict[str, Any] = {"vectorized": True, "updating": "deferred"}
        if constrained:  # SciPy evaluates constraints one by one unless both are vectorised
            extra = {"constraints": (optimize.NonlinearConstraint(point.violation, -np.inf, 0.0),)}
        result = optimize.differential_evolution(
            point.cost if constrained else costs,
            optimize.Bounds(*run.bounds.T),
            x0=x0,
            rng=rng,
            popsize=self.population,
            tol=self.tolerance,
            maxiter=1_000_000,
            polish=not constrained,
            **extra,
        )
        run.nit = int(result.nit)
        return _flagged(result), str(result.message)


@dataclass(frozen=True)
class DualAnnealing(Method):
    """scipy.optimize.dual_annealing with its own defaults (generalised annealing and L-BFGS-B)."""

    name: ClassVar[str] = "dual-annealing"
    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = True

    def _require(self, objective: Objective) -> None:
        require_unconstrained(self.name, objective)

    def _search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        from scipy import optimize

        result = optimize.dual_annealing(
            _Point(run).cost,
            optimize.Bounds(*run.bounds.T),
            x0=x0,
            rng=rng,
            maxiter=1_000_000,
            maxfun=1_000_000_000,
        )
        run.nit = int(result.nit)
        return _flagged(result), str(result.message[0])


@dataclass(frozen=True)
class LeastSquares(Method):
    """scipy.optimize.least_squares (trust-region reflective) on the gain-weighted residuals, whole
    turns fixed.

    Starts from x0 or the middle, then from random points; ``starts`` in all. Derivatives are
    SciPy's finite differences, counted as evaluations.
    """

    name: ClassVar[str] = "least-squares"
    needs: ClassVar[frozenset[Capability]] = frozenset({Capability.RESIDUALS})
    stochastic: ClassVar[bool] = True

    starts: int = 20  # chosen
    tolerance: float = 1e-15  # SciPy's xtol, ftol and gtol; tight, because budgets end searches

    def _search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        from scipy import optimize

        objective = cast(ResidualObjective, run.objective)
        gains, (low, high) = objective.residual_gains(), run.bounds.T
        starts = Starts(run)
        for index in range(self.starts):
            start = rng.uniform(low, high) if index else (low + high) / 2 if x0 is None else x0
            run.evaluate(start[None])
            turns = objective.nearest_turns(start[None])[0]

            def weighted(x: Array, turns: Array = turns) -> Array:
                run.spend(1)
                values = [float(np.squeeze(v)) for v in objective.residuals(x[:, None], turns)]
                return np.asarray(gains * np.array(values))

            # SciPy asks for a start strictly inside.
            inside = np.clip(start, low + 1e-9 * (high - low), high - 1e-9 * (high - low))
            result = optimize.least_squares(
                weighted,
                inside,
                bounds=(low, high),
                x_scale=high - low,
                xtol=self.tolerance,
                ftol=self.tolerance,
                gtol=self.tolerance,
            )
            run.nit += int(result.njev)
            run.evaluate(np.clip(result.x, low, high)[None])
            run.propose(result.x)
            starts.ended(bool(result.success), str(result.message))
        return starts.verdict()


def _flagged(result: Any) -> Status:
    """SciPy's own flag as a status: its ``success`` says whether its stopping rule was met."""
    return Status.CONVERGED if result.success else Status.STALLED


def slsqp() -> ScipyLocal:
    """Sequential least-squares programming."""
    return ScipyLocal("SLSQP")


def l_bfgs_b() -> ScipyLocal:
    """Limited-memory BFGS within bounds."""
    return ScipyLocal("L-BFGS-B")


def trust_constr() -> ScipyLocal:
    """Trust-region method for constrained problems."""
    return ScipyLocal("trust-constr", starts=3)


def nelder_mead() -> ScipyLocal:
    """Simplex search within bounds."""
    return ScipyLocal("Nelder-Mead")
