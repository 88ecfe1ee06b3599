"""The semi-circular Mecanum double wheel (SMDW) as rollers: two hubs, half circle and half ellipse.

SMDW thesis, section 4.1: each hub's outline is a half circle of radius Rc joined to a half ellipse
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
from trajopt.robots.loc8 import WHEEL_MASS
from trajopt.simulate.engine import SimRobot
from trajopt.simulate.rollers import (
    ROLLER_MASS,
    Roller,
    RollerWheel,
    Seat,
    Shape,
    place_roller,
    reach_along_axle,
    require_wheel,
    turned,
)
from trajopt.systems.smdw.climbing import DEFAULT_WHEEL
from trajopt.systems.smdw.geometry import DoubleWheel, support_down
from trajopt.systems.smdw.loc8_model import ROLLER_ANGLE, ROLLER_ANGLES, TORQUE_LIMIT, loc8_on

CIRCLE_ROLLER_RADIUS = 0.0095  # m, SMDW thesis section 5.3.2 (19 mm diameter)
ELLIPSE_ROLLER_RADIUS = 0.0125  # m, SMDW thesis section 5.3.2 (25 mm diameter)
CIRCLE_ROLLERS = 8  # a hub, chosen with the next so that 4 wheels stay below Bullet's joint limit
ELLIPSE_ROLLERS = 6  # a hub, chosen


def smdw_wheel(
    sizes: DoubleWheel = DEFAULT_WHEEL,
    *,
    angle: float = -ROLLER_ANGLE,
    outer_left: bool = True,
    shape: Shape = "spheres",
    spheres: int = 7,
    circle_rollers: int = CIRCLE_ROLLERS,
    ellipse_rollers: int = ELLIPSE_ROLLERS,
    circle_roller_radius: float = CIRCLE_ROLLER_RADIUS,
    ellipse_roller_radius: float = ELLIPSE_ROLLER_RADIUS,
    mass: float = WHEEL_MASS,
    roller_mass: float = ROLLER_MASS,
) -> RollerWheel:
    """SMDW wheel; ``outer_left`` says that the hub with its ellipse down at angle 0 sits at +y.

    ``angle`` [rad] is the axis of the roller on the ground, from x towards y. Lengths [m], masses
    [kg]. The rollers of the ellipse share its length evenly. Raises ArgumentError naming the size
    that cannot be built.
    """
    if circle_rollers < 2 or ellipse_rollers < 2:
        raise ArgumentError(
            "rollers", (circle_rollers, ellipse_rollers), "at least 2 on each half of a hub"
        )
    hub_mass = mass - 2 * (circle_rollers + ellipse_rollers) * roller_mass
    for radius in (circle_roller_radius, ellipse_roller_radius):
        require_wheel(sizes.radius, radius, angle, hub_mass, roller_mass)

    def support(phi: Array) -> Array:
        return support_down(sizes, phi)

    pitch = math.pi / circle_rollers
    first = math.pi / 2.0 + pitch / 2.0
    around = Seat(first, (first - pitch / 2.0, first + pitch / 2.0), circle_roller_radius, angle)
    model = place_roller(around, support, shape=shape, spheres=spheres)
    seats = _ellipse_seats(sizes, ellipse_rollers, ellipse_roller_radius, angle)
    hub = (
        *(place_roller(seat, support, shape=shape, spheres=spheres) for seat in seats),
        *(turned(model, index * pitch) for index in range(circle_rollers)),
    )
    offset = (sizes.gap + sizes.depth) / 2.0  # of a hub's middle plane from the wheel's
    side = offset if outer_left else -offset
    outer = tuple(shifted(roller, side) for roller in hub)
    inner = tuple(shifted(turned(roller, math.pi), -side) for roller in hub)
    width = 2.0 * reach_along_axle(outer + inner)
    return RollerWheel(sizes.radius, width, angle, outer + inner, hub_mass, roller_mass)


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


def loc8_smdw(
    sizes: DoubleWheel = DEFAULT_WHEEL,
    *,
    shape: Shape = "spheres",
    spheres: int = 7,
    torque_limit: float = TORQUE_LIMIT,
) -> SimRobot:
    """LOC8 on four SMDW wheels whose rollers stand at -45, +45, +45, -45 deg on the ground.

    ``spheres`` a roller, torque [N m]. Raises ArgumentError naming the size that makes no robot.
    """
    wheels = tuple(
        smdw_wheel(sizes, angle=angle, outer_left=left, shape=shape, spheres=spheres)
        for angle, left in zip(ROLLER_ANGLES, (True, False, True, False), strict=True)
    )
    return loc8_on(wheels, name=f"LOC8 SMDW ({shape})", torque_limit=torque_limit)
