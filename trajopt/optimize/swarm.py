"""The swarm itself, with ask and tell: the state of a particle swarm that can be saved and resumed
bit by bit.

``trajopt.optimize.pso`` documents the update rule and the options.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray, IndexArray
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Evaluation
from trajopt.optimize.base import FEASIBLE, best_index, better
from trajopt.optimize.state import read_state, write_state

_COLLAPSED = 1e-15  # of the width: spread and velocity at which a swarm has come to rest
_ARRAYS = ("bounds", "x", "v", "own", "own_cost", "own_violation")


@dataclass(frozen=True)
class SwarmRules:
    """The options of ``ParticleSwarm`` that act in each iteration; see there."""

    particles: int
    inertia: float
    cognitive: float
    social: float
    topology: str
    neighbours: int
    boundary: str
    start: str
    velocity_limit: float | None
    final_inertia: float | None
    horizon: int | None


@dataclass(eq=False)
class Swarm:
    """Positions ``x``, velocities ``v``, own bests; mutable by nature. ``idle``: iterations since
    it improved; ``used``: share of the budget that is used up, by which the inertia falls where the
    rules have no horizon; ``seconds``: how long it has searched."""

    rules: SwarmRules
    bounds: Array
    rng: Generator
    x: Array  # (n, d): what ``ask`` hands out next
    v: Array
    own: Array
    own_cost: Array
    own_violation: Array
    iteration: int = 0
    idle: int = 0
    level: float = FEASIBLE  # violation up to which candidates count as feasible
    used: float = 0.0
    seconds: float = 0.0
    _reached: tuple[float, float] = (np.inf, np.inf)

    def __post_init__(self) -> None:
        i = best_index(self.own_cost, self.own_violation)
        self._reached = float(self.own_cost[i]), float(self.own_violation[i])
        # One row a particle: loops over whole arrays are quicker than over rows of each.
        self._low, self._high = np.repeat(self.bounds.T[:, None], len(self.x), axis=1)
        width = self.bounds[:, 1] - self.bounds[:, 0]
        self._rest = _COLLAPSED * width
        self._limit = width * (
            np.inf if self.rules.velocity_limit is None else self.rules.velocity_limit
        )
        self._kernel = _kernel()
        self._pull, self._drawn = np.empty(self.x.shape), np.empty((2, *self.x.shape))
        self._leaders = np.zeros(len(self.x), dtype=np.intp)
        self._places, reach = np.arange(len(self.x)), self.rules.neighbours
        around = self._places[:, None] + np.arange(-reach, reach + 1)
        self._ring = np.sort(around % len(self.x), axis=1)  # ties go to the lower index

    @classmethod
    def begin(
        cls, rules: SwarmRules, bounds: Array, rng: Generator, x0: Array | None = None
    ) -> Swarm:
        """A new swarm; ``x0`` (d,) becomes the first particle's position."""
        x = _positions(rules, bounds, rng)
        if x0 is not None:
            x[0] = x0
        n = len(x)
        return cls(
            rules,
            bounds,
            rng,
            x,
            np.zeros_like(x),
            x.copy(),
            np.full(n, np.inf),
            np.full(n, np.inf),
        )

    def ask(self) -> Array:
        """(m, d): the candidates to evaluate; fewer than particles only where some are
        invisible."""
        return self.x[self._seen()] if self.rules.boundary == "invisible" else self.x.copy()

    def tell(self, cost: ArrayLike, violation: ArrayLike | None = None) -> None:
        """Costs (m,) and violations (m,) of what ``ask`` gave; then all particles move.

        Raises ArgumentError for other lengths. NaN counts as infeasible.
        """
        self.learn(*self._told(cost, violation))

    def learn(self, cost: Array, violation: Array) -> None:
        """``tell`` without its checks: costs and violations (n,) of all particles, none NaN."""
        if self._kernel is None:
            self._remember(cost, violation)
            leader = best_index(self.own_cost, self.own_violation, self.level)
        else:
            leader = self._kernel.remember(
                self.x, self.own, self.own_cost, self.own_violation, cost, violation, self.level
            )
        reached = self.own_cost[leader], self.own_violation[leader]
        self.idle = 0 if better(*reached, *self._reached, self.level) else self.idle + 1
        self._reached = float(reached[0]), float(reached[1])
        if self.rules.topology == "gbest":
            self._leaders.fill(leader)
        elif self._kernel is None:
            self._leaders[:] = self._ring_leaders()
        else:
            self._kernel.ring_leaders(
                self.own_cost,
                self.own_violation,
                self.level,
                self.rules.neighbours,
                self._leaders,
            )
        self._move()
        self.iteration += 1

    def offer(self, x: Array, found: Evaluation) -> None:
        """A candidate (d,) found outside the swarm takes the place of the best, where it is
        better."""
        i = best_index(self.own_cost, self.own_violation, self.level)
        cost, violation = float(found.cost[0]), float(found.violation[0])
        if better(cost, violation, self.own_cost[i], self.own_violation[i], self.level):
            self.own[i], self.own_cost[i], self.own_violation[i] = x, cost, violation

    @property
    def best(self) -> tuple[Array, float, float]:
        """Best candidate (d,) told so far, its cost and violation (both inf before the first
        ``tell``)."""
        i = best_index(self.own_cost, self.own_violation, self.level)
        return self.own[i].copy(), float(self.own_cost[i]), float(self.own_violation[i])

    @property
    def collapsed(self) -> bool:
        """Whether all particles rest at one point, so that nothing can change any more."""
        if abs(float(self.v[0, 0])) > self._rest[0]:  # the usual case, and quick
            return False
        return bool(
            np.all(np.abs(self.v) <= self._rest)
            and np.all(np.abs(self.x - self.x[0]) <= self._rest)
        )

    # -- saving
    # ---------------------------------------------------------------------------------------

    def pack(self) -> dict[str, Any]:
        """The whole state: arrays and plain values."""
        return {
            "rules": asdict(self.rules),
            "iteration": self.iteration,
            "idle": self.idle,
            "level": self.level,
            "seconds": self.seconds,
            "rng": self.rng.bit_generator.state,
            **{name: getattr(self, name) for name in _ARRAYS},
        }

    def unpack(self, kept: Mapping[str, Any]) -> None:
        """Go on from what ``pack`` gave."""
        if kept["rules"] != asdict(self.rules) or kept["x"].shape != self.x.shape:
            raise ValueError(f"a swarm with the rules {kept['rules']}")
        for name in _ARRAYS:
            getattr(self, name)[:] = kept[name]
        self.rng.bit_generator.state = kept["rng"]
        self.iteration, self.idle = kept["iteration"], kept["idle"]
        self.level, self.seconds = kept["level"], kept["seconds"]
        self.__post_init__()

    def save(self, path: str | Path) -> None:
        """Write the whole state to ``path`` (*.npz), under a temporary name first; ``load`` goes on
        from it."""
        write_state(path, self.pack())

    @classmethod
    def load(cls, path: str | Path) -> Swarm:
        """The swarm that ``save`` wrote, with the same random numbers to come.

        Raises ArgumentError for a file that is missing or no saved swarm.
        """
        kept = read_state(path, "Swarm.save")
        try:
            rng = Generator(getattr(np.random, kept["rng"]["bit_generator"])())
            arrays = [kept[name] for name in _ARRAYS]
            found = cls(SwarmRules(**kept["rules"]), arrays[0], rng, *arrays[1:])
            found.unpack(kept)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ArgumentError(
                "path", str(path), f"a file written by Swarm.save ({error})"
            ) from None
        return found

    # -- one iteration
    # --------------------------------------------------------------------------------

    def _seen(self) -> BoolArray:
        low, high = self.bounds.T
        return np.asarray(((self.x >= low) & (self.x <= high)).all(axis=1))

    def _told(self, cost: ArrayLike, violation: ArrayLike | None) -> tuple[Array, Array]:
        """Costs and violations (n,) of all particles; infinite for NaN and for invisible ones."""
        cost = np.asarray(cost, dtype=np.float64)
        violation = (
            np.zeros(cost.shape) if violation is None else np.asarray(violation, dtype=np.float64)
        )
        seen = self._seen() if self.rules.boundary == "invisible" else None
        wanted = len(self.x) if seen is None else int(seen.sum())
        if cost.shape != (wanted,) or violation.shape != (wanted,):
            raise ArgumentError(
                "cost", cost.shape, f"shape ({wanted},): one entry a candidate asked"
            )
        bad = np.isnan(cost) | np.isnan(violation)
        if bad.any():
            cost, violation = np.where(bad, np.inf, cost), np.where(bad, np.inf, violation)
        if seen is None:
            return cost, violation
        full = np.full((2, len(self.x)), np.inf)
        full[0, seen], full[1, seen] = cost, violation
        return full[0], full[1]

    def _remember(self, cost: Array, violation: Array) -> None:
        """Update own bests by Deb's rule."""
        improved = cost < self.own_cost
        if np.count_nonzero(violation) or np.count_nonzero(self.own_violation):
            new, old = violation <= self.level, self.own_violation <= self.level
            less = (violation < self.own_violation) | ((violation == self.own_violation) & improved)
            improved = np.where(new & old, improved, np.where(new | old, new, less))
            self.own_violation[improved] = violation[improved]
        rows = improved.nonzero()[0]
        if len(rows):
            self.own[rows] = self.x[rows]
            self.own_cost[rows] = cost[rows]

    def _ring_leaders(self) -> IndexArray:
        """(n,): the best own position among each particle's neighbours and itself."""
        rank = self.own_cost
        if np.count_nonzero(self.own_violation > self.level):
            broken = np.where(self.own_violation <= self.level, 0.0, self.own_violation)
            rank = np.empty(len(broken))
            rank[np.lexsort((self.own_cost, broken))] = np.arange(len(broken))
        best = rank[self._ring].argmin(axis=1)
        return np.asarray(self._ring[self._places, best])

    def _move(self) -> None:
        rules, x, v = self.rules, self.x, self.v
        if self._kernel is not None:
            if not self._kernel.move(
                x,
                v,
                self.own,
                self._leaders,
                self.rng.random(out=self._drawn),
                self._inertia(),
                rules.cognitive,
                rules.social,
                self._low[0],
                self._high[0],
                self._limit,
            ):
                return  # no coordinate lies outside
        else:
            self._move_readably()
        if rules.boundary in ("reset", "upper reset", "reflect", "mirror", "absorb"):
            outside = (x < self._low) | (x > self._high)
            if np.count_nonzero(outside):
                rows, columns = outside.nonzero()
                low, high = self._low[0], self._high[0]
                _bring_back(rules.boundary, x, v, low, high, rows, columns, self.rng)

    def _move_readably(self) -> None:
        x, v, pull, r = self.x, self.v, self._pull, self._drawn[0]  # few arrays, which stay near
        gbest = self.rules.topology == "gbest"
        leader = self.own[self._leaders[0]] if gbest else self.own[self._leaders]
        v *= self._inertia()
        for towards, gain in ((self.own, self.rules.cognitive), (leader, self.rules.social)):
            np.subtract(towards, x, out=pull)
            pull *= gain
            self.rng.random(out=r)
            pull *= r
            v += pull
        if self.rules.velocity_limit is not None:
            np.clip(v, -self._limit, self._limit, out=v)
        x += v

    def _inertia(self) -> float:
        rules = self.rules
        if rules.final_inertia is None:
            return rules.inertia
        done = min(self.iteration / rules.horizon, 1.0) if rules.horizon else self.used
        return rules.inertia + (rules.final_inertia - rules.inertia) * done


