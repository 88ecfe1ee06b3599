"""LOC8, the robot of thesis 000, on four Mecanum-type wheels.

Sizes: R = 0.098 m follows from "3 km/h = 8.5 rad/s"; (l1 + l2)/R = 7.060 holds on all rows of Table
5.5, so l1 + l2 = 0.692 m. Its split into 0.376 and 0.316 m is inferred from the targets of Tables
6.1 and 6.6. Masses are the thesis's: frame 14.5 kg, each wheel 1.44 kg. The height of the centre of
gravity, the overhang and the yaw inertia are not printed: chosen, marked below.
"""

from __future__ import annotations

from trajopt.robots.platform import Platform, mecanum_platform

WHEEL_RADIUS = 0.098  # m, from 3 km/h = 8.5 rad/s (thesis 000, section 5.3)
HALF_WHEELBASE = 0.376  # m, inferred from Tables 6.1 and 6.6
HALF_TRACK = 0.316  # m, inferred; half_wheelbase + half_track = 7.060 R (Table 5.5)
FRAME_MASS = 14.5  # kg, thesis 000
WHEEL_MASS = 1.44  # kg, thesis 000
COG_HEIGHT = 0.12  # m, chosen: a little above the axles
OVERHANG = 0.10  # m, chosen: about one wheel radius beyond the axles


def loc8(cog_height: float = COG_HEIGHT) -> Platform:
    """LOC8 with its default sizes (see module docstring for sources). ``cog_height`` in m."""
    mass = FRAME_MASS + 4 * WHEEL_MASS
    frame = (
        FRAME_MASS * ((2 * HALF_WHEELBASE) ** 2 + (2 * HALF_TRACK) ** 2) / 12
    )  # uniform plate, chosen
    wheels = 4 * WHEEL_MASS * (HALF_WHEELBASE**2 + HALF_TRACK**2)
    return mecanum_platform(
        "loc8",
        half_wheelbase=HALF_WHEELBASE,
        half_track=HALF_TRACK,
        radius=WHEEL_RADIUS,
        mass=mass,
        yaw_inertia=frame + wheels,
        cog_height=cog_height,
        overhang=OVERHANG,
    )
