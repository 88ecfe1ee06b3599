"""Active split offset casters [udengaard2008]: module kinematics, frames, geometric constraints.

A module turns by alpha about a vertical axis at the edge of the body; its axle trails the axis by
``offset`` and carries two driven wheels ``split`` apart, which may tilt by beta about the fore-aft
axis. alpha is the angle (rad, CCW, body frame) of the module's forward direction; wheel 1 stands on
its right (-y), wheel 2 on its left: so eq. 18 holds as printed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, require_positive
from trajopt.errors import ArgumentError
from trajopt.robots.robot import Robot, robot

_SHIPPED = robot("asoc-4").description  # whose sizes are [udengaard2008]'s, section 4.3
_WHEEL = _SHIPPED.wheels[0]
TOTAL_MASS = _SHIPPED.body.mass  # kg
BODY_LENGTH = 2 * _WHEEL.position[0]  # m
_LARGEST_TILT = np.radians(80.0)  # rad, of an axle about the fore-aft axis; chosen
LEAST_ROOT = (
    1e-12  # m^2, of wheel_radius^2 - offset^2; below, wheel and shaft cannot meet (section 3.1.2)
)


@dataclass(frozen=True)
class AsocGeometry:
    """Sizes of a robot on N modules, equally spaced on a circle, m. Defaults: [udengaard2008],
    section 4.3.

    ``module_radius``: distance of the module axes from the centre; half the body length (inferred).
    """

    modules: int = 4
    split: float = 2 * abs(_WHEEL.lateral)
    offset: float = _WHEEL.trail
    wheel_radius: float = _WHEEL.radius
    wheel_width: float = _WHEEL.width
    module_radius: float = BODY_LENGTH / 2

    def __post_init__(self) -> None:
        if self.modules < 2:
            raise ArgumentError(
                "modules", self.modules, "at least 2 modules: one alone cannot hold its heading"
            )
        for name in ("split", "offset", "wheel_radius", "wheel_width", "module_radius"):
            value = getattr(self, name)
            require_positive(name, value, "m")

    @property
    def angles(self) -> Array:
        """(N,): angles zeta_i of the module axes in the body frame, rad."""
        return 2 * np.pi * np.arange(self.modules) / self.modules

    @property
    def positions(self) -> Array:
        """(N, 2): module axes in the body frame, m."""
        return self.module_radius * np.column_stack([np.cos(self.angles), np.sin(self.angles)])

    @property
    def axis_distance(self) -> float:
        """Distance d_a of neighbouring module axes, m (section 3.1.1)."""
        return 2 * self.module_radius * float(np.sin(np.pi / self.modules))


def module_jacobian(alpha: Any, split: Any, offset: Any, tilt: Any = 0.0) -> Array:
    """(..., 2, 2): velocity of the module axis (body frame, m/s) = J @ (V_1, V_2), wheel speeds in
    m/s.

    Eq. 18, and with ``tilt`` beta (rad) the matrix of eq. 20: the split seen from above is split
    cos(beta).
    """
    alpha, ratio = np.broadcast_arrays(
        np.asarray(alpha, dtype=np.float64), offset / (split * np.cos(tilt))
    )
    c, s = np.cos(alpha), np.sin(alpha)
    return np.stack(
        [
            np.stack([c / 2 - ratio * s, c / 2 + ratio * s], -1),
            np.stack([s / 2 + ratio * c, s / 2 - ratio * c], -1),
        ],
        -2,
    )


def module_inverse(alpha: Any, split: Any, offset: Any, tilt: Any = 0.0) -> Array:
    """(..., 2, 2): inverse of ``module_jacobian`` in closed form (eqs. 19, 20); its determinant is
    -offset/(split cos(tilt)), so it always exists for tilts below 90 deg."""
    alpha, half = np.broadcast_arrays(
        np.asarray(alpha, dtype=np.float64), split * np.cos(tilt) / (2 * offset)
    )
    c, s = np.cos(alpha), np.sin(alpha)
    return np.stack(
        [np.stack([c - half * s, s + half * c], -1), np.stack([c + half * s, s - half * c], -1)], -2
    )


def link_velocities(positions: ArrayLike, twist: ArrayLike) -> Array:
    """(..., N, 2): velocities of the module axes in the body frame, eq. 17 with [-sin, cos] where
    the thesis prints [cos, sin]. ``positions`` (N, 2) m, ``twist`` (..., 3)."""
    p, v = (
        np.asarray(positions, dtype=np.float64),
        np.asarray(twist, dtype=np.float64)[..., None, :],
    )
    return np.stack([v[..., 0] - v[..., 2] * p[:, 1], v[..., 1] + v[..., 2] * p[:, 0]], -1)


def steering_rates(alpha: ArrayLike, links: ArrayLike, offset: float, yaw_rate: Any) -> Array:
    """(N,): alpha' (rad/s) of the modules: the axle does not slide sideways, so the module turns in
    the world at (sideways velocity)/offset. ``links`` (N, 2) as from ``link_velocities``."""
    a, v = np.asarray(alpha, dtype=np.float64), np.asarray(links, dtype=np.float64)
    return np.asarray((-np.sin(a) * v[..., 0] + np.cos(a) * v[..., 1]) / offset - yaw_rate)


def asoc_robot(geometry: AsocGeometry, alpha: ArrayLike | None = None) -> Robot:
    """The robot: per module two castor wheels that share a pivot, wheel 1 then wheel 2.

    ``alpha`` (N,): module angles, rad, 0 unless given; mobility.inverse_at takes others (beta of a
    wheel is alpha + pi/2 - zeta). What the geometry leaves open is as in the shipped robot; wheels
    weigh as their volume, and the yaw inertia is that of a uniform disc (chosen).
    """
    angles = np.zeros(geometry.modules) if alpha is None else np.asarray(alpha, dtype=np.float64)
    if angles.shape != (geometry.modules,) or not np.all(np.isfinite(angles)):
        raise ArgumentError(
            "alpha", angles.tolist(), f"{geometry.modules} finite angles, one a module, rad"
        )
    tables = _SHIPPED.model_dump(exclude_none=True)
    wheel, pivot, motor = (tables[name][0] for name in ("wheels", "pivots", "motors"))
    volume = geometry.wheel_radius**2 * geometry.wheel_width / (_WHEEL.radius**2 * _WHEEL.width)
    tilt = min(
        float(largest_pivot(geometry.offset, geometry.split, geometry.wheel_radius)), _LARGEST_TILT
    )
    size = {
        "radius": geometry.wheel_radius,
        "width": geometry.wheel_width,
        "trail": geometry.offset,
        "mass": _WHEEL.mass * volume,
    }
    modules = [f"module-{i + 1}" for i in range(geometry.modules)]
    wheels = [
        wheel
        | size
        | {"name": f"{name}-{side}", "position": place.tolist(), "angle": float(angle)}
        | {"lateral": sign * geometry.split / 2}
        for name, place, angle in zip(modules, geometry.positions, angles, strict=True)
        for side, sign in (("right", -1), ("left", 1))
    ]
    pairs = {name: [f"{name}-right", f"{name}-left"] for name in modules}
    outer = (geometry.module_radius + workspace_radius(geometry)) / np.cos(np.pi / 12)
    corners = np.pi / 6 * np.arange(12)  # a 12-gon around the reach of the wheels
    body = {
        "yaw_inertia": TOTAL_MASS * geometry.module_radius**2 / 2,
        "footprint": (outer * np.column_stack([np.cos(corners), np.sin(corners)])).tolist(),
    }
    return Robot.of(
        {
            "name": f"asoc-{geometry.modules}",
            "about": tables["about"],
            "sharing": tables["sharing"],
            "body": tables["body"] | body,
            "wheels": wheels,
            "pivots": [
                pivot | {"name": name, "wheels": pair, "tilt_range": tilt}
                for name, pair in pairs.items()
            ],
            "motors": [
                motor | {"name": name, "wheels": [name]} for pair in pairs.values() for name in pair
            ],
        }
    )


def wheel_steering(geometry: AsocGeometry, alpha: ArrayLike) -> Array:
    """(2 N,): the wheels' ``beta`` (mobility.inverse_at's steering) at module angles (N,), rad."""
    return np.repeat(np.asarray(alpha, dtype=np.float64) + np.pi / 2 - geometry.angles, 2)


def wheel_positions(geometry: AsocGeometry, alpha: ArrayLike) -> Array:
    """(..., N, 2, 2): wheel centres seen from above, body frame, m; wheel 1 then 2. ``alpha`` (...,
    N), rad."""
    a = np.asarray(alpha, dtype=np.float64)
    ahead = np.stack([np.cos(a), np.sin(a)], -1)
    left = np.stack([-np.sin(a), np.cos(a)], -1)
    axle = geometry.positions - geometry.offset * ahead
    half = geometry.split / 2
    return np.stack([axle - half * left, axle + half * left], -2)


def workspace_radius(geometry: AsocGeometry) -> float:
    """Radius of the circle that a module's wheels sweep, m (eq. 5)."""
    return float(
        envelope(geometry.offset, geometry.split, geometry.wheel_radius, geometry.wheel_width)
    )


def envelope(offset: Any, split: Any, radius: Any, width: Any) -> Any:
    """Eq. 5 on numbers, arrays or symbols, m."""
    return np.sqrt((offset + radius) ** 2 + (0.5 * split + width) ** 2)


def largest_pivot(offset: Any, split: Any, radius: Any) -> Any:
    """Pivot angle (rad) at which wheel and shaft meet, eqs. 6-8, on numbers or arrays; pi/2 where
    offset >= radius, since wheel and shaft cannot meet then. Eq. 7 is sqrt(radius^2 - offset^2)."""
    square = np.asarray(radius, dtype=np.float64) ** 2 - np.asarray(offset, dtype=np.float64) ** 2
    root = np.sqrt(np.maximum(square, LEAST_ROOT))
    return np.where(square > LEAST_ROOT, np.arctan2(0.5 * np.asarray(split), root), np.pi / 2)