def _bring_back(
    boundary: str,
    x: Array,
    v: Array,
    low: Array,
    high: Array,
    rows: IndexArray,
    columns: IndexArray,
    rng: Generator,
) -> None:
    """Apply a boundary rule to the coordinates outside, x[rows, columns], in place."""
    if boundary in ("reset", "upper reset"):  # [guzman2015], Table 5.4: anew, in 0.9 of the space
        lost, width = np.unique(rows), high - low
        drawn = rng.random((len(lost), x.shape[1])) - 0.5
        if boundary == "upper reset":
            drawn[:, 0] = (drawn[:, 0] + 0.5) / 2
        x[lost] = low + width / 2 + 0.9 * drawn * width
        v[lost] = 0.0
        return
    at, least, most = x[rows, columns], low[columns], high[columns]
    if boundary == "absorb":
        v[rows, columns] = 0.0
    else:
        t = np.mod((at - least) / (most - least), 2.0)
        at = least + (most - least) * np.where(t > 1.0, 2.0 - t, t)
        if boundary == "reflect":
            v[rows, columns] *= -1.0
    x[rows, columns] = np.minimum(np.maximum(at, least), most)


def warm() -> None:
    """Load or compile what ``Swarm`` will use."""
    if (kernel := _kernel()) is not None:
        kernel.warm()


