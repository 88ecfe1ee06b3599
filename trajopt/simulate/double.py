"""The double wheel as rollers: two hubs side by side on one axle, each a half circle and a half
ellipse, half a turn apart, so that on flat ground one half circle always carries.

At wheel angle 0 the outer hub has its ellipse down. On left and right wheels the hubs are mirrored,
so that this holds on both sides of a robot.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.robots.description import DoubleSection, RollerSection, WheelSection
from trajopt.simulate.rollers import Roller, Seat, place_roller, turned


def hub_support(radius: float, minor_radius: float, angle: ArrayLike) -> Array:
    """Distance (m) from the axle down to the lowest point of a hub turned by ``angle`` (rad) from
    ellipse-down."""
    a = np.asarray(angle, dtype=np.float64)
    ellipse = np.hypot(radius * np.sin(a), minor_radius * np.cos(a))
    return np.where(np.cos(a) >= 0, ellipse, radius)


def double_rollers(
    wheel: WheelSection, section: RollerSection, double: DoubleSection
) -> tuple[Roller, ...]:
    """Rollers of both hubs; those of the ellipse share its length evenly. Raises ArgumentError
    for rollers that do not fit."""

    def support(phi: Array) -> Array:
        return hub_support(wheel.radius, double.minor_radius, phi)

    pitch = math.pi / section.count
    first = math.pi / 2.0 + pitch / 2.0
    model = place_roller(
        Seat(first, (first - pitch / 2.0, first + pitch / 2.0)), support, section, section.radius
    )
    try:
        lower = [
            place_roller(seat, support, section, double.roller_radius)
            for seat in _ellipse_seats(wheel.radius, double)
        ]
    except ArgumentError as error:
        key = {"count": "double.rollers", "radius": "double.roller_radius"}[error.argument]
        raise ArgumentError(key, error.value, error.expected) from None
    hub = (*lower, *(turned(model, index * pitch) for index in range(section.count)))
    offset = (double.gap + double.depth) / 2.0  # of a hub's middle plane from the wheel's
    side = offset if double.outer == "left" else -offset
    return (
        *(_shifted(roller, side) for roller in hub),
        *(_shifted(turned(roller, math.pi), -side) for roller in hub),
    )


def _ellipse_seats(radius: float, double: DoubleSection) -> list[Seat]:
    """Equal shares of the ellipse's length, which grows by h + h'' = (Rc Re)^2 / h^3 a radian."""
    phi = np.linspace(-math.pi / 2.0, math.pi / 2.0, 20001)
    rate = (radius * double.minor_radius) ** 2 / hub_support(radius, double.minor_radius, phi) ** 3
    length = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(phi))])
    marks = np.interp(np.linspace(0.0, length[-1], 2 * double.rollers + 1), length, phi).tolist()
    return [Seat(marks[2 * i + 1], (marks[2 * i], marks[2 * i + 2])) for i in range(double.rollers)]


def _shifted(roller: Roller, offset: float) -> Roller:
    """The same roller, moved by ``offset`` [m] along the axle."""
    x, y, z = roller.centre
    return replace(roller, centre=(x, y + offset, z))
