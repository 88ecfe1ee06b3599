"""PowerBot as a physics engine builds it: two driven wheels and two free castors.

Wheels touch the floor with one point each (spheres as collision shapes), as the limits assume.
Castors are balls without friction: they carry load and nothing else, which is what [waheed2006]
assumes of free-rolling castors; their swivel is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from trajopt.errors import ArgumentError
from trajopt.robots.robot import Robot, robot


@dataclass(frozen=True)
class DriveRobot:
    """What the engine needs of a differential drive with two castors behind; SI units, body frame.
    Wheels in the order drive left, drive right, castor left, castor right."""

    platform: Robot

    def __post_init__(self) -> None:
        kinds = [wheel.kind for wheel in self.platform.description.wheels]
        if kinds != ["fixed", "fixed", "castor", "castor"]:
            raise ArgumentError("platform", self.platform.name, "two driven wheels and two castors")

    @property
    def chassis_mass(self) -> float:
        """kg, without wheels and castors."""
        found = self.platform.description
        return found.body.mass - sum(wheel.mass for wheel in found.wheels)

    @property
    def chassis_cog(self) -> tuple[float, float, float]:
        """Of the chassis alone, so that the whole robot has the described one, m."""
        found, m = self.platform.description, self.chassis_mass
        x = found.body.mass * found.body.cog[0] - sum(w.mass * w.contact[0] for w in found.wheels)
        z = found.body.mass * found.body.cog[2] - sum(w.mass * w.radius for w in found.wheels)
        return x / m, 0.0, z / m

    @property
    def radius(self) -> float:
        """Of the drive wheels, m."""
        return self.platform.wheels[0].radius

    @property
    def torque_limit(self) -> float:
        """Of the drive wheels, N m."""
        return float(self.platform.motor_array("torque")[0])


def powerbot_drive(platform: Robot | None = None) -> DriveRobot:
    """PowerBot as shipped, or another robot of the same layout."""
    return DriveRobot(robot("powerbot") if platform is None else platform)


def drive_urdf(robot: DriveRobot) -> str:
    """URDF whose base frame is the chassis' centre of gravity; joints wheel_left, wheel_right,
    caster_*."""
    cog, section = robot.chassis_cog, robot.platform.description.body
    wheels = robot.platform.description.wheels
    drives = sum(w.mass * w.position[1] ** 2 for w in wheels[:2])
    yaw = max(robot.platform.body.yaw_inertia - drives, 1.0)
    length, width, height = section.chassis
    pitch = robot.chassis_mass * (length**2 + height**2) / 12
    roll = robot.chassis_mass * (width**2 + height**2) / 12
    x, y = section.chassis_place
    middle = (x - cog[0], y - cog[1], section.clearance + height / 2 - cog[2])
    box = f'<origin xyz="{_text(middle)}"/><geometry><box size="{length} {width} {height}"/></geometry>'
    parts = [
        '<?xml version="1.0"?>\n<robot name="drive">\n',
        f'<link name="chassis">{_inertial(robot.chassis_mass, (roll, pitch, yaw))}'
        f"<collision>{box}</collision><visual>{box}</visual></link>\n",
    ]
    names = ("wheel_left", "wheel_right", "caster_left", "caster_right")
    for name, wheel in zip(names, wheels, strict=True):
        drives_on = wheel.kind == "fixed"
        radius, mass = wheel.radius, wheel.mass
        spin = mass * radius**2 / 2
        across = mass * (3 * radius**2 + wheel.width**2) / 12
        moments = (across, spin, across) if drives_on else (0.4 * mass * radius**2,) * 3
        place = (wheel.contact[0] - cog[0], wheel.contact[1] - cog[1], radius - cog[2])
        shape = f'<geometry><sphere radius="{radius}"/></geometry>'
        seen = (
            (
                f'<origin rpy="{math.pi / 2} 0 0"/><geometry><cylinder radius="{radius}" length="{wheel.width}"/>'
                "</geometry>"
            )
            if drives_on
            else shape
        )
        parts.append(
            f'<link name="{name}_link">{_inertial(mass, moments)}<collision>{shape}</collision>'
            f"<visual>{seen}</visual></link>\n"
        )
        kind = "continuous" if drives_on else "fixed"
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
