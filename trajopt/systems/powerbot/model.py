"""PowerBot as a physics engine builds it: two driven wheels and two free casters.

Wheels touch the floor with one point each (spheres as collision shapes), as the limits assume.
Casters are balls without friction: they carry load and nothing else, which is what thesis 004
assumes of free-rolling casters; their swivel is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from trajopt.errors import ArgumentError
from trajopt.robots.platform import Platform
from trajopt.robots.powerbot import CASTER_RADIUS, WHEEL_RADIUS, powerbot

WHEEL_MASS = 4.0  # kg, chosen
CASTER_MASS = 1.0  # kg, chosen
WHEEL_WIDTH = 0.08  # m, chosen; for inertia and pictures
TORQUE_LIMIT = 120.0  # N m at a wheel, chosen: above what friction 0.332 passes on (31 N m)
CHASSIS_HEIGHT = 0.30  # m, chosen
CHASSIS_CLEARANCE = 0.10  # m, chosen


@dataclass(frozen=True)
class DriveRobot:
    """What the engine needs of a differential drive with two casters behind; SI units, body
    frame."""

    platform: Platform
    torque_limit: float = TORQUE_LIMIT
    wheel_mass: float = WHEEL_MASS
    caster_mass: float = CASTER_MASS

    def __post_init__(self) -> None:
        if len(self.platform.wheels) != 2 or len(self.platform.body.contacts) != 4:
            raise ArgumentError("platform", self.platform.name, "two driven wheels and two casters")
        if not self.chassis_mass > 0:
            raise ArgumentError(
                "wheel_mass", self.wheel_mass, "wheels and casters lighter than the robot"
            )

    @property
    def chassis_mass(self) -> float:
        """kg, without wheels and casters."""
        return self.platform.body.mass - 2 * self.wheel_mass - 2 * self.caster_mass

    @property
    def chassis_cog(self) -> tuple[float, float, float]:
        """Of the chassis alone, so that the whole robot has the platform's, m."""
        body, m = self.platform.body, self.chassis_mass
        casters = body.contacts[2][0]
        x = (body.mass * body.cog[0] - 2 * self.caster_mass * casters) / m
        z = (
            body.mass * body.cog[2]
            - 2 * self.wheel_mass * self.radius
            - 2 * self.caster_mass * CASTER_RADIUS
        ) / m
        return x, 0.0, z

    @property
    def radius(self) -> float:
        """Of the drive wheels, m."""
        return self.platform.wheels[0].radius


def powerbot_drive(platform: Platform | None = None) -> DriveRobot:
    """PowerBot with default sizes, or another platform of the same layout."""
    return DriveRobot(powerbot() if platform is None else platform)


def drive_urdf(robot: DriveRobot) -> str:
    """URDF whose base frame is the chassis' centre of gravity; joints wheel_left, wheel_right,
    caster_*."""
    cog, body = robot.chassis_cog, robot.platform.body
    xs = [corner[0] for corner in robot.platform.footprint]
    ys = [corner[1] for corner in robot.platform.footprint]
    length, width = max(xs) - min(xs), max(ys) - min(ys)
    yaw = max(body.yaw_inertia - 2 * robot.wheel_mass * body.contacts[0][1] ** 2, 1.0)
    pitch = robot.chassis_mass * (length**2 + CHASSIS_HEIGHT**2) / 12
    roll = robot.chassis_mass * (width**2 + CHASSIS_HEIGHT**2) / 12
    middle = (
        (max(xs) + min(xs)) / 2 - cog[0],
        0.0,
        CHASSIS_CLEARANCE + CHASSIS_HEIGHT / 2 - cog[2],
    )
    box = f'<origin xyz="{_text(middle)}"/><geometry><box size="{length} {width} {CHASSIS_HEIGHT}"/></geometry>'
    parts = [
        '<?xml version="1.0"?>\n<robot name="drive">\n',
        f'<link name="chassis">{_inertial(robot.chassis_mass, (roll, pitch, yaw))}'
        f"<collision>{box}</collision><visual>{box}</visual></link>\n",
    ]
    spin = robot.wheel_mass * WHEEL_RADIUS**2 / 2
    across = robot.wheel_mass * (3 * WHEEL_RADIUS**2 + WHEEL_WIDTH**2) / 12
    names = ("wheel_left", "wheel_right", "caster_left", "caster_right")
    for i, (name, (x, y)) in enumerate(zip(names, body.contacts, strict=True)):
        wheel = i < 2
        radius = robot.radius if wheel else CASTER_RADIUS
        mass = robot.wheel_mass if wheel else robot.caster_mass
        moments = (across, spin, across) if wheel else (0.4 * mass * radius**2,) * 3
        place = (x - cog[0], y - cog[1], radius - cog[2])
        shape = f'<geometry><sphere radius="{radius}"/></geometry>'
        seen = (
            (
                f'<origin rpy="{math.pi / 2} 0 0"/><geometry><cylinder radius="{radius}" length="{WHEEL_WIDTH}"/>'
                "</geometry>"
            )
            if wheel
            else shape
        )
        parts.append(
            f'<link name="{name}_link">{_inertial(mass, moments)}<collision>{shape}</collision>'
            f"<visual>{seen}</visual></link>\n"
        )
        kind = "continuous" if wheel else "fixed"
        parts.append(
            f'<joint name="{name}" type="{kind}"><parent link="chassis"/><child link="{name}_link"/>'
            f'<origin xyz="{_text(place)}"/><axis xyz="0 1 0"/></joint>\n'
        )
    return "".join([*parts, "</robot>\n"])


def _inertial(mass: float, moments: tuple[float, float, float]) -> str:
    x, y, z = moments
    return (
        f'<inertial><mass value="{mass}"/><inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/>'
        "</inertial>"
    )


def _text(values: tuple[float, float, float]) -> str:
    return " ".join(repr(float(v)) for v in values)
