"""A SimRobot as URDF text (Unified Robot Description Format), with meshes beside it where
needed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.simulate.engine import SimRobot
from trajopt.simulate.rollers import (
    Revolved,
    Roller,
    RollerWheel,
    SphereChain,
    disc_inertia,
    hub_drum,
    is_cylinder,
    revolve,
    roller_size,
)

CHASSIS_COLOUR = "0.25 0.35 0.55 1"
ROLLER_COLOURS = (
    "0.15 0.15 0.15 1",
    "0.85 0.45 0.1 1",
)  # every other roller: turning shows in pictures
HUB_COLOUR = "0.7 0.7 0.72 1"


@dataclass(frozen=True)
class _Style:
    """How parts are written: mesh files by profile, the margin [m] of the engine, with visuals or
    not."""

    meshes: dict[Revolved, str]
    margin: float
    visible: bool


def robot_urdf(robot: SimRobot, folder: Path, *, margin: float, visible: bool) -> str:
    """URDF of ``robot``; meshes go into ``folder``, shrunk by the ``margin`` [m] that the engine
    adds.

    The base frame is the chassis' centre of gravity. Joints are called ``wheel_0`` to ``wheel_3``
    and ``roller_<wheel>_<roller>``. ``visible`` adds visual shapes. Raises ArgumentError for an
    ellipsoid roller, which URDF does not know.
    """
    profiles = [roller.profile for wheel in robot.wheels for roller in wheel.rollers]
    solids = [p for p in dict.fromkeys(profiles) if isinstance(p, Revolved) and not is_cylinder(p)]
    style = _Style(
        {profile: f"mesh_{index}.obj" for index, profile in enumerate(solids)}, margin, visible
    )
    for profile, file in style.meshes.items():
        (folder / file).write_text(_obj(revolve(profile, shrink=margin), profile), encoding="utf-8")
    parts = [f'<?xml version="1.0"?>\n<robot name="robot">\n{_chassis(robot, visible)}']
    for index, wheel in enumerate(robot.wheels):
        x, y = robot.wheel_positions[index]
        place = (x, y, wheel.radius - robot.cog_height)
        parts.append(_joint(f"wheel_{index}", "chassis", f"hub_{index}", place, "0 0 0", "0 1 0"))
        parts.append(_hub(f"hub_{index}", wheel, visible))
        drum = hub_drum(wheel)
        (folder / f"hub_{index}.obj").write_text(_obj(revolve(drum), drum), encoding="utf-8")
        for number, roller in enumerate(wheel.rollers):
            name = f"roller_{index}_{number}"
            parts.append(
                _joint(
                    name, f"hub_{index}", f"{name}_link", roller.centre, _attitude(roller), "0 0 1"
                )
            )
            parts.append(_roller(f"{name}_link", number, wheel, roller, style))
    parts.append("</robot>\n")
    return "".join(parts)


def _chassis(robot: SimRobot, visible: bool) -> str:
    xx, yy, zz = robot.inertia
    middle = robot.chassis_clearance + robot.chassis_size[2] / 2.0 - robot.cog_height
    shape = f'<origin xyz="0 0 {middle!r}"/><geometry><box size="{_numbers(robot.chassis_size)}"/></geometry>'
    seen = f"<visual>{shape}{_material('chassis', CHASSIS_COLOUR)}</visual>" if visible else ""
    return (
        f'<link name="chassis"><inertial><mass value="{robot.chassis_mass!r}"/>'
        f'<inertia ixx="{xx!r}" iyy="{yy!r}" izz="{zz!r}" ixy="0" ixz="0" iyz="0"/></inertial>'
        f"<collision>{shape}</collision>{seen}</link>\n"
    )


def _hub(name: str, wheel: RollerWheel, visible: bool) -> str:
    """A disc of 0.8 wheel radii without collision shape: only rollers touch the terrain."""
    about, across = disc_inertia(wheel.hub_mass, 0.8 * wheel.radius, wheel.width)
    seen = ""
    if visible:
        upright = f'<origin rpy="{math.pi / 2.0!r} 0 0"/>'
        disc = f'<geometry><mesh filename="{name}.obj"/></geometry>'
        seen = f"<visual>{upright}{disc}{_material('hub', HUB_COLOUR)}</visual>"
    return (
        f'<link name="{name}"><inertial><mass value="{wheel.hub_mass!r}"/>'
        f'<inertia ixx="{across!r}" iyy="{about!r}" izz="{across!r}" ixy="0" ixz="0" iyz="0"/></inertial>'
        f"{seen}</link>\n"
    )


def _roller(name: str, number: int, wheel: RollerWheel, roller: Roller, style: _Style) -> str:
    about, across = disc_inertia(wheel.roller_mass, *roller_size(roller))
    shapes = _shapes(roller, style)
    colour = _material(f"roller{number % 2}", ROLLER_COLOURS[number % 2])
    solid = "".join(f"<collision>{shape}</collision>" for shape in shapes)
    seen = "".join(f"<visual>{shape}{colour}</visual>" for shape in shapes) if style.visible else ""
    return (
        f'<link name="{name}"><inertial><mass value="{wheel.roller_mass!r}"/>'
        f'<inertia ixx="{across!r}" iyy="{across!r}" izz="{about!r}" ixy="0" ixz="0" iyz="0"/></inertial>'
        f"{solid}{seen}</link>\n"
    )


def _shapes(roller: Roller, style: _Style) -> list[str]:
    profile = roller.profile
    if isinstance(profile, SphereChain):
        return [
            f'<origin xyz="0 0 {station!r}"/><geometry><sphere radius="{radius!r}"/></geometry>'
            for station, radius in zip(profile.stations, profile.radii, strict=True)
        ]
    if isinstance(profile, Revolved):
        if is_cylinder(profile):
            low, high = profile.stations
            size = f'<cylinder radius="{profile.radii[0]!r}" length="{high - low!r}"/>'
            return [f'<origin xyz="0 0 {(low + high) / 2.0!r}"/><geometry>{size}</geometry>']
        return [f'<geometry><mesh filename="{style.meshes[profile]}"/></geometry>']
    raise ArgumentError(
        "shape", "ellipsoid", "spheres, barrel, cylinder or cone (URDF has no ellipsoid)"
    )


def _obj(vertices: Array, profile: Revolved) -> str:
    """Wavefront OBJ of the rings of ``revolve``: side faces and two lids."""
    rings = len(profile.stations)
    sides = len(vertices) // rings
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    for ring in range(rings - 1):
        for side in range(sides):
            after = (side + 1) % sides
            low, high = ring * sides + 1, (ring + 1) * sides + 1
            lines.append(f"f {low + side} {low + after} {high + after}")
            lines.append(f"f {low + side} {high + after} {high + side}")
    top = (rings - 1) * sides + 1
    for side in range(1, sides - 1):
        lines.append(f"f 1 {side + 2} {side + 1}")
        lines.append(f"f {top} {top + side} {top + side + 1}")
    return "\n".join(lines) + "\n"


def _joint(
    name: str, parent: str, child: str, place: tuple[float, float, float], rpy: str, axis: str
) -> str:
    return (
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_numbers(place)}" rpy="{rpy}"/><axis xyz="{axis}"/></joint>\n'
    )


def _attitude(roller: Roller) -> str:
    """Roll-pitch-yaw that turns z onto the roller axis: first about y by the polar angle, then
    about z."""
    x, y, z = roller.axis
    return f"0 {math.atan2(math.hypot(x, y), z)!r} {math.atan2(y, x)!r}"


def _material(name: str, colour: str) -> str:
    return f'<material name="{name}"><color rgba="{colour}"/></material>'


def _numbers(values: tuple[float, float, float]) -> str:
    return " ".join(repr(float(np.float64(value))) for value in values)
