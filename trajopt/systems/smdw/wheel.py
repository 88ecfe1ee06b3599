"""The semi-circular Mecanum double wheel (SMDW) as rollers: two hubs, half circle and half ellipse.

[guzman2015], section 4.1: each hub's outline is a half circle of radius Rc joined to a half ellipse
of half-axes Rc and Re; the hubs sit side by side on one axle, half a turn apart, so that on flat
ground one half circle always carries. At wheel angle 0 the outer hub has its ellipse down (the
neutral position of Figure 4.3, largest clearance for lateral motion). The hubs of left and right
wheels are mirrored (section 2.3.2), so this holds on both sides of the robot.
"""

from __future__ import annotations

import math

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.robots.description import WheelSection
from trajopt.simulate.rollers import (
    Roller,
    RollerWheel,
    Seat,
    place_roller,
    reach_along_axle,
    require_wheel,
    turned,
)
from trajopt.systems.smdw.geometry import DoubleWheel, support_down


def smdw_wheel(wheel: WheelSection) -> RollerWheel:
    """The described double wheel; its ``outer`` side is where the hub sits whose ellipse is down at
    angle 0. The rollers of the ellipse share its length evenly. Raises ArgumentError naming the
    size that cannot be built.
    """
    sizes, rollers, double = DoubleWheel.of(wheel), wheel.rollers, wheel.double
    if rollers is None or double is None:
        raise ArgumentError("wheel.double", None, "a double wheel")
    hub_mass = wheel.mass - 2 * (rollers.count + double.rollers) * rollers.mass
    for radius in (rollers.radius, double.roller_radius):
        require_wheel(sizes.radius, radius, rollers.angle, hub_mass, rollers.mass)

    def support(phi: Array) -> Array:
        return support_down(sizes, phi)

    def placed(seat: Seat) -> Roller:
        return place_roller(seat, support, shape=rollers.shape, spheres=rollers.spheres)

    pitch = math.pi / rollers.count
    first = math.pi / 2.0 + pitch / 2.0
    sector = (first - pitch / 2.0, first + pitch / 2.0)
    model = placed(Seat(first, sector, rollers.radius, rollers.angle))
    seats = _ellipse_seats(sizes, double.rollers, double.roller_radius, rollers.angle)
    hub = (
        *(placed(seat) for seat in seats),
        *(turned(model, index * pitch) for index in range(rollers.count)),
    )
    offset = (sizes.gap + sizes.depth) / 2.0  # of a hub's middle plane from the wheel's
    side = offset if double.outer == "left" else -offset
    outer = tuple(shifted(roller, side) for roller in hub)
    inner = tuple(shifted(turned(roller, math.pi), -side) for roller in hub)
    width = 2.0 * reach_along_axle(outer + inner)
    return RollerWheel(sizes.radius, width, rollers.angle, outer + inner, hub_mass, rollers.mass)


def _ellipse_seats(sizes: DoubleWheel, count: int, radius: float, angle: float) -> list[Seat]:
    """Equal shares of the ellipse's length, which grows by h + h'' = (Rc Re)^2 / h^3 a radian."""
    phi = np.linspace(-math.pi / 2.0, math.pi / 2.0, 20001)
    rate = (sizes.radius * sizes.minor_radius) ** 2 / support_down(sizes, phi) ** 3
    length = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(phi))])
    marks = np.interp(np.linspace(0.0, length[-1], 2 * count + 1), length, phi)
    return [
        Seat(float(marks[2 * i + 1]), (float(marks[2 * i]), float(marks[2 * i + 2])), radius, angle)
        for i in range(count)
    ]


def shifted(roller: Roller, offset: float) -> Roller:
    """The same roller, moved by ``offset`` [m] along the axle."""
    x, y, z = roller.centre
    return Roller((x, y + offset, z), roller.axis, roller.profile)
