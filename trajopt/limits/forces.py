"""Forces between robot and ground, as functions that are affine in (s'', s'^2).

All forces are per unit mass. With the acceleration of the centre of gravity and gravity resolved in
the body frame, the ground must supply f = acceleration - gravity; it acts at the centre of gravity,
a height h above the contacts. Left out: wheel inertia, rolling resistance, and the pitching and
rolling inertia of the body.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import STANDARD_GRAVITY, Body


@dataclass(frozen=True)
class Affine:
    """value = a s'' + b s'^2 + c, arrays (N, K)."""

    a: Array
    b: Array
    c: Array

    def through(self, matrix: Array) -> Affine:
        """matrix @ value, for a matrix (M, K)."""
        return Affine(self.a @ matrix.T, self.b @ matrix.T, self.c @ matrix.T)


def specific_force(path: PathSamples, body: Body) -> Affine:
    """(N, 3): acceleration of the centre of gravity minus gravity, m/s^2, body frame, z along the
    normal.

    A centre of gravity at (x, y) off the body origin adds wz' x r and the centripetal -wz^2 r.
    """
    x, y, _ = body.cog
    zero, wz, wz1 = np.zeros(len(path.s)), path.twist[:, 2], path.twist_rate[:, 2]
    a = np.column_stack([path.twist[:, 0] - wz * y, path.twist[:, 1] + wz * x, zero])
    b = path.acceleration_rate + np.column_stack([-wz1 * y - wz**2 * x, wz1 * x - wz**2 * y, zero])
    return Affine(a, b, -STANDARD_GRAVITY * path.gravity)


def ground_wrench(path: PathSamples, body: Body) -> Affine:
    """(N, 3): force x, y (m/s^2) and yaw moment (m^2/s^2) about the centre of gravity, per unit
    mass."""
    force = specific_force(path, body)
    inertia = body.yaw_inertia / body.mass
    return Affine(
        np.column_stack([force.a[:, :2], inertia * path.twist[:, 2]]),
        np.column_stack([force.b[:, :2], inertia * path.twist_rate[:, 2]]),
        np.column_stack([force.c[:, :2], np.zeros(len(path.s))]),
    )


def contact_arms(body: Body) -> Array:
    """(C, 2): contact points relative to the centre of gravity, m."""
    contacts: Array = np.asarray(body.contacts, dtype=np.float64).reshape(-1, 2)
    return contacts - np.asarray(body.cog[:2], dtype=np.float64)


def contact_loads(path: PathSamples, body: Body) -> Affine:
    """(N, C): normal force on every contact, m/s^2 (times the mass: N).

    Vertical force, pitch and roll balance about the centre of gravity give three equations, sum N =
    f_z, sum x N = -h f_x, sum y N = -h f_y. Where more contacts share the load, ground and
    suspension are equally stiff everywhere: the distribution of least norm. Raises ArgumentError
    when the contacts lie on one line (they cannot hold the body up).
    """
    arms, h = contact_arms(body), body.cog[2]
    balance = np.vstack([np.ones(len(arms)), arms.T])
    if np.linalg.matrix_rank(balance) < 3:
        raise ArgumentError(
            "robot.body.contacts", body.contacts, "three or more contacts not on one line"
        )
    demand = np.array([[0.0, 0.0, 1.0], [-h, 0.0, 0.0], [0.0, -h, 0.0]])
    return specific_force(path, body).through(np.linalg.pinv(balance) @ demand)
