"""MJCF, MuJoCo's own format, in (through MuJoCo's compiler) and out.

Read: bodies of the tree that holds the wheels, with what MuJoCo makes of defaults, inertias and
meshes. Written: all links of the physics model, a motor a driven wheel (a velocity servo where its
speed is known), a position servo a steered one; no ground.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal
from xml.etree import ElementTree

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.formats.names import BASE, link_joint
from trajopt.formats.tree import Part, Solid
from trajopt.report.files import write_text
from trajopt.robots.robot import Robot
from trajopt.simulate.build import build
from trajopt.simulate.model import Link, Shape
from trajopt.simulate.mujoco import load_mujoco

Element = ElementTree.Element
_SOFT = 0.05  # of a motor's largest speed: an error at which its servo uses all its torque; chosen
_MOVES: tuple[Literal["turning", "sliding"], ...] = ("sliding", "turning")  # mjJNT_SLIDE, _HINGE


def write(robot: Robot, file: Path) -> int:
    """Write ``robot``; returns how many links."""
    model = build(robot, discs=True, outline=False)
    root = Element("mujoco", model=robot.name)
    sub = ElementTree.SubElement
    sub(root, "compiler", angle="radian", autolimits="true")
    asset, world, servos = (sub(root, tag) for tag in ("asset", "worldbody", "actuator"))
    meshes: dict[Shape, str] = {}
    bodies: list[Element] = []
    for link in model.links:
        parent = world if link.parent < 0 else bodies[link.parent]
        bodies.append(_body(parent, link, asset, meshes))
    speeds = dict(zip(model.spins, robot.motor_array("speed").tolist(), strict=True))
    for i, link in enumerate(model.links):
        _servo(servos, link, speeds.get(i, math.inf))
    ElementTree.indent(root)
    write_text(file, ElementTree.tostring(root, encoding="unicode") + "\n")
    return len(model.links)


def _body(parent: Element, link: Link, asset: Element, meshes: dict[Shape, str]) -> Element:
    sub, joint, root = ElementTree.SubElement, link.joint, link.parent < 0
    name = BASE if root else link.name
    body = sub(
        parent, "body", name=name, pos=_told(joint.pose.place), quat=_told(joint.pose.quaternion)
    )
    if root:
        sub(body, "freejoint", name=BASE)
    elif joint.role != "fixed":
        told = {
            "name": link_joint(link.name),
            "axis": _told(joint.axis),
            "damping": repr(joint.damping),
        }
        if joint.role == "spring":
            told |= {"stiffness": repr(joint.stiffness), "springref": repr(joint.rest)}
        if joint.reach is not None:
            told["range"] = _told(joint.reach)
        sub(body, "joint", {"type": "slide" if joint.role == "spring" else "hinge", **told})
    sub(
        body, "inertial", pos=_told(link.cog), mass=repr(link.mass), diaginertia=_told(link.inertia)
    )
    # the robot's own parts never meet each other
    touching = {
        "contype": "1",
        "conaffinity": "0",
        "friction": _told((link.grip, 0.0, 0.0)),
        "group": "3",
    }
    seen = {"contype": "0", "conaffinity": "0", "rgba": _told((*link.colour, 1.0))}
    for shapes, how in ((link.shapes, touching), (link.looks, seen)):
        for shape in shapes:
            _geom(body, shape, how, asset, meshes)
    return body


def _geom(
    body: Element, shape: Shape, how: dict[str, str], asset: Element, meshes: dict[Shape, str]
) -> None:
    kind = {"disc": "cylinder", "hull": "mesh"}.get(shape.kind, shape.kind)
    place = {"pos": _told(shape.pose.place), "quat": _told(shape.pose.quaternion)}
    geom = ElementTree.SubElement(body, "geom", {"type": kind, **place, **how})
    if kind == "mesh":
        if shape not in meshes:
            meshes[shape] = f"hull_{len(meshes)}"
            corners = _told(np.ravel(shape.corners).tolist())
            ElementTree.SubElement(asset, "mesh", name=meshes[shape], vertex=corners)
        geom.set("mesh", meshes[shape])
    else:
        x, _, z = shape.size
        sizes = {"sphere": (x,), "cylinder": (x, z)}
        geom.set("size", _told(sizes.get(kind, shape.size)))


def _servo(servos: Element, link: Link, speed: float) -> None:
    joint, name = link.joint, link_joint(link.name)
    if joint.drive == "velocity" and math.isinf(speed):
        ElementTree.SubElement(
            servos, "motor", name=name, joint=name, ctrlrange=_told((-joint.effort, joint.effort))
        )
        return
    told = {"name": name, "joint": name, "forcerange": _told((-joint.effort, joint.effort))}
    if joint.drive == "velocity":
        gain = repr(joint.effort / (_SOFT * speed))
        limits = {"kv": gain, "ctrlrange": _told((-speed, speed))}
        ElementTree.SubElement(servos, "velocity", limits | told)
    elif joint.drive is not None and joint.role in ("steer", "tilt"):
        stiff = {"kp": repr(joint.stiffness), "dampratio": "1"}
        ElementTree.SubElement(servos, "position", stiff | told)


def _told(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)


def read(file: Path) -> list[Part]:
    """Parts of a file, parents first: every tree of bodies on the world. Raises ArgumentError with
    MuJoCo's reason for what it cannot compile, MissingDependencyError without MuJoCo."""
    mujoco = load_mujoco()
    try:
        model = mujoco.MjModel.from_xml_path(str(file))
    except ValueError as error:
        raise ArgumentError(str(file), str(error), "an MJCF file that MuJoCo compiles") from None
    drives = _drives(mujoco, model)
    parts = [_part(mujoco, model, body, drives) for body in range(1, model.nbody)]
    roots = [part.name for part in parts if part.parent < 0]
    if len(roots) != 1:
        raise ArgumentError(str(file), roots, "one body on the world: the robot, nothing else")
    return parts


