"""Global-best particle swarm optimisation, hand-written (thesis 000, Tables 4.2 and 4.3).

The exact update of particle i in dimension j at iteration k, with r1, r2 uniform in [0, 1), drawn anew for
every particle, dimension and iteration:

    v_ij <- w v_ij + c1 r1 (p_ij - x_ij) + c2 r2 (g_j - x_ij),      x_ij <- x_ij + v_ij

p_i is the particle's best position and g the swarm's, both after all particles of the iteration were
evaluated (synchronous update). "Best" is Deb's feasibility rule. Velocities start at zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability, Objective
from trajopt.optimize.base import FEASIBLE, Budget, OptimizeResult, Progress, Run, Status, best_index, checked_bounds, checked_x0

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ParticleSwarm:
    """gbest PSO. Defaults are the constriction PSO; ``thesis_first`` and ``thesis_enhanced`` are presets.

    ``boundary``: what happens to a particle that leaves the bounds. "reset" draws a new position inside 0.9
    of the space (thesis 000, Table 5.4) and stops the particle; "none" leaves it outside, where it counts as
    infeasible; "reflect" mirrors it back and reverses its velocity.
    ``start``: "uniform" draws positions uniformly; "grid" lays the first two variables on a grid (Table 5.4).
    """

    name: ClassVar[str] = "pso"
    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = True

    particles: int = 50  # thesis 000, section 4.2.2
    inertia: float = 0.7298  # Clerc and Kennedy 2002: constriction factor for phi = 4.1
    cognitive: float = 1.49618  # 0.7298 * 2.05, the same source
    social: float = 1.49618
    boundary: Literal["reset", "reflect", "none"] = "reflect"
    start: Literal["uniform", "grid"] = "uniform"

    def __post_init__(self) -> None:
        if self.particles < 2:
            raise ArgumentError("particles", self.particles, "at least 2")
        if self.boundary not in ("reset", "reflect", "none"):
            raise ArgumentError("boundary", self.boundary, "reset, reflect or none")
        if self.start not in ("uniform", "grid"):
            raise ArgumentError("start", self.start, "uniform or grid")

    def minimize(self, objective: Objective, bounds: ArrayLike, *, x0: ArrayLike | None = None,
                 rng: Generator, budget: Budget, progress: Progress | None = None) -> OptimizeResult:
        """Search until the budget ends. ``x0`` (d,) becomes the first particle's position."""
        box = checked_bounds(bounds, objective.dimension)
        run = Run(objective, box, budget, progress)
        return run.finish(self.name, lambda: self.search(run, checked_x0(x0, box), rng))

    def search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        """The iterations; ends by the run's budget, or when the swarm has collapsed to one point."""
        low, width = run.bounds[:, 0], run.bounds[:, 1] - run.bounds[:, 0]
        x = self._positions(run.bounds, rng)
        if x0 is not None:
            x[0] = x0
        v = np.zeros_like(x)
        result = run.evaluate(x)
        own, own_cost, own_violation = x.copy(), result.cost, result.violation
        while True:
            run.nit += 1
            leader = own[best_index(own_cost, own_violation)]
            r = rng.random((2, *x.shape))
            v = self.inertia * v + self.cognitive * r[0] * (own - x) + self.social * r[1] * (leader - x)
            x = x + v
            self._keep_inside(x, v, low, width, rng)
            if np.all(np.abs(v) <= 1e-15 * width) and np.all(np.abs(x - leader) <= 1e-15 * width):
                return Status.CONVERGED, "the swarm has collapsed to one point"
            result = run.evaluate(x)
            improved = _improved(result.cost, result.violation, own_cost, own_violation)
            own[improved] = x[improved]
            own_cost = np.where(improved, result.cost, own_cost)
            own_violation = np.where(improved, result.violation, own_violation)

    def _positions(self, bounds: Array, rng: Generator) -> Array:
        low, width = bounds[:, 0], bounds[:, 1] - bounds[:, 0]
        x = low + width * rng.random((self.particles, len(bounds)))
        if self.start == "grid" and len(bounds) >= 2:
            # Table 5.4 prints a row index it does not use; we read a grid of n/10 columns by 10 rows with
            # spacings of 1/(n/10 + 1) and 1/11 of the space.
            columns = max(1, self.particles // 10)
            i = np.arange(self.particles)
            x[:, 0] = low[0] + width[0] * (i // 10 % columns + 1) / (columns + 1)
            x[:, 1] = low[1] + width[1] * (i % 10 + 1) / 11
        return x

    def _keep_inside(self, x: Array, v: Array, low: Array, width: Array, rng: Generator) -> None:
        """Apply the boundary rule in place."""
        outside = (x < low) | (x > low + width)
        if self.boundary == "none" or not outside.any():
            return
        if self.boundary == "reflect":
            t = np.mod((x - low) / width, 2.0)
            x[outside] = (low + width * np.where(t > 1.0, 2.0 - t, t))[outside]
            v[outside] *= -1.0
            return
        rows = outside.any(axis=1)
        centre = low + width / 2
        x[rows] = centre + 0.9 * (rng.random((int(rows.sum()), x.shape[1])) - 0.5) * width
        v[rows] = 0.0


def _improved(cost: Array, violation: Array, old_cost: Array, old_violation: Array) -> NDArray[np.bool_]:
    """Deb's rule, elementwise."""
    new, old = violation <= FEASIBLE, old_violation <= FEASIBLE
    return np.where(new & old, cost < old_cost,
                    np.where(new | old, new, (violation < old_violation)
                             | ((violation == old_violation) & (cost < old_cost))))


def constriction() -> ParticleSwarm:
    """Constriction PSO (Clerc and Kennedy 2002): the package's default and its best preset."""
    return ParticleSwarm()


def thesis_first() -> ParticleSwarm:
    """Thesis 000, Table 5.2: c1 = c2 = 0.45, no inertia weight, particles may leave the space."""
    return ParticleSwarm(inertia=1.0, cognitive=0.45, social=0.45, boundary="none", start="grid")


def thesis_enhanced() -> ParticleSwarm:
    """Thesis 000, Table 5.8: c1 = c2 = 0.15, no inertia weight, particles that leave are reset."""
    return ParticleSwarm(inertia=1.0, cognitive=0.15, social=0.15, boundary="reset", start="grid")
