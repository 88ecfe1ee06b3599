"""LOC8 as the engines build it.

Sizes with the source "inferred" follow from printed numbers of the SMDW thesis; "chosen" ones are not
printed anywhere and should be varied.
"""

from __future__ import annotations

import math

from trajopt.simulate.engine import SimRobot
from trajopt.simulate.rollers import RollerWheel, Shape, mecanum_wheel

WHEEL_RADIUS = 0.098  # m, inferred: 3 km/h is printed as 8.5 rad/s
HALF_WHEELBASE = 0.376  # m, inferred: Table 5.5 gives (l1 + l2) / R = 7.060, Tables 6.1 and 6.6 the split
HALF_TRACK = 0.316  # m, inferred with the above
FRAME_MASS = 14.5  # kg, SMDW thesis section 5.1
WHEEL_MASS = 1.44  # kg with rollers, SMDW thesis section 5.1
TORQUE_LIMIT = 8.0  # N m at a wheel, chosen: it drives 5 cm climbs, which 4 N m does not
CHASSIS_SIZE = (0.60, 0.40, 0.10)  # m, chosen: fits between the wheels
CHASSIS_CLEARANCE = 0.085  # m, chosen: passes over a 5 cm step
COG_HEIGHT = 0.13  # m above the ground, chosen: inside the chassis box
ROLLER_ANGLE = math.radians(45.0)  # standard Mecanum roller


def wheel_places(
    half_wheelbase: float = HALF_WHEELBASE, half_track: float = HALF_TRACK
) -> tuple[tuple[float, float], ...]:
    """Wheel centres (x, y) [m]: front-left, front-right, rear-left, rear-right."""
    return (
        (half_wheelbase, half_track),
        (half_wheelbase, -half_track),
        (-half_wheelbase, half_track),
        (-half_wheelbase, -half_track),
    )


def loc8_on(
    wheels: tuple[RollerWheel, ...],
    *,
    name: str = "LOC8",
    half_wheelbase: float = HALF_WHEELBASE,
    half_track: float = HALF_TRACK,
    frame_mass: float = FRAME_MASS,
    cog_height: float = COG_HEIGHT,
    torque_limit: float = TORQUE_LIMIT,
) -> SimRobot:
    """The LOC8 chassis on any four roller wheels (front-left, front-right, rear-left, rear-right).

    Raises ArgumentError naming the size that makes no robot.
    """
    return SimRobot(
        name=name,
        chassis_mass=frame_mass,
        chassis_size=CHASSIS_SIZE,
        chassis_clearance=CHASSIS_CLEARANCE,
        cog_height=cog_height,
        wheel_positions=wheel_places(half_wheelbase, half_track),
        wheels=wheels,
        torque_limit=torque_limit,
    )


def loc8_mecanum(
    *,
    radius: float = WHEEL_RADIUS,
    shape: Shape = "spheres",
    rollers: int = 18,
    roller_radius: float = 0.0095,
    half_wheelbase: float = HALF_WHEELBASE,
    half_track: float = HALF_TRACK,
    frame_mass: float = FRAME_MASS,
    wheel_mass: float = WHEEL_MASS,
    cog_height: float = COG_HEIGHT,
    torque_limit: float = TORQUE_LIMIT,
) -> SimRobot:
    """LOC8 on four Mecanum wheels whose rollers stand at -45, +45, +45, -45 deg on the ground.

    Lengths [m], masses [kg], torque [N m]. Raises ArgumentError naming the size that makes no robot.
    """
    left, right = (
        mecanum_wheel(
            radius,
            rollers=rollers,
            roller_radius=roller_radius,
            angle=angle,
            shape=shape,
            mass=wheel_mass,
        )
        for angle in (-ROLLER_ANGLE, ROLLER_ANGLE)
    )
    return loc8_on(
        (left, right, right, left),
        name=f"LOC8 Mecanum ({shape})",
        half_wheelbase=half_wheelbase,
        half_track=half_track,
        frame_mass=frame_mass,
        cog_height=cog_height,
        torque_limit=torque_limit,
    )
