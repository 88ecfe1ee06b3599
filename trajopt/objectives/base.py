"""What an objective is: a map from decision variables to a cost and a violation, kept apart."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from typing import Any, Protocol, runtime_checkable

from trajopt.arrays import Array, IndexArray


class Capability(Enum):
    """What an objective can offer beyond single evaluations, and what an optimizer may need."""

    BATCH = auto()  # many candidates at once
    GRADIENT = auto()  # first derivatives of the cost
    RESIDUALS = auto()  # a vector that is zero at an exact solution
    SYMBOLIC = auto()  # the same formulas on symbolic arrays (CasADi)
    AFFINE = auto()  # critical residuals affine in the decision variables, modulo a period
    JACOBIAN = auto()  # first derivatives of the constraints


@dataclass(frozen=True)
class Evaluation:
    """Costs and constraint violations (>= 0, 0 where feasible) of n candidates, each (n,).

    An objective that hands over its constraints one by one also gives their values ``constraints``
    (n, m) and between what they are kept, ``limits`` (2, m): equalities where both are equal, inf
    where there is none. The violation is then computed from them, whatever it says here.
    """

    cost: Array
    violation: Array
    constraints: Array | None = None
    limits: Array | None = None


@dataclass(frozen=True)
class SymbolicProblem:
    """min cost subject to lower <= constraints <= upper, as symbolic expressions (None: no
    constraints)."""

    cost: Any
    constraints: Any
    lower: Array
    upper: Array


@runtime_checkable
class Objective(Protocol):
    """A function to minimise. ``dimension`` is the number of decision variables d.

    ``constrained`` says whether violations can be other than zero.
    """

    @property
    def dimension(self) -> int: ...

    @property
    def provides(self) -> frozenset[Capability]: ...

    @property
    def constrained(self) -> bool: ...

    def evaluate(self, candidates: Array) -> Evaluation:
        """Cost and violation of candidates (n, d) on the grid that searches use."""
        ...

    def score(self, candidate: Array) -> Evaluation:
        """Cost and violation of one candidate (d,), recomputed more finely than any search sees
        it."""
        ...


class SymbolicObjective(Objective, Protocol):
    """An objective with the capability SYMBOLIC."""

    def symbolic(self, z: Any, parameters: Any) -> SymbolicProblem:
        """The problem on symbols: z (d + slacks, 1), parameters (p, 1)."""
        ...

    def parameters_at(self, start: Array) -> Array:
        """(p,): parameters (whole turns, say) that fit a starting point (d,)."""
        ...

    def slacks_at(self, start: Array) -> Array:
        """(slacks,): slack values that fit a starting point (d,)."""
        ...


class ResidualObjective(Objective, Protocol):
    """An objective with the capability RESIDUALS: gains . |residuals| is its cost."""

    def residuals(self, z: Any, turns: Any, *, exact: bool = False) -> list[Any]: ...

    def residual_gains(self) -> Array: ...

    def nearest_turns(self, candidates: Array) -> Array: ...

    def coarse(self) -> ResidualObjective: ...


class LatticeObjective(ResidualObjective, Protocol):
    """An objective whose critical residuals are affine modulo a period once actuators are ideal."""

    def affine_part(self) -> AffinePart: ...

    def effort(self, candidates: Array) -> Array: ...


@dataclass(frozen=True)
class AffinePart:
    """Critical residuals = matrix @ z[variables] + offset - period * turns, actuators ideal, the
    rest at rest.

    ``base`` (d,) holds the values of the variables that are not in ``variables``.
    """

    matrix: Array  # (c, k)
    offset: Array  # (c,)
    period: float
    variables: IndexArray  # (k,) positions in the decision vector
    base: Array  # (d,)
