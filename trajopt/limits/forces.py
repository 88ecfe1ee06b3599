"""Forces between robot and ground, as functions that are affine in (s'', s'^2).

All forces are per unit mass. With the acceleration of the centre of gravity and gravity resolved in
the body frame, the ground must supply f = acceleration - gravity and the moment M = I W' + W x I W
about the centre of gravity, a height h above the contacts. Left out: the wheels' own spin, rolling
resistance, products of inertia.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import STANDARD_GRAVITY, Body, Robot
from trajopt.robots.steering import steering_of


@dataclass(frozen=True)
class Affine:
    """value = a s'' + b s'^2 + c, arrays (N, K)."""

    a: Array
    b: Array
    c: Array

    def through(self, matrix: Array) -> Affine:
        """matrix @ value, for a matrix (M, K), or one a place (N, M, K)."""
        if matrix.ndim == 2:
            return Affine(self.a @ matrix.T, self.b @ matrix.T, self.c @ matrix.T)
        parts = (np.einsum("nmk,nk->nm", matrix, part) for part in (self.a, self.b, self.c))
        return Affine(*parts)

    def __getitem__(self, which: slice) -> Affine:
        """Some of its columns."""
        return Affine(self.a[:, which], self.b[:, which], self.c[:, which])

    def __add__(self, other: Affine) -> Affine:
        return Affine(self.a + other.a, self.b + other.b, self.c + other.c)

    def __sub__(self, other: Affine) -> Affine:
        return Affine(self.a - other.a, self.b - other.b, self.c - other.c)

    def __mul__(self, factor: Array | float) -> Affine:
        return Affine(self.a * factor, self.b * factor, self.c * factor)

    @classmethod
    def beside(cls, *parts: Affine) -> Affine:
        """Columns of all parts."""
        columns = ([getattr(p, k) for p in parts] for k in "abc")
        return cls(*(np.hstack(c) for c in columns))

    def at(self, sdd: Array, sd2: Array) -> Array:
        """(N, K): values at s'' (N,) and s'^2 (N,)."""
        return np.asarray(self.a * sdd[:, None] + self.b * sd2[:, None] + self.c)


def specific_force(path: PathSamples, body: Body) -> Affine:
    """(N, 3): acceleration of the centre of gravity minus gravity, m/s^2, body frame, z along the
    normal.

    A centre of gravity at r off the body origin adds W' x r and W x (W x r).
    """
    r = np.asarray(body.cog, dtype=np.float64)
    w = path.turning
    a = path.velocity + cross(w, r)
    b = path.acceleration_rate + cross(path.turning_rate, r) + cross(w, cross(w, r))
    return Affine(a, b, -STANDARD_GRAVITY * path.gravity)


def ground_moment(path: PathSamples, body: Body) -> Affine:
    """(N, 3): moment about the centre of gravity that the ground must supply, per unit mass,
    m^2/s^2, body frame."""
    inertia = np.array([body.roll_inertia, body.pitch_inertia, body.yaw_inertia]) / body.mass
    w = path.turning
    b = path.turning_rate * inertia + cross(w, w * inertia)
    return Affine(w * inertia, b, np.zeros_like(w))


def load_demand(path: PathSamples, body: Body) -> Affine:
    """(N, 3): what the loads N of the contacts, at x, y from the centre of gravity, must sum to: sum
    N, sum x N, sum y N."""
    h, force = body.cog[2], specific_force(path, body)
    demand = force.through(np.array([[0.0, 0.0, 1.0], [-h, 0.0, 0.0], [0.0, -h, 0.0]]))
    if not path.turning[:, :2].any() and not path.turning_rate[:, :2].any():
        return demand  # the body neither pitches nor rolls
    moment = ground_moment(path, body)
    return demand + moment.through(np.array([[0.0, 0.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]))


def contact_points(path: PathSamples, robot: Robot) -> Array:
    """(K, 2), or (N, K, 2) where castors swivel: where the wheels stand in the body frame, m."""
    if not len(steering_of(robot).castors) or path.wheels is None:
        return np.asarray(robot.body.contacts, dtype=np.float64)
    return path.wheels.contacts


def contact_arms(path: PathSamples, robot: Robot) -> Array:
    """As ``contact_points``, from the centre of gravity."""
    return contact_points(path, robot) - np.asarray(robot.body.cog[:2], dtype=np.float64)


def least_norm(rows: Array) -> Array:
    """(..., K, R): pseudo-inverse of matrices (..., R, K) of full rank R <= K."""
    turned = np.swapaxes(rows, -1, -2)
    return np.asarray(np.swapaxes(np.linalg.solve(rows @ turned, rows), -1, -2))


def cross(a: Array, b: Array) -> Array:
    """Cross product of vectors (..., 3)."""
    (ax, ay, az), (bx, by, bz) = (np.moveaxis(v, -1, 0) for v in (a, b))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)
