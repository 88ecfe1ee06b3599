"""A population search first, a gradient search from where it ended: half of the budget each."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from trajopt.objectives.base import Capability, Objective
from trajopt.optimize.base import Budget, OptimizeResult, Progress, Status, better, checked_bounds
from trajopt.optimize.pso import ParticleSwarm
from trajopt.optimize.scipy import ScipyLocal


@dataclass(frozen=True)
class Hybrid:
    """PSO, then SLSQP from its best candidate. ``share``: part of the budget that the swarm may
    use."""

    name: ClassVar[str] = "hybrid"
    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = True

    share: float = 0.5  # chosen
    swarm: ParticleSwarm = field(
        default_factory=lambda: ParticleSwarm(stagnation=30)
    )  # iterations, chosen
    polish: ScipyLocal = field(default_factory=lambda: ScipyLocal("SLSQP", starts=3))

    def minimize(
        self,
        objective: Objective,
        bounds: ArrayLike,
        *,
        x0: ArrayLike | None = None,
        rng: Generator,
        budget: Budget,
        progress: Progress | None = None,
    ) -> OptimizeResult:
        """Search. The result is the better one of both, its history the two joined."""
        box = checked_bounds(bounds, objective.dimension)
        first = self.swarm.minimize(
            objective, box, x0=x0, rng=rng, budget=_part(budget, self.share), progress=progress
        )
        left = _left(budget, first)
        if first.status in (Status.TARGET, Status.FAILED) or left is None:
            return replace(first, optimizer=self.name)
        start = np.clip(first.x, box[:, 0], box[:, 1])
        second = self.polish.minimize(
            objective, box, x0=start, rng=rng, budget=left, progress=progress
        )
        return _joined(self.name, first, second)


def _part(budget: Budget, share: float) -> Budget:
    evaluations = None if budget.evaluations is None else max(1, int(budget.evaluations * share))
    return replace(
        budget,
        evaluations=evaluations,
        seconds=None if budget.seconds is None else budget.seconds * share,
    )


def _left(budget: Budget, used: OptimizeResult) -> Budget | None:
    """What the first search left, or None where nothing is."""
    evaluations = None if budget.evaluations is None else budget.evaluations - used.nfev
    seconds = None if budget.seconds is None else budget.seconds - used.seconds
    if (evaluations is not None and evaluations < 1) or (seconds is not None and seconds <= 0):
        return None
    return replace(budget, evaluations=evaluations, seconds=seconds)


def _joined(name: str, first: OptimizeResult, second: OptimizeResult) -> OptimizeResult:
    best = second if better(second.fun, second.violation, first.fun, first.violation) else first
    seen = second if _found_better(second, first) else first  # what the searches themselves saw
    a, b = first.history, second.history
    later = np.zeros(
        len(b.cost), dtype=bool
    )  # improvements of the second search that are ones of both
    if len(a.cost):
        later[:] = [
            better(c, v, a.cost[-1], a.violation[-1])
            for c, v in zip(b.cost, b.violation, strict=True)
        ]
    else:
        later[:] = True
    history = replace(
        a,
        evaluations=np.concatenate([a.evaluations, b.evaluations[later] + first.nfev]),
        seconds=np.concatenate([a.seconds, b.seconds[later] + first.seconds]),
        cost=np.concatenate([a.cost, b.cost[later]]),
        violation=np.concatenate([a.violation, b.violation[later]]),
        samples=np.concatenate([a.samples, b.samples])[:50_000],
    )
    return replace(
        best,
        optimizer=name,
        nfev=first.nfev + second.nfev,
        nit=first.nit + second.nit,
        ngev=first.ngev + second.ngev,
        nhev=first.nhev + second.nhev,
        seconds=first.seconds + second.seconds,
        history=history,
        status=second.status,
        success=second.success,
        search_fun=seen.search_fun,
        failures=first.failures + second.failures,
        message=f"swarm, then slsqp: {second.message}",
        first_failure=first.first_failure or second.first_failure,
    )


def _found_better(one: OptimizeResult, other: OptimizeResult) -> bool:
    """Whether the best that ``one`` saw beats what ``other`` saw, by Deb's rule."""
    if not len(one.history.cost) or not len(other.history.cost):
        return len(one.history.cost) > 0
    return better(
        one.history.cost[-1],
        one.history.violation[-1],
        other.history.cost[-1],
        other.history.violation[-1],
    )


def hybrid() -> Hybrid:
    """PSO, then SLSQP."""
    return Hybrid()
