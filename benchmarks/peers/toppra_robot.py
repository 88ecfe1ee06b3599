"""A robot's limits for toppra, as its own documentation writes constraints: a few quantities linear in
(s'', s'^2) at all gridpoints at once, and one matrix of bounds on them for all."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.paths.path import Path

GRAVITY = 9.80665


class WheeledRobot:
    """Slip (polygon of ``sides``), tip, wheel acceleration and wheel speed of a differential drive
    whose contacts stand still; shapes as in its own classes."""

    def __init__(self, robot: Any, friction: float, sides: int, rate: float, speed: float) -> None:
        body = robot.body
        arms = np.asarray(body.contacts, dtype=np.float64)[:, :2] - np.asarray(body.cog)[:2]
        self.cog, self.inverse, self.speed = np.asarray(body.cog), robot.inverse, speed
        balance = np.column_stack([np.ones(len(arms)), arms]).T
        share = np.linalg.pinv(balance)[:2].sum(axis=0)  # load of the driven wheels, listed first
        angles = 2 * np.pi * (np.arange(sides) + 0.5) / sides
        normals = np.column_stack([np.cos(angles), np.sin(angles)])
        inside, height = np.cos(np.pi / sides), self.cog[2]
        slip = normals + friction * inside * height * share[1:]
        slip_most = np.full(sides, friction * inside * share[0] * GRAVITY)
        tip, tip_most = _edges(arms, height)
        wheels = np.vstack([np.eye(2), -np.eye(2)])
        zero = np.zeros
        self.bounds = np.vstack(
            [
                np.hstack([slip, zero((sides, 2))]),
                np.hstack([tip, zero((len(tip), 2))]),
                np.hstack([zero((4, 2)), wheels]),
            ]
        )
        self.most = np.concatenate([slip_most, tip_most, np.full(4, rate)])

    def params(self, path: Any, gridpoints: Array) -> tuple[Any, ...]:
        """a, b, c, F, g, ubound, xbound."""
        d, dd, ddd = (path.cspl(gridpoints, order) for order in (1, 2, 3))
        square = np.sum(d * d, axis=1)
        n, cross = np.sqrt(square), d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]
        along = np.sum(d * dd, axis=1)
        turn = cross / square
        turn1 = (d[:, 0] * ddd[:, 1] - d[:, 1] * ddd[:, 0] - 2 * turn * along) / square
        first = np.column_stack([n, np.zeros_like(n), turn])
        second = np.column_stack([along / n, np.zeros_like(n), turn1])
        x, y = self.cog[:2]
        a = np.column_stack([n - turn * y, turn * x, first @ self.inverse.T])
        fx = second[:, 0] - turn1 * y - turn**2 * x
        fy = n * turn + turn1 * x - turn**2 * y
        b = np.column_stack([fx, fy, second @ self.inverse.T])
        most = np.min((self.speed / np.abs(first @ self.inverse.T)) ** 2, axis=1)
        xbound = np.column_stack([np.zeros_like(most), np.minimum(most, 1e8)])
        return a, b, np.zeros_like(a), self.bounds, self.most, None, xbound


def _edges(arms: Array, height: float) -> tuple[Array, Array]:
    """Rows of the zero-moment point inside the hull of contacts."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(arms)
    return -height * hull.equations[:, :2] / GRAVITY, -hull.equations[:, 2]


def solved(path: Any, limits: WheeledRobot, points: int) -> Any:
    """The whole call of a user: constraint, grid, parameterisation, trajectory."""
    from toppra.algorithm import TOPPRA
    from toppra.constraint import LinearConstraint

    logging.getLogger("toppra").setLevel(logging.CRITICAL)
    constraint = LinearConstraint()
    constraint.identical = True
    constraint.compute_constraint_params = limits.params
    grid = np.linspace(*path.path_interval, points)
    instance = TOPPRA(
        [constraint],
        path,
        gridpoints=grid,
        solver_wrapper="seidel",
        parametrizer="ParametrizeConstAccel",
    )
    return instance.compute_trajectory(0, 0)


def interpolator(path: Path) -> Any:
    """The same spline."""
    import toppra

    return toppra.SplineInterpolator(np.asarray(path.basis.knots), path.points[:, :2], "natural")
