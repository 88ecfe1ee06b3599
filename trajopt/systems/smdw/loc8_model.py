"""LOC8 as the engines build it: sizes and masses of robots/loc8.py, and what only physics needs.

Variants with another mass or wheel place: ``dataclasses.replace`` on the SimRobot.
"""

from __future__ import annotations

import math

from trajopt.robots.loc8 import FRAME_MASS, HALF_TRACK, HALF_WHEELBASE, WHEEL_MASS, WHEEL_RADIUS
from trajopt.simulate.engine import SimRobot
from trajopt.simulate.rollers import RollerWheel, Shape, mecanum_wheel

TORQUE_LIMIT = 8.0  # N m at a wheel, chosen: it drives 5 cm climbs, which 4 N m does not
CHASSIS_SIZE = (0.60, 0.40, 0.10)  # m, chosen: fits between the wheels
CHASSIS_CLEARANCE = 0.085  # m, chosen: passes over a 5 cm step
# m above the ground, of the chassis without wheels, chosen: inside the chassis box; with the wheels
# 0.121 m, the whole robot's 0.12 m of robots/loc8.py
CHASSIS_COG_HEIGHT = 0.13
ROLLER_ANGLE = math.radians(45.0)  # standard Mecanum roller
MECANUM_ROLLERS = 18  # a wheel, chosen: Bullet's joint limit allows 29
MECANUM_ROLLER_RADIUS = 0.0095  # m, SMDW thesis section 5.3.2 (19 mm diameter)
# Axis of the roller on the ground (rad, from x towards y): front-left, front-right, rear-left,
# rear-right.
ROLLER_ANGLES = (-ROLLER_ANGLE, ROLLER_ANGLE, ROLLER_ANGLE, -ROLLER_ANGLE)
WHEEL_PLACES = tuple(
    (x, y) for x in (HALF_WHEELBASE, -HALF_WHEELBASE) for y in (HALF_TRACK, -HALF_TRACK)
)  # m


def loc8_on(
    wheels: tuple[RollerWheel, ...], *, name: str = "LOC8", torque_limit: float = TORQUE_LIMIT
) -> SimRobot:
    """The LOC8 chassis on any four roller wheels (front-left, front-right, rear-left, rear-right).

    Raises ArgumentError for another number of wheels or a torque limit (N m) that is not positive.
    """
    return SimRobot(
        name=name,
        chassis_mass=FRAME_MASS,
        chassis_size=CHASSIS_SIZE,
        chassis_clearance=CHASSIS_CLEARANCE,
        cog_height=CHASSIS_COG_HEIGHT,
        wheel_positions=WHEEL_PLACES,
        wheels=wheels,
        torque_limit=torque_limit,
    )


def loc8_mecanum(
    *,
    radius: float = WHEEL_RADIUS,
    shape: Shape = "spheres",
    rollers: int = MECANUM_ROLLERS,
    roller_radius: float = MECANUM_ROLLER_RADIUS,
    torque_limit: float = TORQUE_LIMIT,
) -> SimRobot:
    """LOC8 on four Mecanum wheels whose rollers stand at -45, +45, +45, -45 deg on the ground.

    Lengths [m], torque [N m]. Raises ArgumentError naming the size that makes no robot.
    """
    left, right = (
        mecanum_wheel(
            radius,
            rollers=rollers,
            roller_radius=roller_radius,
            angle=angle,
            shape=shape,
            mass=WHEEL_MASS,
        )
        for angle in ROLLER_ANGLES[:2]
    )
    return loc8_on(
        (left, right, right, left), name=f"LOC8 Mecanum ({shape})", torque_limit=torque_limit
    )
