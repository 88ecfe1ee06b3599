"""The contract every optimizer fulfils: budget, result, statuses, and Deb's feasibility rule.

An optimizer is a frozen dataclass of options with one method, ``search``. It touches its objective
only through a ``Run`` (``optimize.run``), which keeps every optimizer to the same bounds, budget
and bookkeeping.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, ClassVar, Literal, Protocol

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from trajopt.arrays import Array, IntArray, as_numbers, require_positive, require_whole
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Capability
from trajopt.shown import Shown

if TYPE_CHECKING:
    from trajopt.optimize.run import Run

FEASIBLE = 1e-8  # violation up to which a candidate counts as feasible (rounding), chosen
_LEAST_WIDTH = 1e-290  # of bounds: steps of differences are a part of it, chosen
DEFAULT_EVALUATIONS = 25_000  # 50 particles x 500 iterations, [guzman2015] Table 5.8


class Status(Enum):
    """Why a search ended, and what to do about it."""

    TARGET = "the target was reached"
    CONVERGED = "the method's own stopping rule was met"
    STALLED = "the method gave up before its own stopping rule was met; start it elsewhere, or loosen its tolerance"
    EVALUATIONS = "the budget of evaluations is used up; raise Budget.evaluations to search longer"
    SECONDS = "the budget of seconds is used up; raise Budget.seconds to search longer"
    INFEASIBLE = "no feasible candidate was found; widen the bounds or free more variables"
    FAILED = "the objective gave no finite cost anywhere it was asked; check the objective at x0"
    INTERRUPTED = "interrupted; the best so far is returned: start from its x, or from a saved state, to go on"
    CALLBACK = "ended by the callback; the best so far is returned"
    NO_EXACT = "no exact solution was found inside the bounds; the best feasible one is returned; free more variables"


@dataclass(frozen=True)
class Budget:
    """What a search may use: objective ``evaluations``, ``seconds``, and a cost ``target`` that
    ends it.

    ``clock`` says which seconds, also in histories and results: "wall", or "cpu" for processor time
    of this process, which other load on the machine does not change.
    """

    evaluations: int | None = DEFAULT_EVALUATIONS
    seconds: float | None = None
    target: float | None = None
    clock: Literal["wall", "cpu"] = "wall"

    def __post_init__(self) -> None:
        if self.evaluations is not None:
            expected = "a whole number >= 1, or None"
            require_whole("budget.evaluations", self.evaluations, 1, expected)
        if self.seconds is not None:
            require_positive("budget.seconds", self.seconds, "s, or None")
        if self.target is not None and np.isnan(
            as_numbers("budget.target", self.target, "a cost, or None", ())
        ):
            raise ArgumentError("budget.target", self.target, "a cost, or None")
        if self.clock not in ("wall", "cpu"):
            raise ArgumentError("budget.clock", self.clock, "wall or cpu")
        if self.evaluations is None and self.seconds is None:
            raise ArgumentError("budget", "unlimited", "a limit on evaluations or on seconds")


@dataclass(frozen=True)
class History:
    """Best so far each time it improved: evaluations used, seconds, cost, violation, each (h,).

    ``samples`` (m, d) are explored candidates in the order of evaluation (the first 50,000).
    """

    evaluations: IntArray
    seconds: Array
    cost: Array
    violation: Array
    samples: Array


@dataclass(frozen=True, repr=False)
class OptimizeResult(Shown):
    """Outcome of a search, in SciPy's names.

    ``fun`` and ``violation`` are recomputed by the objective at ``x`` after the search, more finely
    than the search saw it where the objective can (``search_fun`` is what the search saw).
    ``failures`` counts evaluations that raised or were not finite; ``first_failure`` says what the
    first one was. ``ngev`` counts exact gradients and ``nhev`` exact Hessians, which are not among
    ``nfev`` (finite differences are). ``seconds`` are those of the budget's clock, without
    ``construct_seconds``: what it took before to write a program in symbols, say.
    """

    x: Array
    fun: float
    violation: float
    search_fun: float
    nfev: int
    nit: int
    success: bool
    status: Status
    message: str
    optimizer: str
    history: History = field(repr=False)
    seconds: float
    failures: int = 0
    first_failure: str = ""
    ngev: int = 0
    nhev: int = 0
    construct_seconds: float = 0.0

    def __repr__(self) -> str:
        return (
            f"OptimizeResult({self.optimizer}, fun={self.fun:.6g}, success={self.success}, "
            f"{self.nfev} evaluations)"
        )


class Optimizer(Protocol):
    """A search method. ``needs`` lists what it asks of an objective; ``stochastic`` whether seeds
    matter.

    ``only_bounds`` (False where absent) says that it cannot handle constraints; ``saves`` (False
    where absent) that ``state=`` can save and resume it.
    """

    name: ClassVar[str]
    needs: ClassVar[frozenset[Capability]]
    stochastic: ClassVar[bool]

    def search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        """Search from ``x0`` (d,) or from a start of its own until done, by ``run.evaluate`` alone;
        the status and what to say of it. The run ends the search where the budget ends."""
        ...


class Stop(Exception):
    """Ends the search: raised inside the run, and caught by it."""

    def __init__(self, status: Status, said: str = "") -> None:
        super().__init__(said or status.value)
        self.status, self.said = status, said


class StageOver(Stop):
    """Ends one stage of a search, whose share of the budget is used up."""


def better(
    cost: float,
    violation: float,
    than_cost: float,
    than_violation: float,
    level: float = FEASIBLE,
) -> bool:
    """Deb's feasibility rule [deb2000]: feasible before infeasible, then the cost, or else the
    violation, decides. Violations up to ``level`` count as none (epsilon levels [takahama2006])."""
    feasible, than_feasible = violation <= level, than_violation <= level
    if feasible and than_feasible:
        return bool(cost < than_cost)
    if feasible or than_feasible:
        return bool(feasible)
    return bool(violation < than_violation or (violation == than_violation and cost < than_cost))


def best_index(cost: Array, violation: Array, level: float = FEASIBLE) -> int:
    """Index of the best candidate as ``better`` sees it."""
    if not np.count_nonzero(violation):  # the usual case, and quick
        return int(cost.argmin())
    feasible = violation <= level
    if feasible.any():
        return int(np.argmin(np.where(feasible, cost, np.inf)))
    return int(np.lexsort((cost, violation))[0])


def checked_bounds(bounds: ArrayLike, dimension: int | None = None) -> Array:
    """(d, 2) array of finite bounds, lower < upper. Raises ArgumentError otherwise."""
    array = as_numbers(
        "bounds", bounds, "a lower and an upper bound a variable: numbers of shape (d, 2)"
    )
    if array.ndim != 2 or array.shape[1] != 2 or array.shape[0] < 1:
        raise ArgumentError(
            "bounds", array.shape, "shape (d, 2): a lower and an upper bound a variable"
        )
    if not np.all(np.isfinite(array)) or np.any(array[:, 0] >= array[:, 1]):
        raise ArgumentError("bounds", array.tolist(), "finite bounds, each lower < upper")
    with np.errstate(over="ignore"):
        width = array[:, 1] - array[:, 0]
    if np.any(width < _LEAST_WIDTH + 1e-12 * np.abs(array).max(axis=1)) or np.isinf(width).any():
        expected = "bounds whose widths are finite and more than rounding"
        raise ArgumentError("bounds", array.tolist(), expected)
    if dimension is not None and len(array) != dimension:
        raise ArgumentError("bounds", array.shape, f"{dimension} rows, one a decision variable")
    return array


def checked_x0(x0: ArrayLike | None, bounds: Array) -> Array | None:
    """Starting point (d,) inside the bounds, or None. Raises ArgumentError for anything else."""
    if x0 is None:
        return None
    point = as_numbers("x0", x0, f"{len(bounds)} finite numbers")
    if point.shape != (len(bounds),) or not np.all(np.isfinite(point)):
        raise ArgumentError("x0", point.tolist(), f"{len(bounds)} finite numbers")
    # A start is on a bound if it is but for rounding: 0.1 + 0.2 at a bound of 0.3.
    rounding = 1e-12 * (np.abs(bounds).max(axis=1) + bounds[:, 1] - bounds[:, 0])
    if np.any(point < bounds[:, 0] - rounding) or np.any(point > bounds[:, 1] + rounding):
        raise ArgumentError("x0", point.tolist(), f"a point inside the bounds {bounds.tolist()}")
    return np.clip(point, bounds[:, 0], bounds[:, 1])
