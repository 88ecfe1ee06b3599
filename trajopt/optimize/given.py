"""No search at all: judge the given candidate, so that a plan from elsewhere becomes a solution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability
from trajopt.optimize.base import Status
from trajopt.optimize.run import Run


@dataclass(frozen=True)
class Given:
    """Evaluates ``x0`` and returns it."""

    name: ClassVar[str] = "given"
    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = False

    def search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:  # noqa: ARG002
        """The result at ``x0``. Raises ArgumentError without one."""
        if x0 is None:
            raise ArgumentError("x0", None, f"the candidate to judge, {len(run.bounds)} numbers")
        run.evaluate(x0[None])
        return Status.CONVERGED, "given, not searched"
