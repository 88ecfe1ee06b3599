"""PowerBot, the robot of thesis 004: two driven wheels in front, free casters behind.

The body origin is the middle of the drive axle on the ground, x forward. Mass, centre of gravity
and axle distances are the thesis's (sections 2.3.2, appendices 2 and 3). Outline and largest speeds
are those of the maker's own parameter set for this robot (ARIA, class ArRobotPowerBot); the
half-track follows from its DiffConvFactor. Wheel radius, the track of the casters and the yaw
inertia are not printed: chosen, so vary them.
"""

from __future__ import annotations

import math

from trajopt.robots.platform import Body, Platform, differential_platform

MASS = 148.0  # kg, with batteries (thesis 004, section 2.3.2.4)
COG_TO_DRIVE_AXLE = 0.132  # m, along the body (eq. 2.19)
COG_TO_CASTER_AXLE = 0.218  # m (eq. 2.19)
COG_HEIGHT = 0.215  # m (eq. A:3-10)
FRICTION = 0.332  # static, drive wheels on tiles (eq. A:2-6)
LARGEST_SPEED = 2.1  # m/s (eq. 2.6)
LARGEST_ACCELERATION = 0.55  # m/s^2 (eq. 2.7)
LARGEST_BRAKING = 7.8  # m/s^2, of the motors (eq. 2.8)
LARGEST_GRADE = math.radians(8.53)  # rad (section 2.3.2.4; 15 %)
SONAR_RANGE = 0.6  # m (section 3.6)
SCAN_TIME = 0.5  # s (section 2.3.2.6)
REACTION_TIME = 0.5  # s (section 2.3.2.6)
SAFETY_SPEED = 0.5  # m/s (eq. 2.27)
SAMPLE_TIME = 0.5  # s, best of Tables 1 and 2

FRONT = 0.369  # m, drive axle to the front end (ARIA, RobotLengthFront)
REAR = 0.542  # m, drive axle to the rear end (ARIA, RobotLengthRear)
WIDTH = 0.680  # m (ARIA, RobotWidth)
LARGEST_YAW_RATE = math.radians(360.0)  # rad/s (ARIA, AbsoluteMaxRVelocity)
HALF_TRACK = 0.268  # m, inferred: 1 / DiffConvFactor = 1 / 0.00373 per mm (ARIA)
WHEEL_RADIUS = 0.13  # m, chosen
CASTER_HALF_TRACK = 0.22  # m, chosen: inside the outline
CASTER_RADIUS = 0.07  # m, height of the caster's axle in appendix 3


def powerbot(
    cog_height: float = COG_HEIGHT,
    half_track: float = HALF_TRACK,
    caster_half_track: float = CASTER_HALF_TRACK,
) -> Platform:
    """PowerBot with its default sizes (see module docstring for sources); lengths in m.

    Contacts in the order drive left, drive right, caster left, caster right. Only the drive wheels
    pass traction; casters carry load. Wheel order of every per-wheel array: left, right.
    """
    casters = -(COG_TO_DRIVE_AXLE + COG_TO_CASTER_AXLE)
    yaw_inertia = MASS * ((FRONT + REAR) ** 2 + WIDTH**2) / 12  # kg m^2, uniform plate, chosen
    free = float("nan")  # plain tyres: no roller axis
    body = Body(
        MASS,
        yaw_inertia,
        (-COG_TO_DRIVE_AXLE, 0.0, cog_height),
        (
            (0.0, half_track),
            (0.0, -half_track),
            (casters, caster_half_track),
            (casters, -caster_half_track),
        ),
        (free,) * 4,
        (True, True, False, False),
    )
    side = WIDTH / 2
    outline = ((FRONT, side), (-REAR, side), (-REAR, -side), (FRONT, -side))
    return differential_platform(
        "powerbot", half_track=half_track, radius=WHEEL_RADIUS, body=body, footprint=outline
    )
