"""URDF (Unified Robot Description Format) in and out.

Read: links, joints, inertias, collision shapes but meshes, limits, transmissions. Written: all
links of the physics model, rollers included, with wheels as cylinders; hulls as meshes in a folder
beside the file. Joints are called as ``names`` says.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any, Literal
from xml.etree import ElementTree

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.files import LARGEST_TABLE, content_of
from trajopt.formats.names import BASE, CHASSIS, link_joint
from trajopt.formats.tree import Part, Solid
from trajopt.report.files import write_text
from trajopt.robots.robot import Robot
from trajopt.simulate.build import build
from trajopt.simulate.model import Model
from trajopt.simulate.urdf import model_urdf

Element = ElementTree.Element
_OPTIONAL = re.compile(
    r"\$\(optenv \S+ ([^)]*)\)"
)  # left behind by xacro: an environment's, or this
_MOVES: dict[str, Literal["fixed", "turning", "sliding"]] = {
    "fixed": "fixed", "continuous": "turning", "revolute": "turning", "prismatic": "sliding",
}  # fmt: skip


def write(robot: Robot, file: Path) -> int:
    """Write ``robot``; returns how many links. Raises ArgumentError for rollers of shape ellipsoid."""
    model = build(robot, discs=True, outline=False)
    folder = file.with_name(f"{file.stem}_meshes")
    if any(s.kind == "hull" for link in model.links for s in (*link.shapes, *link.looks)):
        folder.mkdir(exist_ok=True)
    root = ElementTree.fromstring(model_urdf(model, folder, margin=0.0, visible=True))
    root.set("name", robot.name)
    for mesh in root.iter("mesh"):
        mesh.set("filename", f"{folder.name}/{mesh.get('filename')}")
    _rename(root, model, robot)
    ground = ElementTree.fromstring(
        f'<joint name="{BASE}" type="fixed"><parent link="{BASE}"/><child link="{CHASSIS}"/>'
        f'<origin xyz="{" ".join(map(repr, model.links[0].cog))}"/></joint>'
    )
    root[:0] = [Element("link", name=BASE), ground]
    ElementTree.indent(root)
    write_text(file, ElementTree.tostring(root, encoding="unicode") + "\n")
    return len(model.links) + 1


def _rename(root: Element, model: Model, robot: Robot) -> None:
    """Names of the robot's own, and what motors and steering can do."""
    speeds = dict(zip(model.spins, robot.motor_array("speed").tolist(), strict=True))
    rates = {name: group.rate for group in robot.description.steering for name in group.wheels}
    links = {f"link_{i}": link.name for i, link in enumerate(model.links)} | {"link_0": CHASSIS}
    for link in root.iter("link"):
        link.set("name", links[link.get("name", "")])
    for joint in root.iter("joint"):
        number = int(joint.get("name", "").removeprefix("link_"))
        link_, drive = model.links[number], model.links[number].joint
        joint.set("name", link_joint(link_.name))
        for end in (*joint.iter("parent"), *joint.iter("child")):
            end.set("link", links[end.get("link", "")])
        if drive.drive not in ("velocity", "position"):
            continue
        speed = speeds.get(number, rates.get(link_.name.split("/")[0]))
        limit = joint.find("limit")
        limit = ElementTree.SubElement(joint, "limit") if limit is None else limit
        limit.set("effort", repr(drive.effort))
        limit.set("velocity", repr(1e9 if speed is None or math.isinf(speed) else speed))


def read(file: Path) -> list[Part]:
    """Parts of a file, parents first. Raises ArgumentError, naming the element, for what is no
    URDF."""
    try:
        root = ElementTree.fromstring(content_of(file, LARGEST_TABLE))
    except (OSError, ValueError, ElementTree.ParseError) as error:
        raise ArgumentError(str(file), str(error), "a URDF file") from None
    if root.tag != "robot":
        raise ArgumentError(str(file), f"<{root.tag}>", "<robot>, as URDF begins")
    links = {_text(link, "name", file): link for link in root.findall("link")}
    joints = {_inner(joint, "child", "link", file): joint for joint in root.findall("joint")}
    driven = {
        joint.get("name")
        for group in root.findall("transmission")
        for joint in group.findall("joint")
    }
    order = [name for name in links if name not in joints]
    if len(order) != 1:
        raise ArgumentError(str(file), order, "one link that is no joint's child")
    for name in order:  # grows while it is walked
        order += [
            child
            for child, joint in joints.items()
            if _inner(joint, "parent", "link", file) == name
        ]
    unknown = [name for name in order if name not in links]
    if unknown or len(order) < len(links):
        raise ArgumentError(str(file), unknown or "a ring of joints", "links on one tree of joints")
    number = {name: i for i, name in enumerate(order)}
    return [_part(links[name], joints.get(name), number, driven, file) for name in order]


