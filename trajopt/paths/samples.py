"""A path seen by the limits: geometry at gridpoints, with derivatives along the path parameter s.

With path speed s' and path acceleration s'', everything a limit needs is linear in (s'', s'^2):

    body twist           (vx, vy, wz) = twist s'
    its time derivative               = twist s'' + twist_rate s'^2
    acceleration, body frame          = velocity s'' + acceleration_rate s'^2
    angular velocity, body frame      = turning s'
    its time derivative               = turning s'' + turning_rate s'^2

The body frame stands on the ground: x along the heading, z along the normal of the posture, which
on smooth ground is the surface's. The twist is what wheels feel: velocity along x and y, angular
velocity about z. ``world/posture.py`` makes samples on a ground; the functions here take the path
as the ground, its lateral axis level.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import InfeasibleError
from trajopt.paths.path import Path
from trajopt.robots.steering import WheelStates


@dataclass(frozen=True)
class PathSamples:
    """Geometry at N gridpoints. SI units; the body frame is x forward, y left, z up (surface
    normal)."""

    s: Array  # (N,) path parameter, m
    u: Array  # (N,) spline parameter
    position: Array  # (N, 3) x, y, z, m
    yaw: Array  # (N,) rad, continuous
    tangent: Array  # (N, 3) d position / ds
    twist: Array  # (N, 3) body twist per unit path speed: (vx, vy, wz)
    twist_rate: Array  # (N, 3) d twist / ds
    acceleration_rate: Array  # (N, 3) body-frame acceleration per s'^2
    gravity: Array  # (N, 3) direction of gravity in the body frame (unit vector)
    curvature: (
        Array  # (N,) geodesic curvature of the track, 1/m (0 where the robot turns on the spot)
    )
    slope: Array  # (N,) rad, positive uphill along the direction of travel
    velocity: Array  # (N, 3) body-frame velocity of the origin per unit path speed
    turning: Array  # (N, 3) angular velocity of the body per unit path speed, body frame, rad/m
    turning_rate: Array  # (N, 3) d turning / ds
    wheel_states: Callable[[], WheelStates] | None = None
    sd2: Array | None = None  # (N,) s'^2, m^2/s^2, where limits that are not linear are taken at

    @cached_property
    def wheels(self) -> WheelStates | None:
        """Of the robot on its track; None where wheels stand as the robot's file draws them."""
        return None if self.wheel_states is None else self.wheel_states()

    @property
    def rotation(self) -> Array:
        """(N, 3, 3): columns are the body's axes in the world, from yaw and gravity."""
        up = -self.gravity
        cos, sin, level = np.cos(self.yaw), np.sin(self.yaw), np.hypot(up[:, 1], up[:, 2])
        zero = np.zeros_like(cos)
        turn = np.stack([[cos, -sin, zero], [sin, cos, zero], [zero, zero, zero + 1]])
        c, s = up[:, 2] / level, up[:, 1] / level  # roll
        tilt = np.stack(
            [[level, up[:, 0] * -s, up[:, 0] * -c], [zero, c, -s], [up[:, 0], level * s, level * c]]
        )
        return np.asarray(np.einsum("ijn,jkn->nik", turn, tilt))


_STANDS = 1e-9  # share of the path's rate ds/du below which it stands still
_STILL = "the path stands still or doubles back here; move or drop a control point, or split the path at the stop"


def sample_path(path: Path, s: Array) -> PathSamples:
    """Samples of ``path`` at path parameters ``s`` (N,) in [0, path.length].

    Raises InfeasibleError where the path stands still or doubles back (no direction of travel
    there).
    """
    return sample_at(path, s, path.locate(s))


def require_moving(path: Path) -> None:
    """Raises InfeasibleError where the path stands still or doubles back, also between samples."""
    u = path.standstill(_STANDS)
    if u is not None:
        raise InfeasibleError("path", float(path.parameter([u])[0]), _STILL)


def sample_at(path: Path, s: Array, u: Array) -> PathSamples:
    """Samples at spline parameters ``u`` (N,) whose path parameters ``s`` (N,) are known.

    At a knot the third derivative jumps: exactly on it this gives the limit from the right, at
    ``np.nextafter(knot, -inf)`` the limit from the left. Raises as ``sample_path``.
    """
    p = [path.position(u, k) for k in range(4)]
    if path.heading is None:
        found = along_tangent(s, u, p)
        return found if path.plain else _facing(found, path.facing(u))
    yaw = [path.yaw(u, k) for k in range(4)]
    return _free_heading(s, u, p, yaw, path.turning_length)


def _by_path_parameter(s: Array, c1: Array, c2: Array, c3: Array) -> tuple[Array, Array, Array]:
    """First to third derivative along s of coordinates whose derivatives along u are c1, c2, c3 (N,
    D)."""
    g = np.sqrt(np.sum(c1**2, axis=1))
    scale = float(np.max(g)) if len(g) else 0.0
    if not scale > 0 or np.any(g < _STANDS * scale):
        place = float(s[int(np.argmin(g))]) if len(g) else 0.0
        raise InfeasibleError("path", place, _STILL)
    g = g[:, None]
    g1 = np.sum(c1 * c2, axis=1)[:, None] / g
    g2 = (np.sum(c2 * c2 + c1 * c3, axis=1)[:, None] - g1**2) / g
    first = c1 / g
    second = c2 / g**2 - c1 * g1 / g**3
    third = c3 / g**3 - 3 * c2 * g1 / g**4 - c1 * g2 / g**4 + 3 * c1 * g1**2 / g**5
    return first, second, third


