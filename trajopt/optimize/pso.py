"""Particle swarm optimisation, hand-written: the search (``ParticleSwarm``) over a swarm with ask
and tell.

The exact update of particle i in dimension j at iteration k, with r1, r2 uniform in [0, 1), drawn
anew for every particle, dimension and iteration (all of r1 first, then all of r2, particles in
rows):

    v_ij <- w_k v_ij + c1 r1 (p_ij - x_ij) + c2 r2 (l_ij - x_ij)
    v_ij <- clip(v_ij, -V_j, V_j)                                  where a velocity limit is set
    x_ij <- x_ij + v_ij,  then the boundary rule

p_i is the particle's best position, l_i its leader: the swarm's best ("gbest") or the best of its
neighbours on a ring, itself included ("ring"); ties go to the lower index. Both are taken after all
particles of the iteration were evaluated (synchronous update). "Best" is Deb's feasibility rule.
Velocities start at zero. w_k = w, or falls linearly from ``inertia`` to ``final_inertia`` over
``horizon`` iterations.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability
from trajopt.optimize.base import FEASIBLE, Status, checked_bounds, checked_x0
from trajopt.optimize.derivatives import onto_constraints
from trajopt.optimize.run import Run
from trajopt.optimize.swarm import Swarm, SwarmRules, warm
from trajopt.optimize.violations import Levels

Boundary = Literal["reset", "upper reset", "reflect", "mirror", "absorb", "invisible", "none"]
_LOST = 1_000  # iterations with all particles invisible after which a search ends, chosen
_REPAIRED = 10  # iterations between repairs of the best where there are equalities, chosen
_CLAN, _SPREAD = 3, 0.03  # particles of a clan, and their spread in widths; chosen
_MOST = 50  # particles in clans, chosen
_FEWEST = 13  # particles that a population by dimension has at least
_CHOICES = {
    "topology": ("gbest", "ring"),
    "boundary": ("reset", "upper reset", "reflect", "mirror", "absorb", "invisible", "none"),
    "start": ("uniform", "grid", "upper grid", "sobol"),
}


@dataclass(frozen=True)
class ParticleSwarm:
    """PSO. Defaults are the constriction PSO with a global best; the functions below are presets.

    ``boundary``: what happens to a particle that leaves the bounds. "reset" draws a new position
    inside 0.9 of the space and stops the particle, "upper reset" in the upper half of the first
    variable ([guzman2015], Table 5.4); "reflect" mirrors it
    back and reverses its velocity in that dimension; "mirror" mirrors it back alone (as pyswarms's
    "reflective"); "absorb" puts it on the border and stops it there; "invisible" lets it fly on
    without evaluating it [robinson2004]; "none" evaluates it outside, where it
    counts as infeasible. ``start``: "uniform" draws positions uniformly; "grid" lays the first two
    variables on a grid, "upper grid" in the upper half of the first (Table 5.4); "sobol" takes a Sobol sequence with a random shift.
    ``velocity_limit``: largest velocity as a share of the width of the bounds; None: unlimited.
    ``particles``: None for 12 + 2 sqrt(d), so many that a budget of some 1,000 d is best used.
    ``horizon``: iterations over which the inertia falls; None: over the budget, evaluations or
    seconds, whichever goes first.
    ``stagnation``: iterations without improvement after which the search ends; None: never.
    ``restart``: where the search would end by itself (stagnation, collapse, all particles lost), a
    new swarm starts instead, its first particle on the best candidate so far; then only the budget
    ends the search.
    """

    name: ClassVar[str] = "pso"
    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = True
    saves: ClassVar[bool] = True

    particles: int | None = 50  # [guzman2015], section 4.2.2
    inertia: float = 0.7298  # [clerc2002]: constriction factor for phi = 4.1
    cognitive: float = 1.49618  # 0.7298 * 2.05, the same source
    social: float = 1.49618
    topology: Literal["gbest", "ring"] = "gbest"
    neighbours: int = 1  # on each side of the ring; [bratton2007]
    boundary: Boundary = "reflect"  # chosen
    start: Literal["uniform", "grid", "upper grid", "sobol"] = "uniform"
    velocity_limit: float | None = (
        None  # the constriction factor makes one unnecessary, [clerc2002]
    )
    final_inertia: float | None = None
    horizon: int | None = None  # iterations
    stagnation: int | None = None
    restart: bool = False

    def __post_init__(self) -> None:
        if self.particles is not None and self.particles < 2:
            raise ArgumentError("particles", self.particles, "at least 2")
        for option, choices in _CHOICES.items():
            if getattr(self, option) not in choices:
                raise ArgumentError(option, getattr(self, option), "one of " + ", ".join(choices))
        if not 1 <= self.neighbours < (self.particles or _FEWEST):
            raise ArgumentError(
                "neighbours", self.neighbours, "a whole number from 1 to particles - 1"
            )
        if self.velocity_limit is not None and not self.velocity_limit > 0:
            raise ArgumentError(
                "velocity_limit", self.velocity_limit, "a share of the width > 0, or None"
            )
        if self.horizon is not None and self.horizon < 1:
            raise ArgumentError("horizon", self.horizon, "at least 1 iteration, or None")
        if self.stagnation is not None and self.stagnation < 1:
            raise ArgumentError("stagnation", self.stagnation, "at least 1 iteration, or None")

    def search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        """Search until the budget ends or, without ``restart``, the swarm stagnates or collapses to
        one point.

        ``x0`` (d,) becomes the first particle's position; the last of the others begin around the
        objective's own starts, where it has some.
        """
        warm()
        run.constructed()
        offered = getattr(run.objective, "starts", tuple) if "grid" not in self.start else tuple
        own: Array = np.asarray(offered())
        options = self
        if len(own) and self.particles is None:
            options = replace(self, particles=min(_MOST, max(_FEWEST, _CLAN * len(own))))
        swarm = options.swarm(run.bounds, rng, x0=x0)
        if len(own) and not run.resumes:
            _clans(own, run, swarm)
        ended = self._search(run, swarm)
        while self.restart:
            best = None if run.best_x is None else np.clip(run.best_x, *run.bounds.T)
            self._search(run, self.swarm(run.bounds, rng, x0=best))
        return ended

    def swarm(self, bounds: ArrayLike, rng: Generator, *, x0: ArrayLike | None = None) -> Swarm:
        """A swarm of one's own to drive: ``x = swarm.ask()``, evaluate, ``swarm.tell(cost,
        violation)``."""
        box = checked_bounds(bounds)
        # Chosen with the inertia of ``local_best``; benchmarks/peers/swarms.py tells what it is worth.
        particles = self.particles or int(12 + 2 * len(box) ** 0.5)
        return Swarm.begin(
            SwarmRules(
                particles,
                self.inertia,
                self.cognitive,
                self.social,
                self.topology,
                self.neighbours,
                self.boundary,
                self.start,
                self.velocity_limit,
                self.final_inertia,
                self.horizon,
            ),
            box,
            rng,
            checked_x0(x0, box),
        )

    def _search(self, run: Run, swarm: Swarm) -> tuple[Status, str]:
        resumed = run.keep(swarm)
        unseen = 0  # iterations in a row without a particle inside
        inside = self.boundary != "none"
        levels = Levels(run, swarm.level if resumed and swarm.level > FEASIBLE else 0.0)
        share = _share(run, swarm)
        while True:
            swarm.used = share()
            asked = swarm.ask()
            if self.boundary != "invisible":
                result = run.evaluate(asked, inside=inside)
                swarm.level = levels.at(result.violation)
                swarm.learn(result.cost, result.violation)
            elif len(asked):
                result, unseen = run.evaluate(asked), 0
                swarm.level = levels.at(result.violation)
                swarm.tell(result.cost, result.violation)
            else:
                swarm.tell(np.zeros(0))
                unseen += 1
                if unseen >= _LOST:
                    return (
                        Status.CONVERGED,
                        f"all particles stayed outside the bounds for {_LOST} iterations",
                    )
            run.nit += 1
            if levels.first and run.nit % _REPAIRED == 0:
                found = onto_constraints(run, swarm.best[0])
                swarm.offer(found, run.at(found))
            run.checkpoint()
            if swarm.collapsed:
                return Status.CONVERGED, "the swarm has collapsed to one point"
            if self.stagnation is not None and swarm.idle >= self.stagnation:
                return Status.CONVERGED, f"no improvement in {self.stagnation} iterations"


def _share(run: Run, swarm: Swarm) -> Callable[[], float]:
    """What tells the share of the budget that is used up: by iterations, not by what else counts as
    an evaluation, so that workers give the same bits. A saved search goes on as if all its budgets
    had been one."""
    if swarm.rules.final_inertia is None:
        return lambda: 0.0
    most, before = swarm.iteration + run.remaining() / len(swarm.x), swarm.seconds
    seconds = before + (run.budget.seconds or math.inf)

    def used() -> float:
        swarm.seconds = before + run.elapsed
        return min(1.0, max(swarm.iteration / most, swarm.seconds / seconds))

    return used


def _clans(own: Array, run: Run, swarm: Swarm) -> None:
    """Let the last particles begin around the best of an objective's ``own`` starts (n, d),
    neighbours around the same one."""
    found = run.evaluate(own)
    best = own[np.lexsort((found.cost, found.violation))[: len(swarm.x) // _CLAN]]
    clans = np.repeat(best, _CLAN, axis=0)
    clans += _SPREAD * run.width * swarm.rng.standard_normal(clans.shape)
    swarm.x[len(swarm.x) - len(clans) :] = np.clip(clans, *run.bounds.T)


def constriction() -> ParticleSwarm:
    """Constriction PSO with a global best [clerc2002]: the reference, quick to
    converge."""
    return ParticleSwarm()


def local_best() -> ParticleSwarm:
    """A small swarm on a ring whose inertia falls over the budget: the package's best preset.

    The ring is caught in fewer local minima than the global best, few particles make the most of a
    budget, and the falling inertia lets them range first and settle at its end
    (benchmarks/peers/swarms.py compares it with other packages' swarms).
    """
    return ParticleSwarm(topology="ring", particles=None, inertia=0.8, final_inertia=0.5)


def ring() -> ParticleSwarm:
    """Standard PSO of [bratton2007]: constriction, ring of two neighbours, invisible
    outside."""
    return ParticleSwarm(topology="ring", boundary="invisible")


def falling_inertia() -> ParticleSwarm:
    """[shi1998]: inertia from 0.9 to 0.4, c1 = c2 = 2, velocity clamped to the space's
    width."""
    return ParticleSwarm(
        inertia=0.9, final_inertia=0.4, cognitive=2.0, social=2.0, velocity_limit=1.0
    )


def thesis_first() -> ParticleSwarm:
    """[guzman2015], Table 5.2: c1 = c2 = 0.45, no inertia weight, particles may leave the space.

    Nothing damps this swarm (with w = 1 the variance of a particle's position grows without bound,
    whatever c1 and c2 are) and nothing brings it back: soon all particles are outside for good, and
    a larger budget changes nothing. ``dataclasses.replace(thesis_first(), stagnation=20,
    restart=True)`` uses one.
    """
    return ParticleSwarm(inertia=1.0, cognitive=0.45, social=0.45, boundary="none", start="grid")


def thesis_enhanced() -> ParticleSwarm:
    """[guzman2015], Table 5.8: c1 = c2 = 0.15, no inertia weight, particles that leave are reset.

    As undamped as the first one; the resets keep it inside, where it samples rather than converges.
    """
    return ParticleSwarm(
        inertia=1.0, cognitive=0.15, social=0.15, boundary="upper reset", start="upper grid"
    )
