"""Damped minimum-norm Newton on residuals, inside bounds: the polish that makes a solution exact.

Each step solves J dz = -r in the least-squares, minimum-norm sense in variables scaled by the box;
variables that would leave the box are held at it and the step is solved again for the others. With
more unknowns than residuals the solution nearest to the start is approached; with fewer it is
Gauss-Newton.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, cast

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.objectives.base import Capability, ResidualObjective
from trajopt.optimize.base import Status
from trajopt.optimize.run import Run

DIFFERENCE = 1e-6  # of the box width: step of the central differences for the Jacobian
SOLVED = 1e-11  # largest weighted residual that counts as solved
MAX_STEP = 0.25  # of the box width, largest component of one step


@dataclass(frozen=True)
class Newton:
    """Newton on the residuals, whole turns fixed at each start to the nearest ones, from x0 (or the
    middle) and then from random points, until one is exact or the budget ends.

    ``starts``: number of starts at most. Where no start is exact, the best is what all came to.
    """

    name: ClassVar[str] = "newton"
    needs: ClassVar[frozenset[Capability]] = frozenset({Capability.RESIDUALS})
    stochastic: ClassVar[bool] = True

    starts: int = 100  # chosen

    def search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        """Solve from each start in turn."""
        run.constructed()
        objective = cast(ResidualObjective, run.objective)
        for index in range(self.starts):
            start = run.bounds.mean(axis=1) if x0 is None else x0
            if index:
                start = rng.uniform(run.bounds[:, 0], run.bounds[:, 1])
            run.evaluate(start[None])
            turns = objective.nearest_turns(start[None])[0]
            outcome = solve_residuals(run, objective, start, turns)
            run.nit += 1
            run.propose(outcome.x)
            run.evaluate(outcome.x[None])
            if outcome.solved:
                return Status.CONVERGED, f"exact after {run.nit} Newton solves"
        return Status.NO_EXACT, f"Newton solved none of {run.nit} starts"


@dataclass(frozen=True)
class NewtonOutcome:
    """Last point (d,), its largest gain-weighted residual, and whether that counts as solved."""

    x: Array
    residual: float
    solved: bool


def solve_residuals(
    run: Run, objective: ResidualObjective, start: Array, turns: Array, *, iterations: int = 25
) -> NewtonOutcome:
    """Newton from ``start`` (d,) with whole ``turns`` (c,) fixed: on a coarse grid first, then
    exactly.

    A dead-zone makes residuals non-smooth where a wheel only just starts to turn, so some starts
    stall; they are given up when three steps together gain less than 30 %.
    """
    width = run.bounds[:, 1] - run.bounds[:, 0]
    gains = objective.residual_gains()
    coarse = objective.coarse()
    x, norms = start.copy(), [np.inf] * 3
    for _ in range(iterations):
        r, jacobian = _linearised(run, coarse, x, turns, width)
        if not np.isfinite(jacobian).all():
            return NewtonOutcome(x, np.inf, False)
        norms.append(float(np.linalg.norm(r)))
        if _size(r, gains) < 1e-9:
            break
        if norms[-1] > 0.7 * norms[-4]:
            return NewtonOutcome(x, _size(r, gains), False)
        step = _bounded_step(jacobian, r, x, run.bounds, width)
        largest = float(np.max(np.abs(step) / width))
        if largest < 1e-13:
            break
        step *= min(1.0, MAX_STEP / largest)
        x, length = _line_search(run, coarse, x, step, turns, r)
        if length == 0.0:
            break
    return _exactly(run, objective, x, turns, width, gains)


def _exactly(
    run: Run, objective: ResidualObjective, x: Array, turns: Array, width: Array, gains: Array
) -> NewtonOutcome:
    """Chord iterations on the residuals without grid error, with the search grid's Jacobian."""
    _, jacobian = _linearised(run, objective.coarse(), x, turns, width)
    best = _exact_residuals(run, objective, x, turns)
    if not (np.isfinite(jacobian).all() and np.isfinite(best).all()):
        return NewtonOutcome(x, np.inf, False)
    for _ in range(12):
        if _size(best, gains) < SOLVED:
            break
        trial = np.clip(x + _bounded_step(jacobian, best, x, run.bounds, width), *run.bounds.T)
        r = _exact_residuals(run, objective, trial, turns)
        if not _size(r, gains) < 0.9 * _size(best, gains):
            break
        x, best = trial, r
    return NewtonOutcome(x, _size(best, gains), _size(best, gains) < 100 * SOLVED)


def _size(r: Array, gains: Array) -> float:
    return float(np.max(gains * np.abs(r)))


def _exact_residuals(run: Run, objective: ResidualObjective, x: Array, turns: Array) -> Array:
    run.spend(1)
    return np.array([float(np.squeeze(v)) for v in objective.residuals(x, turns, exact=True)])


def _grid_residuals(run: Run, objective: ResidualObjective, z: Array, turns: Array) -> Array:
    """(m, n) residuals of candidates in columns (d, n)."""
    run.spend(z.shape[1])
    return np.vstack([np.broadcast_to(v, (1, z.shape[1])) for v in objective.residuals(z, turns)])


def _linearised(
    run: Run, objective: ResidualObjective, x: Array, turns: Array, width: Array
) -> tuple[Array, Array]:
    """Residuals (m,) at x (d,) and their Jacobian (m, d) by central differences, in one batch."""
    h = np.diag(DIFFERENCE * width)
    columns = np.hstack([x[:, None], x[:, None] + h, x[:, None] - h])
    values = _grid_residuals(run, objective, columns, turns)
    d = len(x)
    return values[:, 0], (values[:, 1 : d + 1] - values[:, d + 1 :]) / (2 * DIFFERENCE * width)


def _bounded_step(jacobian: Array, r: Array, x: Array, bounds: Array, width: Array) -> Array:
    """Minimum-norm solution of jacobian @ step = -r with x + step inside the bounds (active
    set)."""
    step = np.zeros_like(x)
    free = np.ones(len(x), dtype=bool)
    for _ in range(len(x)):
        target = -(r + jacobian[:, ~free] @ step[~free])
        scaled = jacobian[:, free] * width[free]
        step[free] = width[free] * np.linalg.lstsq(scaled, target, rcond=1e-10)[0]
        beyond = np.maximum(bounds[:, 0] - (x + step), x + step - bounds[:, 1])
        beyond[~free] = -np.inf
        worst = int(np.argmax(beyond / width))
        if beyond[worst] <= 1e-15 * width[worst] or free.sum() == 1:
            break
        step[worst] = np.clip(x[worst] + step[worst], *bounds[worst]) - x[worst]
        free[worst] = False
    return np.asarray(np.clip(x + step, bounds[:, 0], bounds[:, 1]) - x)


def _line_search(
    run: Run, objective: ResidualObjective, x: Array, step: Array, turns: Array, r: Array
) -> tuple[Array, float]:
    """Shorten the step until the residual norm falls enough; all lengths tried in one batch."""
    lengths = 0.5 ** np.arange(8)
    values = _grid_residuals(run, objective, x[:, None] + step[:, None] * lengths, turns)
    norms = np.linalg.norm(values, axis=0)
    enough = norms < (1 - 1e-4 * lengths) * np.linalg.norm(r)
    if not enough.any():
        return x, 0.0
    chosen = int(np.argmax(enough))
    return x + step * lengths[chosen], float(lengths[chosen])
