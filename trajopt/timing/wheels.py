"""Wheel angles along a path: integrals of its geometry, whatever the timing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array
from trajopt.paths.path import Path
from trajopt.paths.samples import sample_at
from trajopt.robots.robot import Robot

_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(5)
_FIRST_CELLS, _MOST_CELLS = (
    16,
    2048,
)  # quadrature cells a spline segment, doubled until the angles settle
_SETTLED = 1e-11  # rad; change of every segment's wheel angles on doubling


@dataclass(frozen=True, eq=False)
class WheelTable:
    """Wheel angles (M, W), rad, at spline parameters u (M,), from 0 at the start of the path."""

    path: Path
    robot: Robot
    u: Array
    angles: Array

    def at(self, u: Array) -> Array:
        """(N, W): wheel angles at spline parameters (N,)."""
        i = np.clip(np.searchsorted(self.u, u, side="right") - 1, 0, len(self.u) - 2)
        return self.angles[i] + _turned(self.path, self.robot, self.u[i], u)


def wheel_table(path: Path, robot: Robot) -> WheelTable:
    """Table of wheel angles whose quadrature is refined until it changes by less than 1e-11 rad a
    segment."""
    knots, cells = np.asarray(path.basis.knots), _FIRST_CELLS
    u, gained = _cells(path, robot, knots, cells)
    while cells < _MOST_CELLS:
        cells *= 2
        finer_u, finer = _cells(path, robot, knots, cells)
        change = _by_segment(finer, cells) - _by_segment(gained, cells // 2)
        u, gained = finer_u, finer
        if np.abs(change).max() < _SETTLED:
            break
    return WheelTable(
        path, robot, u, np.vstack([np.zeros((1, gained.shape[1])), np.cumsum(gained, axis=0)])
    )


def _by_segment(gained: Array, cells: int) -> Array:
    return np.asarray(gained.reshape(-1, cells, gained.shape[1]).sum(axis=1))


def _cells(path: Path, robot: Robot, knots: Array, cells: int) -> tuple[Array, Array]:
    spread = np.arange(cells) / cells
    u = np.append((knots[:-1, None] + np.diff(knots)[:, None] * spread).ravel(), knots[-1])
    return u, _turned(path, robot, u[:-1], u[1:])


def _turned(path: Path, robot: Robot, start: Array, end: Array) -> Array:
    """(N, W): angle gained from start to end (each pair inside one cell), five-point Gauss."""
    half = (end - start) / 2
    nodes = ((start + end) / 2)[:, None] + half[:, None] * _GAUSS_X
    samples = sample_at(path, np.zeros(nodes.size), nodes.ravel())
    rates = (samples.twist * path.rate(nodes.ravel())[:, None]) @ robot.inverse.T
    return np.asarray(np.einsum("ngw,g,n->nw", rates.reshape(*nodes.shape, -1), _GAUSS_W, half))