def _kernel() -> Any:
    """The compiled iteration where numba has been loaded already (by a compiled objective, say);
    else None.

    Loading numba takes longer than it saves in one search. Both forms give the same bits.
    """
    if "numba" not in sys.modules:
        return None
    from trajopt.optimize import swarm_kernel

    return swarm_kernel


def _positions(rules: SwarmRules, bounds: Array, rng: Generator) -> Array:
    """(n, d): initial positions."""
    low, width = bounds[:, 0], bounds[:, 1] - bounds[:, 0]
    n, d = rules.particles, len(bounds)
    if rules.start == "sobol":
        from scipy.stats import qmc

        count = 1 << (n - 1).bit_length()  # the sequence is balanced in powers of two only
        unit = qmc.Sobol(d, scramble=False).random(count)[:n]
        return np.asarray(low + width * ((unit + rng.random(d)) % 1.0))
    x = low + width * rng.random((n, d))
    if rules.start in ("grid", "upper grid") and d >= 2:
        # Table 5.4 prints a row index it does not use; we read a grid of n/10 columns by 10 rows
        # with spacings of 1/(n/10 + 1) and 1/11 of the space.
        columns = max(1, n // 10)
        i = np.arange(n)
        share = (i // 10 % columns + 1) / (columns + 1)
        x[:, 0] = low[0] + width[0] * (share if rules.start == "grid" else 0.5 + share / 2)
        x[:, 1] = low[1] + width[1] * (i % 10 + 1) / 11
    return np.asarray(x)