def _part(
    link: Element,
    joint: Element | None,
    number: dict[str, int],
    driven: set[str | None],
    file: Path,
) -> Part:
    name, parent, reach, effort, speed = link.get("name", ""), -1, None, None, None
    moves: Literal["fixed", "turning", "sliding"] = "fixed"
    place, turn, axis, called = np.zeros(3), np.eye(3), np.array([1.0, 0.0, 0.0]), ""
    if joint is not None:
        called, kind = _text(joint, "name", file), _text(joint, "type", file)
        if kind not in _MOVES:
            raise ArgumentError(f"{file}: joint {called}", kind, "one of " + ", ".join(_MOVES))
        moves, parent = _MOVES[kind], number[_inner(joint, "parent", "link", file)]
        place, turn = _origin(joint, file)
        axis = _vector(joint.find("axis"), "xyz", "1 0 0", file)
        axis = axis / (np.linalg.norm(axis) or 1.0)
        limit = joint.find("limit")
        if limit is not None:
            effort, speed = (_positive(limit, key, file) for key in ("effort", "velocity"))
            if kind != "continuous":
                reach = (_number(limit, "lower", file), _number(limit, "upper", file))
    inertial = link.find("inertial")
    mass, cog, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    if inertial is not None:
        cog, frame = _origin(inertial, file)
        mass = _number(_child(inertial, "mass", file), "value", file)
        given = _child(inertial, "inertia", file)
        for k, (i, j) in {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}.items():  # fmt: skip
            inertia[i, j] = inertia[j, i] = _number(given, f"i{k}", file)
        inertia = frame @ inertia @ frame.T
    solids = tuple(_solid(solid, file) for solid in link.findall("collision"))
    if mass > 0 and not solids and link.find("visual") is not None:
        solids = (Solid("mesh", None, cog, np.eye(3)),)  # what weighs and is shown takes room
    return Part(
        name, parent, called, moves, place, turn, axis, np.zeros(3), reach,
        moves == "turning" and (called in driven or effort is not None),
        effort, speed, mass, cog, inertia, solids,
    )  # fmt: skip


def _solid(element: Element, file: Path) -> Solid:
    place, turn = _origin(element, file)
    geometry = _child(element, "geometry", file)
    if (box := geometry.find("box")) is not None:
        return Solid("box", _vector(box, "size", "", file) / 2.0, place, turn)
    if (ball := geometry.find("sphere")) is not None:
        return Solid("sphere", np.full(3, _number(ball, "radius", file)), place, turn)
    if (drum := geometry.find("cylinder")) is not None:
        r, length = _number(drum, "radius", file), _number(drum, "length", file)
        return Solid("cylinder", np.array([r, r, length / 2.0]), place, turn)
    return Solid("mesh", None, place, turn)


def _origin(element: Element, file: Path) -> tuple[Array, Array]:
    origin = element.find("origin")
    roll, pitch, yaw = _vector(origin, "rpy", "0 0 0", file).tolist()
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    turn = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return _vector(origin, "xyz", "0 0 0", file), turn


def _vector(element: Element | None, key: str, absent: str, file: Path) -> Array:
    text = absent if element is None else element.get(key, absent)
    try:
        found = np.array([float(part) for part in _OPTIONAL.sub(r"\1", text).split()])
    except ValueError:
        found = np.zeros(0)
    if found.shape != (3,) or not np.isfinite(found).all():
        raise ArgumentError(f"{file}: {key}", text, "three numbers")
    return found


def _number(element: Element, key: str, file: Path) -> float:
    text = element.get(key, "0" if key in ("lower", "upper") else "")
    try:
        found = float(text)
    except ValueError:
        found = math.nan
    if not math.isfinite(found):
        raise ArgumentError(f"{file}: <{element.tag} {key}>", text, "a number")
    return found


def _positive(limit: Element, key: str, file: Path) -> float | None:
    """A limit's value; none is 0 or beyond 1e8, which files write for no limit."""
    found = 0.0 if limit.get(key) is None else _number(limit, key, file)
    return found if 0.0 < found < 1e8 else None


def _child(element: Element, tag: str, file: Path) -> Element:
    found = element.find(tag)
    if found is None:
        raise ArgumentError(f"{file}: <{element.tag}>", None, f"<{tag}> in it")
    return found


def _inner(element: Element, tag: str, key: str, file: Path) -> str:
    return _text(_child(element, tag, file), key, file)


def _text(element: Element, key: str, file: Path) -> str:
    found: Any = element.get(key)
    if not found:
        raise ArgumentError(f"{file}: <{element.tag}>", None, f"a {key}")
    return str(found)
