"""What ``optimizer="auto"`` does: methods one after the other, by what the objective offers.

| objective | methods, with their share of the budget that is left |
|---|---|
| terminal, wheel angles affine | the lattice, which is exact; behind it the swarm |
| terminal, through actuators | lattice 0.2, Newton on the residuals 0.3, IPOPT 0.5, the swarm |
| with gradients | SLSQP from many starts 0.5, then as the next |
| with constraints | SLSQP by differences 0.3, the swarm |
| any other function | L-BFGS-B by differences 0.1, CMA-ES with restarts |

Each begins at the best so far. An exact solution of a terminal problem ends the search. Shares are
chosen so that the method that suits a problem best loses little of its budget to the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability, Objective
from trajopt.optimize.base import FEASIBLE, Status
from trajopt.optimize.cma_es import CmaEs
from trajopt.optimize.ipopt import Ipopt
from trajopt.optimize.lattice import Lattice
from trajopt.optimize.newton import Newton
from trajopt.optimize.pso import local_best
from trajopt.optimize.run import Run
from trajopt.optimize.scipy import ScipyLocal

Stages = list[tuple[Any, float]]  # methods, each with its share
_ALL = 1.0
_EXACT = ("lattice", "newton", "ipopt+newton")  # what they say is exact ends the search


@dataclass(frozen=True)
class Auto:
    """A portfolio (see above)."""

    name: ClassVar[str] = "auto"
    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = True
    saves: ClassVar[bool] = True  # its last method, which is where a saved search goes on

    def search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        """One method after the other, until one is exact or the budget ends."""
        methods = stages(run.objective)
        ended = Status.STALLED, "no method was left"
        for method, share in methods[-1:] if run.resumes else methods:
            run.taken.append(method.name)
            start = x0 if run.best_x is None else run.best_x.clip(*run.bounds.T)
            found = run.stage(partial(method.search, run, start, rng), share)
            ended = found or ended
            exact = found is not None and found[0] is Status.CONVERGED
            if exact and method.name in _EXACT and run.best_violation <= FEASIBLE:
                break
        return ended


def stages(objective: Objective) -> Stages:
    """The methods that suit an objective, each with its share of what is left of the budget."""
    offers = objective.provides
    if _has_lattice(objective):
        return _terminal(objective)
    last = local_best() if objective.constrained else CmaEs()
    smooth = Capability.GRADIENT in offers
    if objective.constrained:
        return [(ScipyLocal("SLSQP"), 0.5 if smooth else 0.3), (last, _ALL)]
    if smooth:
        return [(ScipyLocal("SLSQP"), 0.5), (last, _ALL)]
    return [(ScipyLocal("L-BFGS-B", starts=1), 0.1), (last, _ALL)]


def _has_lattice(objective: Objective) -> bool:
    try:
        return hasattr(objective, "affine_part") and bool(objective.affine_part())
    except ArgumentError:  # no wheel angle counts
        return False


def _terminal(objective: Objective) -> Stages:
    behind: Stages = [(local_best(), _ALL)]
    if Capability.AFFINE in objective.provides:
        return [(Lattice(), _ALL), *(behind if objective.constrained else ())]
    symbolic = Capability.SYMBOLIC in objective.provides
    lattice: Stages = [(Lattice(), 0.2 if symbolic else _ALL)]
    if not symbolic:  # durations: the exact solutions are compared, the swarm is for where none is
        return lattice + behind
    program = [(Ipopt(polish=True, starts=8), 0.5)]
    if getattr(objective, "impossible", str)():
        return program + behind
    return [*lattice, (Newton(), 0.3), *program, *behind]
