"""Tables of common robots, as their files would hold them. ``Robot.differential(...)`` and its
kind turn them into robots; every size is given by the caller.

Lengths m, masses kg, torques N m at a wheel, angles rad.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from trajopt.arrays import require_finite, require_whole

Tables = dict[str, Any]
_POINTS = {"cog": (3,), "chassis": (3,), "chassis_place": (2,), "castor": (2,)}  # shapes
MECANUM_ANGLES = (-math.pi / 4, math.pi / 4, math.pi / 4, -math.pi / 4)  # rad: FL, FR, RL, RR
CORNERS = (
    ("front-left", 1, 1),
    ("front-right", 1, -1),
    ("rear-left", -1, 1),
    ("rear-right", -1, -1),
)


def tables(builder: str, sizes: Mapping[str, Any]) -> Tables:
    """Tables of the builder called so. Raises ArgumentError for sizes that are no numbers."""
    for name, value in sizes.items():
        if name != "name":
            require_finite(f"{builder}.{name}", value, "", _POINTS.get(name, ()))
    made: Tables = globals()[builder](**sizes)
    return made


def differential(
    *,
    name: str,
    mass: float,
    cog: tuple[float, float, float],
    chassis: tuple[float, float, float],
    clearance: float,
    track: float,
    radius: float,
    width: float,
    wheel_mass: float,
    torque: float,
    castor: tuple[float, float],
    castor_radius: float,
    castor_trail: float,
    castor_mass: float,
    chassis_place: tuple[float, float] = (0.0, 0.0),
) -> Tables:
    """Wheels ``left`` and ``right`` on the axle x = 0, a free castor with its pivot at ``castor``.

    >>> from trajopt.robots import Robot
    >>> robot = Robot.differential(
    ...     name="mine", mass=12.0, cog=(-0.05, 0.0, 0.1), chassis=(0.4, 0.3, 0.1), clearance=0.05,
    ...     chassis_place=(-0.1, 0.0), track=0.34, radius=0.1, width=0.04, wheel_mass=0.8,
    torque=4.0,
    ...     castor=(-0.22, 0.0), castor_radius=0.04, castor_trail=0.03, castor_mass=0.2)
    >>> robot.inverse.round(2).tolist()
    [[10.0, 0.0, -1.7], [10.0, 0.0, 1.7]]
    """
    sides = (("left", 1), ("right", -1))
    wheels = [
        _wheel(side, "fixed", (0.0, sign * track / 2), radius, width, wheel_mass)
        for side, sign in sides
    ]
    small = _wheel("castor", "castor", castor, castor_radius, castor_radius / 2, castor_mass)
    return {
        "name": name,
        "body": _body(mass, cog, chassis, clearance, chassis_place),
        "wheels": [*wheels, {**small, "trail": castor_trail}],
        "motors": _motors([side for side, _ in sides], torque),
    }


def car(
    *,
    name: str,
    mass: float,
    cog: tuple[float, float, float],
    chassis: tuple[float, float, float],
    clearance: float,
    wheelbase: float,
    track: float,
    radius: float,
    width: float,
    wheel_mass: float,
    torque: float,
    steering_range: float,
) -> Tables:
    """Driven rear wheels on the axle x = 0, free front wheels at x = ``wheelbase`` that steer by up
    to ``steering_range`` either way. The chassis is centred between the axles."""
    wheels = [
        _wheel(
            wheel,
            "steered" if front > 0 else "fixed",
            (wheelbase if front > 0 else 0.0, side * track / 2),
            radius,
            width,
            wheel_mass,
        )
        for wheel, front, side in CORNERS
    ]
    front = ["front-left", "front-right"]
    return {
        "name": name,
        "body": _body(mass, cog, chassis, clearance, (wheelbase / 2, 0.0)),
        "wheels": wheels,
        "motors": _motors(["rear-left", "rear-right"], torque),
        "steering": [
            {"name": "front", "wheels": front, "range": [-steering_range, steering_range]}
        ],
    }


def mecanum(
    *,
    name: str,
    mass: float,
    cog: tuple[float, float, float],
    chassis: tuple[float, float, float],
    clearance: float,
    wheelbase: float,
    track: float,
    radius: float,
    width: float,
    wheel_mass: float,
    torque: float,
    rollers: int,
    roller_radius: float,
) -> Tables:
    """Four driven Mecanum wheels around the origin, in the order FL, FR, RL, RR, rollers at 45
    deg (seen from above, the axes of the rollers on the ground form a diamond)."""
    wheels = [
        {
            **_wheel(
                wheel, "swedish", (i * wheelbase / 2, j * track / 2), radius, width, wheel_mass
            ),
            "rollers": {"count": rollers, "angle": angle, "radius": roller_radius},
        }
        for (wheel, i, j), angle in zip(CORNERS, MECANUM_ANGLES, strict=True)
    ]
    return {
        "name": name,
        "body": _body(mass, cog, chassis, clearance),
        "wheels": wheels,
        "motors": _motors([wheel for wheel, _, _ in CORNERS], torque),
    }


def omni(
    *,
    name: str,
    mass: float,
    cog: tuple[float, float, float],
    chassis: tuple[float, float, float],
    clearance: float,
    count: int,
    distance: float,
    radius: float,
    width: float,
    wheel_mass: float,
    torque: float,
    rollers: int,
    roller_radius: float,
    first: float = 0.0,
) -> Tables:
    """``count`` driven omni wheels at ``distance`` from the origin, evenly from the angle ``first``
    on, each rolling around the centre, counter-clockwise."""
    require_whole("omni.count", count, 3, "a whole number of wheels, 3 to 100", 100)
    wheels = []
    for i in range(count):
        at = first + 2 * math.pi * i / count
        place = (distance * math.cos(at), distance * math.sin(at))
        wheel = _wheel(f"wheel-{i + 1}", "swedish", place, radius, width, wheel_mass)
        roller = {"count": rollers, "angle": 0.0, "radius": roller_radius}
        wheels.append({**wheel, "angle": at + math.pi / 2, "rollers": roller})
    return {
        "name": name,
        "body": _body(mass, cog, chassis, clearance),
        "wheels": wheels,
        "motors": _motors([str(wheel["name"]) for wheel in wheels], torque),
    }


def swerve(
    *,
    name: str,
    mass: float,
    cog: tuple[float, float, float],
    chassis: tuple[float, float, float],
    clearance: float,
    wheelbase: float,
    track: float,
    radius: float,
    width: float,
    wheel_mass: float,
    torque: float,
) -> Tables:
    """Four driven wheels around the origin, each steered by itself without an end."""
    wheels = [
        _wheel(wheel, "steered", (i * wheelbase / 2, j * track / 2), radius, width, wheel_mass)
        for wheel, i, j in CORNERS
    ]
    names = [wheel for wheel, _, _ in CORNERS]
    return {
        "name": name,
        "body": _body(mass, cog, chassis, clearance),
        "wheels": wheels,
        "motors": _motors(names, torque),
        "steering": [{"name": wheel, "wheels": [wheel]} for wheel in names],
    }


def _body(
    mass: float,
    cog: tuple[float, float, float],
    chassis: tuple[float, float, float],
    clearance: float,
    place: tuple[float, float] = (0.0, 0.0),
) -> Tables:
    return {
        "mass": mass,
        "cog": list(cog),
        "chassis": list(chassis),
        "chassis_place": list(place),
        "clearance": clearance,
    }


def _wheel(
    name: str, kind: str, place: tuple[float, float], radius: float, width: float, mass: float
) -> Tables:
    return {
        "name": name,
        "kind": kind,
        "position": list(place),
        "radius": radius,
        "width": width,
        "mass": mass,
    }


def _motors(wheels: list[str], torque: float) -> list[Tables]:
    return [{"name": wheel, "wheels": [wheel], "torque": torque} for wheel in wheels]
