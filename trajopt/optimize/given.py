"""No search at all: judge the given candidate, so that a plan from elsewhere becomes a solution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability
from trajopt.optimize.base import (
    Run,
    Status,
)
from trajopt.optimize.method import Method


@dataclass(frozen=True)
class Given(Method):
    """Evaluates ``x0`` and returns it."""

    name: ClassVar[str] = "given"
    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = False

    def _search(
        self,
        run: Run,
        x0: Array | None,
        rng: Generator,  # noqa: ARG002 - the contract has it
    ) -> tuple[Status, str]:
        if x0 is None:
            count = run.objective.dimension
            raise ArgumentError("x0", None, f"the candidate to judge, {count} numbers")
        run.evaluate(x0[None])
        return Status.CONVERGED, "given, not searched"
