"""Wheels on a body: the only kinematics in the package.

From the rolling and sliding rows of its wheels a platform gets its inverse kinematics (body twist
-> wheel rates) and its forward kinematics (wheel rates -> body twist, least squares). Body data
(mass, centre of gravity, contact points) sit beside it for the limits that need forces.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.robots.wheel import Wheel, WheelKind, fixed_wheel, swedish_wheel

STANDARD_GRAVITY = 9.80665  # m/s^2, ISO 80000-3


@dataclass(frozen=True)
class Body:
    """Rigid body data for slip and tip limits, SI units.

    ``contacts`` (C, 2) are the points on the ground that carry load, in the body frame (m); ``cog``
    is the centre of gravity (x, y, height) in the same frame. ``roller_axis`` (C,) is the angle
    (rad, body frame) of the ground roller's axis at each contact, NaN where the tyre transmits
    force in every direction. ``driven`` (C,) says which contacts transmit traction at all (a free
    castor carries load only).
    """

    mass: float
    yaw_inertia: float
    cog: tuple[float, float, float]
    contacts: tuple[tuple[float, float], ...]
    roller_axis: tuple[float, ...]
    driven: tuple[bool, ...]

    def __post_init__(self) -> None:
        for name in ("mass", "yaw_inertia"):
            if not getattr(self, name) > 0:
                raise ArgumentError(name, getattr(self, name), "a value > 0")
        if not self.cog[2] >= 0:
            raise ArgumentError("cog", self.cog, "a height of the centre of gravity >= 0 m")
        if not len(self.contacts) == len(self.roller_axis) == len(self.driven):
            raise ArgumentError(
                "contacts", self.contacts, "as many contacts as roller_axis and driven"
            )


@dataclass(frozen=True)
class Platform:
    """A body on wheels. ``wheels`` are the driven ones, in the order of every per-wheel array.

    ``turning_length`` (m) weighs yaw against translation in the path parameter of robots that can
    turn on the spot (sqrt(dx^2 + dy^2 + (L dpsi)^2)); it is the distance of the wheels from the
    body origin. ``footprint`` (K, 2): corners of the outline in the body frame, counter-clockwise,
    m.
    """

    name: str
    wheels: tuple[Wheel, ...]
    body: Body
    footprint: tuple[tuple[float, float], ...]
    holonomic: bool

    @cached_property
    def inverse(self) -> Array:
        """(W, 3): wheel rates (rad/s) = inverse @ (vx, vy, wz), from the rolling rows (003).

        Steered wheels and castors stand at their own ``beta``; mobility.inverse_at takes other
        angles.
        """
        rows = [w.driving() for w in self.wheels]
        matrix = np.array(
            [[r.x / r.spin, r.y / r.spin, r.yaw / r.spin] for r in rows], dtype=np.float64
        )
        matrix[np.abs(matrix) < 1e-12 * np.abs(matrix).max()] = 0.0
        return matrix

    @cached_property
    def forward(self) -> Array:
        """(3, W): body twist = forward @ wheel rates; exact when wheels agree, least squares
        otherwise.

        The constrained directions (sliding rows of wheels that may not slide) are imposed exactly.
        """
        allowed = self.admissible
        return np.asarray(allowed @ np.linalg.pinv(self.inverse @ allowed), dtype=np.float64)

    @cached_property
    def admissible(self) -> Array:
        """(3, m): orthonormal basis of the body twists that no sliding row forbids (m =
        mobility)."""
        rows = [w.sliding() for w in self.wheels]
        constraints = np.array(
            [[r.x, r.y, r.yaw] for r in rows if not r.free and r.steer == 0], dtype=np.float64
        )  # a castor gives way by steering
        if constraints.size == 0:
            return np.eye(3)
        _, singular, vt = np.linalg.svd(constraints)
        rank = int(np.sum(singular > 1e-9 * singular.max()))
        return np.asarray(vt[rank:].T, dtype=np.float64)

    @cached_property
    def turning_length(self) -> float:
        return float(max(w.l for w in self.wheels))


def mecanum_platform(
    name: str,
    *,
    half_wheelbase: float,
    half_track: float,
    radius: float,
    mass: float,
    yaw_inertia: float,
    cog_height: float,
    overhang: float,
) -> Platform:
    """Four Mecanum wheels (45 deg rollers), order front-left, front-right, rear-left, rear-right.

    Lengths m, mass kg, inertia kg m^2. ``overhang`` is how far the footprint reaches beyond the
    wheel centres. Each wheel's contact force acts along the axis of the roller that touches the
    ground.
    """
    corners = [
        (half_wheelbase, half_track),
        (half_wheelbase, -half_track),
        (-half_wheelbase, half_track),
        (-half_wheelbase, -half_track),
    ]
    gammas = [-np.pi / 4, np.pi / 4, np.pi / 4, -np.pi / 4]
    wheels = tuple(
        swedish_wheel(x, y, radius, g) for (x, y), g in zip(corners, gammas, strict=True)
    )
    # The rolling row holds the contact still along the direction (cos(gamma), sin(gamma)): the
    # roller's axis.
    body = Body(
        mass, yaw_inertia, (0.0, 0.0, cog_height), tuple(corners), tuple(gammas), (True,) * 4
    )
    ex, ey = half_wheelbase + overhang, half_track + overhang
    footprint = ((ex, ey), (-ex, ey), (-ex, -ey), (ex, -ey))
    return Platform(name, wheels, body, footprint, holonomic=True)


def differential_platform(
    name: str,
    *,
    half_track: float,
    radius: float,
    body: Body,
    footprint: tuple[tuple[float, float], ...],
) -> Platform:
    """Two fixed wheels, left and right, on the y axis: r phi' = v -+ half_track wz (003)."""
    wheels = (fixed_wheel(0.0, half_track, radius), fixed_wheel(0.0, -half_track, radius))
    return Platform(name, wheels, body, footprint, holonomic=False)


def is_swedish(platform: Platform) -> bool:
    """Whether every wheel of the platform is a Swedish wheel."""
    return all(w.kind is WheelKind.SWEDISH for w in platform.wheels)