def along_tangent(s: Array, u: Array, p: list[Array]) -> PathSamples:
    """Heading along the path: twist (1, 0, geodesic curvature). The lateral axis stays level."""
    t, t1, t2 = _by_path_parameter(s, p[1], p[2], p[3])
    level = np.hypot(t[:, 0], t[:, 1])
    if np.any(level < 1e-6):
        raise InfeasibleError("path", float(s[int(np.argmin(level))]), "the path is vertical here")
    cross = t[:, 0] * t1[:, 1] - t[:, 1] * t1[:, 0]
    cross1 = t[:, 0] * t2[:, 1] - t[:, 1] * t2[:, 0]
    level1 = (t[:, 0] * t1[:, 0] + t[:, 1] * t1[:, 1]) / level
    kappa = cross / level
    kappa1 = cross1 / level - cross * level1 / level**2
    # Surface normal = tangent x (level lateral axis); vertical curvature is the curvature along it.
    kappa_v = t1[:, 2] * level - t[:, 2] * level1
    zero, one = np.zeros_like(kappa), np.ones_like(kappa)
    yaw = np.unwrap(np.arctan2(t[:, 1], t[:, 0]))
    turning, turning_rate = np.zeros((2, len(s), 3))
    turning[:, 2], turning_rate[:, 2] = kappa, kappa1
    if t[:, 2].any():  # yawing about the vertical, and pitching with the vertical curvature
        spread = np.sum(t1[:, :2] ** 2 + t[:, :2] * t2[:, :2], axis=1)
        level2 = (spread - level1**2) / level
        turning[:, 0], turning[:, 1] = kappa / level * t[:, 2], -kappa_v
        turning_rate[:, 0] = (kappa1 - kappa * level1 / level) / level * t[:, 2]
        turning_rate[:, 0] += kappa / level * t1[:, 2]
        turning_rate[:, 1] = t[:, 2] * level2 - t2[:, 2] * level
    return PathSamples(
        s,
        u,
        p[0],
        yaw,
        t,
        np.column_stack([one, zero, kappa]),
        np.column_stack([zero, zero, kappa1]),
        np.column_stack([zero, kappa, kappa_v]),
        np.column_stack([-t[:, 2], zero, -level]),
        kappa,
        np.arcsin(np.clip(t[:, 2], -1.0, 1.0)),
        np.column_stack([one, zero, zero]),
        turning,
        turning_rate,
    )


def _facing(found: PathSamples, sign: Array) -> PathSamples:
    """Samples of a robot that faces against the direction of travel where ``sign`` (N,) is -1: the
    axes ahead and to the left change theirs."""
    if (sign > 0).all():
        return found
    both = np.column_stack([sign, sign, np.ones(len(sign))])
    return replace(
        found,
        yaw=np.unwrap(found.yaw + np.where(sign < 0, np.pi, 0.0)),
        twist=found.twist * both,
        twist_rate=found.twist_rate * both,
        acceleration_rate=found.acceleration_rate * both,
        gravity=found.gravity * both,
        velocity=found.velocity * both,
        turning=found.turning * both,
        turning_rate=found.turning_rate * both,
    )


def _free_heading(
    s: Array, u: Array, p: list[Array], yaw: list[Array], length: float
) -> PathSamples:
    """Heading of its own, on level ground: the planar motion of an omnidirectional robot."""
    stacked = [np.column_stack([p[k][:, :2], length * yaw[k]]) for k in range(4)]
    d1, d2, _ = _by_path_parameter(s, stacked[1], stacked[2], stacked[3])
    cos, sin = np.cos(yaw[0]), np.sin(yaw[0])
    w, w1 = d1[:, 2] / length, d2[:, 2] / length
    vx, vy = cos * d1[:, 0] + sin * d1[:, 1], -sin * d1[:, 0] + cos * d1[:, 1]
    ax, ay = cos * d2[:, 0] + sin * d2[:, 1], -sin * d2[:, 0] + cos * d2[:, 1]
    zero, one = np.zeros_like(w), np.ones_like(w)
    speed = np.hypot(d1[:, 0], d1[:, 1])
    cross = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    moving = speed > 1e-6  # slower than 1e-6 of the path parameter it is a turn on the spot
    curvature = np.where(moving, cross / np.where(moving, speed, 1.0) ** 3, 0.0)
    tangent = np.column_stack([d1[:, 0], d1[:, 1], zero])
    # d/ds of R(-yaw) d1 = R(-yaw) d2 - w (e_z x R(-yaw) d1)
    return PathSamples(
        s,
        u,
        p[0],
        yaw[0],
        tangent,
        np.column_stack([vx, vy, w]),
        np.column_stack([ax + w * vy, ay - w * vx, w1]),
        np.column_stack([ax, ay, zero]),
        np.column_stack([zero, zero, -one]),
        curvature,
        zero,
        np.column_stack([vx, vy, zero]),
        np.column_stack([zero, zero, w]),
        np.column_stack([zero, zero, w1]),
    )