def _part(
    mujoco: Any, model: Any, body: int, drives: dict[int, tuple[float | None, float | None]]
) -> Part:
    spec = model.body(body)
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    root = int(model.body_parentid[body]) == 0
    if count > 1 and not root:
        joints = [model.joint(first + k).name for k in range(count)]
        raise ArgumentError(f"body {spec.name}", joints, "one joint a body")
    moves: Literal["fixed", "turning", "sliding"] = "fixed"
    called, axis, anchor, reach = "", np.array([1.0, 0.0, 0.0]), np.zeros(3), None
    if count and not root:
        called, kind = model.joint(first).name, int(model.jnt_type[first])
        if kind not in (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE):
            raise ArgumentError(f"joint {called}", "a ball joint", "hinges and slides")
        moves = _MOVES[kind - int(mujoco.mjtJoint.mjJNT_SLIDE)]
        axis, anchor = model.jnt_axis[first].copy(), model.jnt_pos[first].copy()
        if model.jnt_limited[first]:
            low, high = model.jnt_range[first].tolist()
            reach = (low, high)
    else:
        called = spec.name  # by which --wheels can name a ball
    turn = _turned(mujoco, model.body_iquat[body])
    effort, speed = drives.get(first, (None, None)) if count and not root else (None, None)
    geoms = range(
        int(model.body_geomadr[body]), int(model.body_geomadr[body]) + int(model.body_geomnum[body])
    )
    touching = [g for g in geoms if model.geom_contype[g] or model.geom_conaffinity[g]]
    solids = tuple(_solid(mujoco, model, g) for g in touching)
    if len(geoms) and not solids and model.body_mass[body] > 0:  # what is shown takes room
        solids = (Solid("mesh", None, np.zeros(3), np.eye(3)),)
    return Part(
        spec.name, int(model.body_parentid[body]) - 1, called, moves,
        np.zeros(3) if root else model.body_pos[body].copy(),
        np.eye(3) if root else _turned(mujoco, model.body_quat[body]),
        axis, anchor, reach, bool(count) and not root and first in drives, effort, speed,
        float(model.body_mass[body]), model.body_ipos[body].copy(),
        turn @ np.diag(model.body_inertia[body]) @ turn.T,
        solids,
    )  # fmt: skip


def _solid(mujoco: Any, model: Any, geom: int) -> Solid:
    kinds, kind = mujoco.mjtGeom, int(model.geom_type[geom])
    place, turn = model.geom_pos[geom].copy(), _turned(mujoco, model.geom_quat[geom])
    r, half, _ = size = model.geom_size[geom].copy()
    if kind == kinds.mjGEOM_SPHERE:
        return Solid("sphere", np.full(3, r), place, turn)
    if kind in (kinds.mjGEOM_CYLINDER, kinds.mjGEOM_CAPSULE):
        return Solid("cylinder", np.array([r, r, half]), place, turn)
    if kind in (kinds.mjGEOM_BOX, kinds.mjGEOM_ELLIPSOID):
        return Solid("box", size, place, turn)
    middle, reach = np.split(model.geom_aabb[geom], 2)  # of a mesh, in its frame
    return Solid("box", reach.copy(), place + turn @ middle, turn)


def _drives(mujoco: Any, model: Any) -> dict[int, tuple[float | None, float | None]]:
    """Largest torque (N m) and speed (rad/s) that actuators give joints; None: not said."""
    found: dict[int, tuple[float | None, float | None]] = {}
    for a in range(model.nu):
        if model.actuator_trntype[a] != mujoco.mjtTrn.mjTRN_JOINT:
            continue
        joint, gear = int(model.actuator_trnid[a, 0]), abs(float(model.actuator_gear[a, 0]))
        gain, bias = float(model.actuator_gainprm[a, 0]), model.actuator_biasprm[a]
        torque = speed = None
        most = (
            float(np.abs(model.actuator_ctrlrange[a]).max())
            if model.actuator_ctrllimited[a]
            else None
        )
        if model.actuator_forcelimited[a]:
            torque = gear * float(np.abs(model.actuator_forcerange[a]).max())
        if model.actuator_biastype[a] == mujoco.mjtBias.mjBIAS_NONE:
            if most is not None:
                torque = min(torque or math.inf, gear * abs(gain) * most)
        elif most is not None and bias[1] == 0 and bias[2] < 0:  # a velocity servo
            speed = most / gear
        if torque is None and model.jnt_actfrclimited[joint]:
            torque = float(np.abs(model.jnt_actfrcrange[joint]).max())
        found[joint] = (torque, speed)
    return found


def _turned(mujoco: Any, quaternion: Array) -> Array:
    found = np.zeros(9)
    mujoco.mju_quat2Mat(found, quaternion)
    return found.reshape(3, 3)
