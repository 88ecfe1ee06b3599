"""CMA-ES, hand-written: covariance matrix adaptation [hansen2016] with restarts [auger2005].

With candidates y_i = m + sigma B D z_i, z_i standard normal, ranked by Deb's rule, weights w_i and
rates c of the tutorial's Table 1 (negative weights included):

    m      <- m + sum over better half of w_i (y_i - m)
    p_s    <- (1 - c_s) p_s + sqrt(c_s (2 - c_s) mu_eff) C^-1/2 (m_new - m)/sigma
    p_c    <- (1 - c_c) p_c + h sqrt(c_c (2 - c_c) mu_eff) (m_new - m)/sigma
    C      <- (1 - c_1 - c_mu sum w) C + c_1 p_c p_c^T + c_mu sum w_i y_i y_i^T
    sigma  <- sigma exp(c_s/d_s (|p_s|/E|N(0, I)| - 1))

Variables are scaled to [0, 1]; what falls outside is mirrored back for its evaluation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.objectives.base import Capability
from trajopt.optimize.base import FEASIBLE, Status
from trajopt.optimize.run import Run
from trajopt.optimize.violations import Levels

_RELATIVE_X = 1e-12  # of the first step size: spread at which a search has converged; pycma's 1e-11
_FLAT = 1e-12  # spread of costs at which it has; pycma's tolfun is 1e-11
_CONDITION = 1e14  # of the covariance matrix, pycma's
_ARRAYS = ("mean", "covariance", "path_c", "path_s", "axes", "lengths", "y", "costs")
_VALUES = ("sigma", "iteration", "aged")


class Cma:
    """The state of one search, with ask and tell: ``x`` (n, d) is what to evaluate next."""

    def __init__(self, mean: Array, sigma: float, population: int, rng: Generator) -> None:
        d, n = len(mean), population
        self.mean, self.sigma, self.first_sigma, self.rng = mean.copy(), sigma, sigma, rng
        self.covariance, self.axes, self.lengths = np.eye(d), np.eye(d), np.ones(d)
        self.path_c, self.path_s = np.zeros(d), np.zeros(d)
        self.iteration = self.aged = 0
        raw = math.log((n + 1) / 2) - np.log(np.arange(1, n + 1))
        positive, negative = np.maximum(raw, 0.0), np.minimum(raw, 0.0)
        half = positive / positive.sum()
        self.effective = 1.0 / float((half**2).sum())
        against = negative.sum() ** 2 / max(float((negative**2).sum()), 1e-300)
        e = self.effective
        self.rate_c = (4 + e / d) / (d + 4 + 2 * e / d)
        self.rate_s = (e + 2) / (d + e + 5)
        self.rate_1 = 2 / ((d + 1.3) ** 2 + e)
        self.rate_mu = min(1 - self.rate_1, 2 * (0.25 + e + 1 / e - 2) / ((d + 2) ** 2 + e))
        self.damping = 1 + 2 * max(0.0, math.sqrt((e - 1) / (d + 1)) - 1) + self.rate_s
        self.expected = math.sqrt(d) * (1 - 1 / (4 * d) + 1 / (21 * d * d))
        most = min(
            1 + self.rate_1 / self.rate_mu,
            1 + 2 * against / (e + 2),
            (1 - self.rate_1 - self.rate_mu) / (d * self.rate_mu),
        )
        self.weights = half + most * negative / max(-float(negative.sum()), 1e-300)
        self.half = half
        self.costs = np.full(10 + math.ceil(30 * d / n), np.inf)  # best of the last iterations
        self._draw(n)

    def ask(self) -> Array:
        """(n, d): in [0, 1]."""
        folded = np.mod(self.y, 2.0)
        return np.where(folded > 1.0, 2.0 - folded, folded)

    def learn(self, cost: Array, violation: Array, level: float = FEASIBLE) -> None:
        """Costs and violations (n,) of what ``ask`` gave; violations up to ``level`` count as
        none."""
        d, n = self.y.shape[1], len(self.y)
        order = np.lexsort((cost, np.where(violation <= level, 0.0, violation)))
        best = cost[order[0]] if violation[order[0]] <= level else math.inf
        self.costs = np.append(self.costs[1:], best)
        self._spread = float(np.ptp(cost)) if np.isfinite(cost).all() else math.inf
        steps = (self.y[order] - self.mean) / self.sigma
        step = self.half @ steps
        self.mean = self.mean + self.sigma * step
        whitened = self.axes @ ((self.axes.T @ step) / self.lengths)
        e, s, c = self.effective, self.rate_s, self.rate_c
        self.path_s = (1 - s) * self.path_s + math.sqrt(s * (2 - s) * e) * whitened
        self.iteration += 1
        length = float(np.linalg.norm(self.path_s))
        old = 1 - (1 - s) ** (2 * self.iteration)
        moves = length / math.sqrt(old) < (1.4 + 2 / (d + 1)) * self.expected
        self.path_c = (1 - c) * self.path_c + moves * math.sqrt(c * (2 - c) * e) * step
        sizes = ((steps @ self.axes / self.lengths) ** 2).sum(axis=1)
        weights = np.where(
            self.weights >= 0, self.weights, self.weights * d / np.maximum(sizes, 1e-300)
        )
        kept = 1 + (not moves) * self.rate_1 * c * (2 - c)
        kept -= self.rate_1 + self.rate_mu * float(self.weights.sum())
        self.covariance *= kept
        self.covariance += self.rate_1 * np.outer(self.path_c, self.path_c)
        self.covariance += self.rate_mu * (steps.T * weights) @ steps
        self.sigma *= math.exp(min(1.0, s / self.damping * (length / self.expected - 1)))
        self.aged += 1
        if self.aged > 0.1 / (d * (self.rate_1 + self.rate_mu)):
            self._decompose()
        self._draw(n)

    @property
    def ended(self) -> bool:
        """Whether the search has converged, or can go no further."""
        spread = self.sigma * max(float(self.lengths.max()), float(np.abs(self.path_c).max()))
        if spread < _RELATIVE_X * self.first_sigma:
            return True
        recent = self.costs
        known = bool(np.isfinite(recent).all())
        scale = _FLAT * max(1.0, abs(float(recent[-1]))) if known else 0.0
        if known and float(np.ptp(recent)) <= scale and self._spread <= scale:
            return True
        if self.lengths.max() > math.sqrt(_CONDITION) * self.lengths.min():
            return True
        return not np.isfinite(self.sigma) or self.sigma > 1e4 * self.first_sigma

    def _decompose(self) -> None:
        self.aged = 0
        self.covariance = (self.covariance + self.covariance.T) / 2
        values, self.axes = np.linalg.eigh(self.covariance)
        self.lengths = np.sqrt(np.maximum(values, 1e-300))

    def _draw(self, n: int) -> None:
        z = self.rng.standard_normal((n, len(self.mean)))
        self.y = self.mean + self.sigma * (z * self.lengths) @ self.axes.T

    def pack(self) -> dict[str, Any]:
        """The whole state: arrays and plain values."""
        found = {name: getattr(self, name) for name in (*_ARRAYS, *_VALUES)}
        return {**found, "rng": self.rng.bit_generator.state}

    def unpack(self, kept: Mapping[str, Any]) -> None:
        """Go on from what ``pack`` gave."""
        for name in (*_ARRAYS, *_VALUES):
            setattr(self, name, kept[name])
        self._spread = math.inf
        self.rng.bit_generator.state = kept["rng"]


@dataclass(frozen=True)
class CmaEs:
    """CMA-ES, restarted with twice the population when it has converged (IPOP)."""

    name: ClassVar[str] = "cma-es"
    needs: ClassVar[frozenset[Capability]] = frozenset()
    stochastic: ClassVar[bool] = True
    saves: ClassVar[bool] = True

    sigma: float = 0.3  # of the width; pycma's documentation: about a quarter of the search range
    restarts: int = 9  # pycma's documentation of IPOP

    def search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:
        """Search until the last restart has converged or the budget ends."""
        run.constructed()
        search = _Restarts(self, run, x0, rng)
        resumes = run.keep(search)
        if x0 is not None and not resumes:  # it samples around its start without evaluating it
            run.evaluate(x0[None])
        while search.restart <= self.restarts:
            search.iterate()
        return Status.CONVERGED, f"{self.restarts} restarts"


class _Restarts:
    def __init__(self, options: CmaEs, run: Run, x0: Array | None, rng: Generator) -> None:
        self.options, self.run, self.rng, self.levels = options, run, rng, Levels(run)
        self.begin(0, None if x0 is None else (x0 - run.bounds[:, 0]) / run.width)

    def begin(self, restart: int, start: Array | None) -> None:
        d = len(self.run.bounds)
        population = (4 + int(3 * math.log(d))) << restart  # [hansen2016], Table 1
        self.restart = restart
        start = self.rng.random(d) if start is None else start
        self.strategy = Cma(start, self.options.sigma, population, self.rng)

    def iterate(self) -> None:
        run, strategy = self.run, self.strategy
        x = run.bounds[:, 0] + run.width * strategy.ask()
        found = run.evaluate(np.minimum(x, run.bounds[:, 1]), inside=True)
        strategy.learn(found.cost, found.violation, self.levels.at(found.violation))
        run.nit += 1
        if strategy.ended:
            self.begin(self.restart + 1, None)
        run.checkpoint()

    def pack(self) -> dict[str, Any]:
        return {**self.strategy.pack(), "restart": self.restart}

    def unpack(self, kept: Mapping[str, Any]) -> None:
        if kept["mean"].shape != self.strategy.mean.shape:
            raise ValueError(f"a search in {len(self.strategy.mean)} variables")
        self.begin(int(kept["restart"]), kept["mean"])
        self.strategy.unpack(kept)
