"""Wheel angles along a path: integrals of its geometry, whatever the timing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array
from trajopt.paths.path import Path
from trajopt.robots.steering import Steering
from trajopt.timing.steered import Motion
from trajopt.timing.turning import Turning

_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(5)
_UNIT_X = (1 + _GAUSS_X) / 2
# Powers t, t^2, .. t^5 of the integral from 0 to t of the quartic through the values at Gauss nodes.
_TO_POWERS = np.linalg.inv(np.vander(_UNIT_X, increasing=True)).T / np.arange(1, 6)
_SETTLED = 1e-12  # rad, and of the length: what halving a cell may change; chosen
_ROUNDING = 1e-15  # of the largest integrand times a cell, which no halving betters
_HALVINGS = 40  # of a cell at most; chosen
_CHUNK = 50_000  # places at a time; chosen, for memory


@dataclass(frozen=True, eq=False)
class WheelTable:
    """Spin angles of all K wheels of the robot's file (rad), and path parameter (m), as polynomials
    of fifth degree in cells of the path; both are 0 at its start."""

    u: Array  # (M+1,) spline parameter at the ends of the cells
    sums: Array  # (M+1, K+1) angles, and last the path parameter, there
    powers: Array  # (M, K+1, 5) coefficients of t, t^2, .. t^5 with t from 0 to 1 in the cell

    def at(self, u: Array) -> Array:
        """(N, K): spin angles at spline parameters (N,)."""
        i = np.clip(np.searchsorted(self.u, u, side="right") - 1, 0, len(self.u) - 2)
        t = ((u - self.u[i]) / (self.u[i + 1] - self.u[i]))[:, None]
        c = self.powers[i, :-1]
        gained = t * (
            c[..., 0] + t * (c[..., 1] + t * (c[..., 2] + t * (c[..., 3] + t * c[..., 4])))
        )
        return np.asarray(self.sums[i, :-1] + gained)


@dataclass(frozen=True, eq=False)
class _Rates:
    path: Path
    steering: Steering
    motion: Motion
    turning: Turning

    def inside(self, left: Array, right: Array) -> Array:
        """(M, 5, K+1): derivatives along the cells' t of spin angles and path parameter at their Gauss
        nodes."""
        parts = [
            self._inside(left[k : k + _CHUNK], right[k : k + _CHUNK])
            for k in range(0, len(left), _CHUNK)
        ]
        return np.concatenate(parts)

    def _inside(self, left: Array, right: Array) -> Array:
        width = (right - left)[:, None]
        u = (left[:, None] + width * _UNIT_X).ravel()
        turns = self.steering.turns
        samples, bend = self.motion(self.path.parameter(u) if turns else np.zeros(len(u)), u)
        if turns:
            angle = self.turning.at(samples, bend)
            states = self.steering.states(samples.twist, samples.twist_rate, bend, angle)
        else:
            states = self.steering.rigid(samples.twist, samples.twist_rate)
        rates = np.column_stack([states.spin, np.ones(len(u))]) * self.path.rate(u)[:, None]
        return np.asarray(rates.reshape(len(left), 5, -1) * width[..., None])


def wheel_table(path: Path, steering: Steering, motion: Motion, turning: Turning) -> WheelTable:
    """Cells are halved until that changes no angle by more than 1e-12 rad. ``motion`` gives samples,
    without wheel states, at (s, u)."""
    rates = _Rates(path, steering, motion, turning)
    ends = np.unique(np.concatenate([path.basis.knots, turning.castor_u]))
    left, right = ends[:-1], ends[1:]
    inside = rates.inside(left, right)
    settled = np.full(inside.shape[2], _SETTLED)
    settled[-1] *= path.length
    known: list[tuple[Array, Array]] = []
    for done in range(_HALVINGS):
        middle = (left + right) / 2
        halves = rates.inside(np.append(left, middle), np.append(middle, right))
        first, second = np.einsum("tmgk,g->tmk", halves.reshape(2, *inside.shape), _GAUSS_W / 2)
        powers = np.einsum("mgk,gp->mkp", inside, _TO_POWERS)
        off = np.maximum(
            np.abs(powers @ 0.5 ** np.arange(1, 6) - first),
            np.abs(powers.sum(axis=2) - first - second),
        )
        least = _ROUNDING * np.abs(inside).max(axis=1)
        coarse = (off > np.maximum(settled, least)).any(axis=1) & (left < middle) & (middle < right)
        if done == _HALVINGS - 1:
            coarse[:] = False
        known.append((left[~coarse], powers[~coarse]))
        if not coarse.any():
            break
        inside = halves[np.tile(coarse, 2)]
        left, right = (
            np.concatenate([left[coarse], middle[coarse]]),
            np.concatenate([middle[coarse], right[coarse]]),
        )
    starts = np.concatenate([part[0] for part in known])
    order = np.argsort(starts)
    powers = np.concatenate([part[1] for part in known])[order]
    gained = powers.sum(axis=2)
    sums = np.vstack([np.zeros((1, gained.shape[1])), np.cumsum(gained, axis=0)])
    return WheelTable(np.append(starts[order], ends[-1]), sums, np.ascontiguousarray(powers))
