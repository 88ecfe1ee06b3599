"""A model as URDF text (Unified Robot Description Format), with meshes beside it where needed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.simulate.model import Link, Model, Pose, Shape

_KINDS = {"fixed": "fixed", "spring": "prismatic"}  # joint types; every other role turns


def model_urdf(model: Model, folder: Path, *, margin: float, visible: bool) -> str:
    """URDF of ``model``; meshes go into ``folder``, shrunk by the ``margin`` (m) that the engine
    adds.

    The base frame is the chassis' centre of gravity. Links and joints are called ``link_<i>``.
    ``visible`` adds visual shapes. Raises ArgumentError for an ellipsoid, which URDF does not know.
    """
    shapes = {s for link in model.links for s in (*link.shapes, *link.looks) if s.kind == "hull"}
    files = {shape: f"hull_{i}.obj" for i, shape in enumerate(sorted(shapes, key=hash))}
    for shape, file in files.items():
        (folder / file).write_text(_obj(np.array(shape.corners), margin), encoding="utf-8")
    base = np.array(model.links[0].cog)
    parts = ['<?xml version="1.0"?>\n<robot name="robot">\n']
    for i, link in enumerate(model.links):
        shift = base if i == 0 else np.zeros(3)
        parts.append(_link(i, link, shift, files, visible))
        if i > 0:
            parts.append(_joint(i, link, base if link.parent == 0 else np.zeros(3)))
    return "".join([*parts, "</robot>\n"])


def _link(number: int, link: Link, shift: Array, files: dict[Shape, str], visible: bool) -> str:
    """Frame ``shift`` away from the model's."""
    xx, yy, zz = link.inertia
    cog = np.array(link.cog) - shift
    solid = "".join(f"<collision>{_geometry(s, shift, files)}</collision>" for s in link.shapes)
    colour = f'<material name="m{number}"><color rgba="{_numbers(link.colour)} 1"/></material>'
    looks = link.looks if visible else ()
    seen = "".join(f"<visual>{_geometry(s, shift, files)}{colour}</visual>" for s in looks)
    return (
        f'<link name="link_{number}"><inertial><origin xyz="{_numbers(cog)}"/>'
        f'<mass value="{link.mass!r}"/><inertia ixx="{xx!r}" iyy="{yy!r}" izz="{zz!r}" '
        f'ixy="0" ixz="0" iyz="0"/></inertial>{solid}{seen}</link>\n'
    )


def _joint(number: int, link: Link, shift: Array) -> str:
    joint = link.joint
    kind = _KINDS.get(joint.role, "continuous" if joint.reach is None else "revolute")
    limit = ""
    if joint.reach is not None:
        low, high = joint.reach
        limit = f'<limit lower="{low!r}" upper="{high!r}" effort="1e9" velocity="1e9"/>'
    return (
        f'<joint name="link_{number}" type="{kind}"><parent link="link_{link.parent}"/>'
        f'<child link="link_{number}"/>{_origin(joint.pose, shift)}'
        f'<axis xyz="{_numbers(joint.axis)}"/>{limit}</joint>\n'
    )


def _geometry(shape: Shape, shift: Array, files: dict[Shape, str]) -> str:
    x, _, z = shape.size
    if shape.kind == "sphere":
        solid = f'<sphere radius="{x!r}"/>'
    elif shape.kind in ("cylinder", "disc"):
        solid = f'<cylinder radius="{x!r}" length="{2.0 * z!r}"/>'
    elif shape.kind == "box":
        solid = f'<box size="{_numbers(2.0 * half for half in shape.size)}"/>'
    elif shape.kind == "hull":
        solid = f'<mesh filename="{files[shape]}"/>'
    else:
        expected = "spheres, barrel, cylinder or cone in pybullet (URDF has no ellipsoid)"
        raise ArgumentError("rollers.shape", "ellipsoid", expected)
    return f"{_origin(shape.pose, shift)}<geometry>{solid}</geometry>"


def _origin(pose: Pose, shift: Array) -> str:
    place = np.array(pose.place) - shift
    return f'<origin xyz="{_numbers(place)}" rpy="0 {pose.pitch!r} {pose.yaw!r}"/>'


def _obj(corners: Array, margin: float) -> str:
    """Wavefront OBJ of the convex hull, each face moved inwards by ``margin`` (m)."""
    hull = ConvexHull(corners)
    lines = []
    for k in hull.vertices:
        faces = hull.equations[np.any(hull.simplices == k, axis=1)]
        # the corner follows all its faces; where they are almost level, by the least move
        move = np.linalg.lstsq(faces[:, :3], np.full(len(faces), -margin), rcond=1e-3)[0]
        lines.append("v " + _numbers(corners[k] + move))
    place = {k: i + 1 for i, k in enumerate(hull.vertices.tolist())}
    triangles: Sequence[Sequence[int]] = hull.simplices.tolist()
    lines += ["f " + " ".join(str(place[k]) for k in triangle) for triangle in triangles]
    return "\n".join(lines) + "\n"


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
