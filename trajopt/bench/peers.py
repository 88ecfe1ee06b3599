"""PSO of other packages behind the package's contract, for the benchmark only: pyswarms and pymoo.

Their random numbers: pyswarms draws from NumPy's global state, which is set from the generator
given and put back afterwards; pymoo takes a seed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.errors import MissingDependencyError
from trajopt.objectives.base import Capability
from trajopt.optimize.base import Status
from trajopt.optimize.run import Run

_LARGE = 1e100  # stands for an infeasible evaluation
EXAMPLE = {"c1": 0.5, "c2": 0.3, "w": 0.9}  # pyswarms 1.3 documentation, "Basic Optimization"
CONSTRICTION = {"c1": 1.49618, "c2": 1.49618, "w": 0.7298}  # Clerc and Kennedy 2002, as our default
_FOREVER = 1_000_000  # iterations; the run's budget ends searches before


@dataclass(frozen=True)
class PySwarms:
    """pyswarms's GlobalBestPSO with its documentation's options.

    ``constriction``: the coefficients of our gbest PSO instead. ``equal``: also a start at rest and
    positions mirrored at the bounds; ``ParticleSwarm(boundary="mirror")`` is its equal.
    """

    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = True
    only_bounds: ClassVar[bool] = True

    constriction: bool = False
    equal: bool = False
    particles: int = 50

    @property
    def name(self) -> str:
        return "pyswarms"

    def search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:  # noqa: ARG002
        """Search; the package knows no start and no constraints."""
        try:
            from pyswarms.single.global_best import GlobalBestPSO
        except ImportError:
            raise MissingDependencyError("pyswarms", "dev", "the optimizer pyswarms") from None
        run.constructed()
        options = CONSTRICTION if self.constriction or self.equal else EXAMPLE
        before = np.random.get_state()  # noqa: NPY002 - the only generator pyswarms knows
        np.random.seed(int(rng.integers(2**31)))  # noqa: NPY002
        try:
            swarm = GlobalBestPSO(
                self.particles,
                len(run.bounds),
                options,
                bounds=tuple(run.bounds.T),
                bh_strategy="reflective" if self.equal else "periodic",
            )  # periodic is its default
            if self.equal:
                swarm.swarm.velocity = np.zeros_like(swarm.swarm.velocity)
            swarm.optimize(
                lambda x: np.minimum(run.evaluate(x).cost, _LARGE), _FOREVER, verbose=False
            )
        finally:
            np.random.set_state(before)  # noqa: NPY002
        return Status.CONVERGED, "all iterations done"


@dataclass(frozen=True)
class Pymoo:
    """pymoo's PSO with its defaults (25 particles, adaptive coefficients, random restarts off)."""

    name: ClassVar[str] = "pymoo-pso"
    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = True
    only_bounds: ClassVar[bool] = True

    particles: int = 25

    def search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:  # noqa: ARG002
        """Search; the package knows no start and no constraints."""
        try:
            from pymoo.algorithms.soo.nonconvex.pso import PSO
            from pymoo.core.problem import Problem
            from pymoo.optimize import minimize
        except ImportError:
            raise MissingDependencyError("pymoo", "optimizers", "the optimizer pymoo-pso") from None
        run.constructed()

        class Asked(Problem):  # type: ignore[misc]  # pymoo's interface is a base class
            def _evaluate(self, x: Array, out: dict[str, Any], *_: Any, **__: Any) -> None:
                out["F"] = np.minimum(run.evaluate(x).cost, _LARGE)[:, None]

        problem = Asked(n_var=len(run.bounds), n_obj=1, xl=run.bounds[:, 0], xu=run.bounds[:, 1])
        minimize(
            problem,
            PSO(pop_size=self.particles),
            ("n_gen", _FOREVER),
            seed=int(rng.integers(2**31)),
        )
        return Status.CONVERGED, "pymoo's stopping rule is met"


def constriction_pyswarms() -> PySwarms:
    """pyswarms with the coefficients of our gbest PSO."""
    return PySwarms(constriction=True)


def equal_pyswarms() -> PySwarms:
    """pyswarms with everything equal to ``ParticleSwarm(boundary="mirror")``."""
    return PySwarms(equal=True)


PEERS: dict[str, Callable[[], Any]] = {
    "pyswarms": PySwarms,
    "pyswarms-constriction": constriction_pyswarms,
    "pyswarms-equal": equal_pyswarms,
    "pymoo-pso": Pymoo,
}
