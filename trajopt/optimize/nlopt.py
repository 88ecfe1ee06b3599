"""DIRECT and BOBYQA of the package NLopt, behind the package's contract."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.errors import MissingDependencyError
from trajopt.objectives.base import Capability, Objective
from trajopt.optimize.base import (
    Run,
    Starts,
    Status,
)
from trajopt.optimize.method import Method, require_unconstrained

_ALGORITHMS = {"direct": "GN_ORIG_DIRECT_L", "bobyqa": "LN_BOBYQA"}
_LARGE = 1e100  # stands for an infeasible evaluation
_STEP = 0.1  # of the width: BOBYQA's first step, chosen


@dataclass(frozen=True)
class NLopt(Method):
    """One of NLopt's derivative-free methods, on variables scaled to [0, 1].

    "direct" divides the bounds into ever smaller rectangles (locally biased form [gablonsky2001])
    and needs no start (x0 is only evaluated first); "bobyqa" fits quadratic models [powell2009]
    from ``starts`` points: x0 or the middle, then random.
    """

    needs: ClassVar[frozenset[Capability]] = frozenset()

    method: Literal["direct", "bobyqa"]
    starts: int = 10  # chosen
    tolerance: float = (
        1e-12  # bobyqa's relative tolerance on the variables; tight, because budgets end searches
    )

    @property
    def name(self) -> str:
        return self.method

    @property
    def stochastic(self) -> bool:
        return self.method == "bobyqa"

    def _require(self, objective: Objective) -> None:
        require_unconstrained(self.name, objective)
        _package()

    def _search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        package = _package()
        low, width = run.bounds[:, 0], run.bounds[:, 1] - run.bounds[:, 0]
        d = len(low)
        ended: list[Exception] = []

        def cost_of(search: Any) -> Callable[[Array, Array], float]:
            def cost(unit: Array, _: Array) -> float:
                if ended:  # NLopt may ask a few times more before it stops
                    return _LARGE
                try:
                    return min(run.cost(np.clip(low + width * unit, low, low + width)), _LARGE)
                except (
                    Exception
                ) as stop:  # the run's end; exceptions do not pass NLopt reliably, so remember it
                    ended.append(stop)
                    search.force_stop()
                    return _LARGE

            return cost

        if (
            x0 is not None and self.method == "direct"
        ):  # which starts in the middle, whatever it is given
            run.evaluate(x0[None])
        starts = Starts(run)
        rounds = 1 if self.method == "direct" else self.starts
        for index in range(rounds):
            search = package.opt(getattr(package, _ALGORITHMS[self.method]), d)
            search.set_lower_bounds(np.zeros(d))
            search.set_upper_bounds(np.ones(d))
            search.set_min_objective(cost_of(search))
            if self.method == "bobyqa":  # DIRECT would stop at its first small rectangle
                search.set_xtol_rel(self.tolerance)
            search.set_maxeval(min(run.remaining() + 1, 10_000_000))
            search.set_initial_step(_STEP)
            first = np.full(d, 0.5) if x0 is None else (x0 - low) / width
            # Why a search was stopped is in ``ended``.
            said = ""
            try:
                search.optimize(first if index == 0 else rng.random(d))
            except (package.ForcedStop, package.RoundoffLimited, RuntimeError) as error:
                said = f"{type(error).__name__}: {error}"
            if ended:
                raise ended[0]
            run.nit += 1
            starts.ended(not said, said or f"NLopt's result {search.last_optimize_result()}")
        return (
            starts.verdict()
            if self.method == "bobyqa"
            else (starts.verdict()[0], "no rectangle is left to divide")
        )


def _package() -> Any:
    try:
        import nlopt
    except ImportError:
        raise MissingDependencyError(
            "nlopt", "optimizers", "the optimizers direct and bobyqa"
        ) from None
    return nlopt


def direct() -> NLopt:
    """DIRECT-L: division of rectangles."""
    return NLopt("direct")


def bobyqa() -> NLopt:
    """BOBYQA: quadratic models within bounds."""
    return NLopt("bobyqa")
