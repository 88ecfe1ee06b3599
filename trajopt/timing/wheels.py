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
_FIRST_CELLS, _MOST_CELLS = (
    16,
    2048,
)  # quadrature cells a spline segment, doubled until the angles settle
_SETTLED = 1e-11  # rad; change of every segment's wheel angles on doubling


@dataclass(frozen=True, eq=False)
class WheelTable:
    """Spin angles (M, K) of all wheels of the robot's file, rad, at spline parameters u (M,), from
    0 at the start of the path; and how castors and steered wheels turn."""

    path: Path
    steering: Steering
    motion: Motion
    turning: Turning
    u: Array
    angles: Array

    def at(self, u: Array) -> Array:
        """(N, K): spin angles at spline parameters (N,)."""
        i = np.clip(np.searchsorted(self.u, u, side="right") - 1, 0, len(self.u) - 2)
        return self.angles[i] + self._turned(self.u[i], u)

    def _turned(self, start: Array, end: Array) -> Array:
        """(N, K): angle gained from start to end (each pair inside one cell), five-point Gauss."""
        half = (end - start) / 2
        nodes = ((start + end) / 2)[:, None] + half[:, None] * _GAUSS_X
        u = nodes.ravel()
        turns = self.steering.turns
        s = self.path.parameter(u) if turns else np.zeros(len(u))
        samples, bend = self.motion(s, u)
        if turns:
            angle = self.turning.at(samples, bend)
            states = self.steering.states(samples.twist, samples.twist_rate, bend, angle)
        else:
            states = self.steering.rigid(samples.twist, samples.twist_rate)
        rates = states.spin * self.path.rate(u)[:, None]
        return np.asarray(np.einsum("ngw,g,n->nw", rates.reshape(*nodes.shape, -1), _GAUSS_W, half))


def wheel_table(path: Path, steering: Steering, motion: Motion, turning: Turning) -> WheelTable:
    """Table of wheel angles whose quadrature is refined until it changes by less than 1e-11 rad a
    segment. ``motion`` gives samples, without wheel states, at (s, u)."""
    knots, cells = np.asarray(path.basis.knots), _FIRST_CELLS
    empty = WheelTable(path, steering, motion, turning, knots, np.zeros((0, 0)))
    u, gained = _cells(empty, knots, cells)
    while cells < _MOST_CELLS:
        cells *= 2
        finer_u, finer = _cells(empty, knots, cells)
        change = _by_segment(finer, cells) - _by_segment(gained, cells // 2)
        u, gained = finer_u, finer
        if np.abs(change).max() < _SETTLED:
            break
    angles = np.vstack([np.zeros((1, gained.shape[1])), np.cumsum(gained, axis=0)])
    return WheelTable(path, steering, motion, turning, u, angles)


def _by_segment(gained: Array, cells: int) -> Array:
    return np.asarray(gained.reshape(-1, cells, gained.shape[1]).sum(axis=1))


def _cells(table: WheelTable, knots: Array, cells: int) -> tuple[Array, Array]:
    spread = np.arange(cells) / cells
    u = np.append((knots[:-1, None] + np.diff(knots)[:, None] * spread).ravel(), knots[-1])
    return u, table._turned(u[:-1], u[1:])
