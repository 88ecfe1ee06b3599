"""What an objective is: a map from decision variables to a cost and a violation, kept apart."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Capability(Enum):
    """What an objective can offer beyond single evaluations, and what an optimizer may need."""

    BATCH = auto()  # many candidates at once
    GRADIENT = auto()  # first derivatives of the cost
    RESIDUALS = auto()  # a vector that is zero at an exact solution
    SYMBOLIC = auto()  # the same formulas on symbolic arrays (CasADi)
    AFFINE = auto()  # critical residuals affine in the decision variables, modulo a period


@dataclass(frozen=True)
class Evaluation:
    """Costs and constraint violations (>= 0, 0 where feasible) of n candidates, each (n,)."""

    cost: Array
    violation: Array


@dataclass(frozen=True)
class SymbolicProblem:
    """min cost(z) subject to lower <= constraints(z) <= upper, as symbolic expressions.

    ``slacks`` extra variables follow the decision variables in ``z``; ``start`` (slacks,) are their values
    at the starting point.
    """

    cost: Any
    constraints: Any
    lower: Array
    upper: Array


@runtime_checkable
class Objective(Protocol):
    """A function to minimise. ``dimension`` is the number of decision variables d."""

    @property
    def dimension(self) -> int: ...

    @property
    def provides(self) -> frozenset[Capability]: ...

    def evaluate(self, candidates: Array) -> Evaluation:
        """Cost and violation of candidates (n, d) on the grid that searches use."""
        ...

    def score(self, candidate: Array) -> Evaluation:
        """Cost and violation of one candidate (d,), recomputed more finely than any search sees it."""
        ...
