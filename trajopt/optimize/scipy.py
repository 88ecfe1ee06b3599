"""Local methods of scipy.optimize behind the package's contract.

They see variables scaled to the bounds, each constraint with its own value and gradient,
and derivatives by the run: the objective's own, or differences on the scale of the bounds.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, cast

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array, BoolArray
from trajopt.objectives.base import Capability, ResidualObjective
from trajopt.optimize.base import FEASIBLE, Status
from trajopt.optimize.derivatives import NoGradient, onto_constraints
from trajopt.optimize.run import Run
from trajopt.optimize.starts import Starts, starting_points

_LARGE = 1e100  # stands for an infeasible evaluation, since line searches cannot work with inf
_FAR = 1e10  # by which constraints count as broken where they could not be computed
_FLAT = 1e-6  # slope, a width of the bounds and a unit of cost, that counts as none; chosen
_NEAR = 1e-7  # by which a constraint may be missed and still holds a search back, chosen
# Iterations from one of many starts, chosen.
_OF_MANY = {"SLSQP": 100, "L-BFGS-B": 100, "trust-constr": 300, "COBYQA": 300, "Nelder-Mead": 300}
_FIRST_STEP = 0.1  # of the width: first step of methods without derivatives, chosen

Method = Literal["SLSQP", "L-BFGS-B", "trust-constr", "COBYQA", "Nelder-Mead"]
_OPTIONS: dict[str, dict[str, Any]] = {
    "COBYQA": {"initial_tr_radius": _FIRST_STEP, "feasibility_tol": FEASIBLE / 10},
}


def loaded(run: Run) -> Any:
    """scipy.optimize; the clock and the threads are looked at when all that it takes is there."""
    import scipy.linalg
    from scipy import optimize

    assert scipy.linalg
    run.constructed()
    return optimize


@dataclass(frozen=True)
class ScipyLocal:
    """A local method of scipy.optimize.minimize, started from x0 (or the middle) and then from
    random points.

    ``starts``: number of starts; later ones are drawn uniformly from the bounds. COBYQA
    [ragonneau2024] makes quadratic models without derivatives, with constraints.
    """

    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = True

    method: Method
    starts: int = 10  # chosen
    tolerance: float = 1e-12  # SciPy's tol; tight, because budgets end searches here

    @property
    def name(self) -> str:
        return self.method.lower()

    @property
    def only_bounds(self) -> bool:
        return self.method in ("L-BFGS-B", "Nelder-Mead")

    @property
    def differentiates(self) -> bool:
        """Whether the method asks for derivatives."""
        return self.method not in ("COBYQA", "Nelder-Mead")

    def search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        """Search from each start in turn."""
        optimize = loaded(run)
        starts = Starts(run)
        for start in starting_points(run, x0, rng, self.starts):
            unit = (start - run.bounds[:, 0]) / run.width
            try:
                result = self._from(optimize, run, unit)
            except (NoGradient, ValueError, ArithmeticError) as error:  # SciPy's own, too
                starts.ended(False, str(error))
                continue
            run.nit += int(getattr(result, "nit", 0))
            if self.differentiates:
                onto_constraints(run, run.bounds[:, 0] + run.width * result.x)
            converged = bool(result.success) or self._settled(optimize, run, result.x)
            starts.ended(converged, str(result.message))
        return starts.verdict()

    def _from(self, optimize: Any, run: Run, unit: Array) -> Any:
        low = run.bounds[:, 0]

        def cost(u: Array) -> float:
            return float(min(run.at(low + run.width * u).cost[0], _LARGE))

        def gradient(u: Array) -> Array:
            return np.asarray(run.derivatives(low + run.width * u)[0] * run.width)

        # Where an objective offers many starts, none is to hold the others up.
        most = _OF_MANY[self.method] if hasattr(run.objective, "starts") else 10_000
        options: dict[str, Any] = {"maxiter": most, **_OPTIONS.get(self.method, {})}
        if self.method == "COBYQA":
            options["maxfev"] = min(run.remaining() + 1, 10_000_000)
        if self.method == "Nelder-Mead":
            steps = np.where(unit + _FIRST_STEP > 1.0, -_FIRST_STEP, _FIRST_STEP)
            options["initial_simplex"] = np.vstack([unit, unit + np.diag(steps)])
        cost(unit)  # tells how many constraints there are
        with warnings.catch_warnings():
            # trust-constr warns where a gradient stays, as on piecewise linear costs, and where
            # gradients of constraints depend on each other.
            warnings.simplefilter("ignore", RuntimeWarning)
            warnings.filterwarnings("ignore", "delta_grad == 0.0", UserWarning)
            warnings.filterwarnings("ignore", "Singular Jacobian matrix", UserWarning)
            return optimize.minimize(
                cost,
                unit,
                method=self.method,
                bounds=optimize.Bounds(np.zeros(len(unit)), np.ones(len(unit))),
                tol=self.tolerance,
                jac=gradient if self.differentiates else None,
                options=options,
                **self._constraints(optimize, run),
            )

    def _constraints(self, optimize: Any, run: Run) -> dict[str, Any]:
        if not run.objective.constrained:
            return {}
        low, limits = run.bounds[:, 0], run.limits
        if limits is None:  # an objective that only tells a violation in all
            whole = optimize.NonlinearConstraint(
                lambda u: float(min(run.at(low + run.width * u).violation[0], _LARGE)), -np.inf, 0.0
            )
            return {"constraints": [whole]}
        broken = np.where(np.isfinite(limits[0]), limits[0] - _FAR, limits[1] + _FAR)

        def constraint(kind: BoolArray) -> Any:  # equalities and others apart, as SciPy wants them
            def values(u: Array) -> Array:
                found = run.at(low + run.width * u).constraints
                assert found is not None
                return np.asarray(np.where(np.isfinite(found[0]), found[0], broken)[kind])

            def jacobian(u: Array) -> Array:
                return np.asarray((run.derivatives(low + run.width * u)[1] * run.width)[kind])

            extra = {"jac": jacobian} if self.differentiates else {}
            return optimize.NonlinearConstraint(values, *limits[:, kind], **extra)

        equal = limits[0] == limits[1]
        kept = ~equal & np.isfinite(limits).any(axis=0)  # SciPy fails on those without a limit
        return {"constraints": [constraint(kind) for kind in (equal, kept) if kind.any()]}

    def _settled(self, optimize: Any, run: Run, unit: Array) -> bool:
        """Whether a method that gave up had nothing left to gain: the cost's slope is one of what
        keeps it in (Karush, Kuhn, Tucker), to rounding."""
        if not self.differentiates or (run.objective.constrained and run.limits is None):
            return False
        x, d = run.bounds[:, 0] + run.width * unit, len(unit)
        kept, limits = run.at(x).constraints, run.limits
        gradient, jacobian = (slopes * run.width for slopes in run.derivatives(x))
        values, slopes = unit, np.eye(d)
        low, high = np.zeros(d), np.ones(d)
        if kept is not None and limits is not None:
            values, slopes = np.append(unit, kept[0]), np.concatenate([slopes, jacobian])
            low, high = np.append(low, limits[0]), np.append(high, limits[1])
        if max(np.max(low - values), np.max(values - high)) > _NEAR:
            return False
        walls = np.concatenate([slopes[values <= low + _NEAR], -slopes[values >= high - _NEAR]])
        pull = optimize.nnls(walls.T, gradient)[0] @ walls if len(walls) else 0.0
        costs = [row[2] for row in run.improvements if np.isfinite(row[2])]
        scale = max(abs(run.best_cost), costs[0] - run.best_cost if costs else 0.0)
        return bool(np.max(np.abs(gradient - pull)) <= _FLAT * scale)


@dataclass(frozen=True)
class LeastSquares:
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

    def search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        """Search from each start in turn."""
        optimize = loaded(run)
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
            inside = np.clip(start, low + 1e-9 * run.width, high - 1e-9 * run.width)
            try:
                result = optimize.least_squares(
                    weighted,
                    inside,
                    bounds=(low, high),
                    x_scale=run.width,
                    xtol=self.tolerance,
                    ftol=self.tolerance,
                    gtol=self.tolerance,
                )
            except ValueError as error:  # residuals that are not finite
                starts.ended(False, str(error))
                continue
            run.nit += int(result.njev)
            run.evaluate(np.clip(result.x, low, high)[None])
            run.propose(result.x)
            starts.ended(bool(result.success), str(result.message))
        return starts.verdict()
