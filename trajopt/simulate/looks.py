"""What pictures show beside wheels and chassis: mounts, forks and axles. They touch nothing and weigh nothing."""

from __future__ import annotations

import math

from trajopt.robots.description import BodySection, RobotDescription, WheelSection
from trajopt.simulate.model import Pose, Shape, Vector, cylinder

THICK = 0.09  # radius of a rod over the wheel's, chosen
CROWN = 1.15  # height of a fork's crown above the axle over the wheel's radius, chosen
ASIDE = 0.72  # of a wheel's width, from its middle to a leg of its fork, chosen
INSIDE = 0.9  # of the chassis' half extents, where a mount ends, chosen


def rod(start: Vector, end: Vector, radius: float) -> Shape:
    """A round bar between two places."""
    way = (end[0] - start[0], end[1] - start[1], end[2] - start[2])
    middle = ((start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0, (start[2] + end[2]) / 2.0)
    return cylinder(radius, math.hypot(*way), Pose.along(way, middle))


def mounts(robot: RobotDescription) -> tuple[Shape, ...]:
    """Bars from the chassis to its wheels: to the axle, or to the crown of what swivels and steers."""
    shapes = []
    for wheel in robot.wheels:
        if wheel.kind == "spherical":
            continue
        (x, y), height = wheel.position, wheel.radius
        turning = wheel.kind in ("steered", "castor")
        if turning:
            crown = (1.0 + CROWN) * wheel.radius
            height = max(crown, robot.body.clearance + 0.5 * robot.body.chassis[2])
            if height - crown > 1e-3:
                shapes.append(rod((x, y, crown), (x, y, height), THICK * wheel.radius))
        inside = _in_chassis(robot.body, x, y)
        if math.dist(inside, (x, y)) > 1e-3:
            shapes.append(rod((x, y, height), (*inside, height), THICK * wheel.radius))
    return tuple(shapes)


def fork(wheel: WheelSection) -> tuple[Shape, ...]:
    """From the pin above a wheel to both ends of its axle, in the frame that steers or swivels."""
    thick, crown, aside = THICK * wheel.radius, CROWN * wheel.radius, ASIDE * wheel.width
    left, right = wheel.lateral + aside, wheel.lateral - aside
    legs = [
        rod((-0.4 * wheel.trail, side, crown), (-wheel.trail, side, 0.0), 0.7 * thick)
        for side in (left, right)
    ]
    across = rod((-0.4 * wheel.trail, left, crown), (-0.4 * wheel.trail, right, crown), 0.7 * thick)
    arm = rod((thick, 0.0, crown), (-0.4 * wheel.trail - thick, 0.0, crown), thick)
    return (*legs, across, arm)


def axle(radius: float, half: float, trail: float) -> tuple[Shape, ...]:
    """From the pin above two wheels to the axle between them, in the axle's frame."""
    thick = THICK * radius
    return (
        rod((0.0, -half, 0.0), (0.0, half, 0.0), thick),
        rod((0.0, 0.0, 0.0), (trail, 0.0, CROWN * radius), thick),
    )


def plate(radius: float, width: float) -> tuple[Shape, ...]:
    """A wheel's disc between its rollers, and a bar across it that shows how it has turned."""
    disc = cylinder(radius, 0.3 * width, Pose.along((0.0, 1.0, 0.0)))
    return disc, Shape("box", (0.08 * radius, 0.17 * width, 0.9 * radius))


def _in_chassis(body: BodySection, x: float, y: float) -> tuple[float, float]:
    """The place inside the chassis nearest to one in the ground plan."""
    (px, py), (length, width, _) = body.chassis_place, body.chassis
    reach = (INSIDE * length / 2.0, INSIDE * width / 2.0)
    return (
        min(max(x, px - reach[0]), px + reach[0]),
        min(max(y, py - reach[1]), py + reach[1]),
    )
