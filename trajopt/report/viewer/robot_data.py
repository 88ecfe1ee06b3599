"""A robot as the page shows it: the links, joints and looks that physics engines build from."""

from __future__ import annotations

from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.report.viewer.pages import packed
from trajopt.robots.robot import Robot
from trajopt.simulate.build import build
from trajopt.simulate.model import Model, Pose, Shape
from trajopt.simulate.rollers import revolve

_SIDES = 12  # corners of a ring, by which solids of revolution are known
_CAP = 0.7  # cosine of half a right angle: where the end of a row of spheres is cut, chosen
_ROUND = 1e-7  # m; corners that agree this well on a radius lie on one ring
_RINGS = 6  # of a solid of revolution that are drawn at most, chosen


def robot_data(robot: Robot) -> dict[str, Any]:
    """Parents, rest poses (x, y, z, quaternion x, y, z, w), axes and looks of all links; equal shapes once."""
    model = build(robot, outline=False)
    shapes: dict[Shape, int] = {}
    rows, poses, colours = [], [], []
    for i, link in enumerate(model.links):
        looks = _one_barrel(link.looks) if link.joint.role == "roller" else link.looks
        for k, look in enumerate(looks):
            bare = Shape(look.kind, look.size, corners=look.corners)
            rows.append([i, shapes.setdefault(bare, len(shapes)), k])
            poses.append(_row(look.pose))
            colours.append(link.colour)
    return {
        "name": robot.name,
        "names": ["" if k.joint.role == "roller" else k.name for k in model.links],
        "roles": [link.joint.role for link in model.links],
        "parents": [link.parent for link in model.links],
        "rest": packed([_row(link.joint.pose) for link in model.links]),
        "axes": packed([link.joint.axis for link in model.links]),
        "looks": rows,
        "poses": packed(poses),
        "colours": packed(colours),
        "shapes": [_shape(shape) for shape in shapes],
        "feet": model.feet,
        "radii": [wheel.radius for wheel in robot.description.wheels],
        "footprint": robot.footprint,
        "mass": robot.body.mass,
    }


def wheel_of_joint(model: Model) -> dict[int, int]:
    """The wheel (number in the file) whose spin or steering angle each turning link has."""
    first: dict[int, int] = {}
    for wheel, foot in enumerate(model.feet):
        for link in (foot, *model.above(foot)):
            first.setdefault(link, wheel)
    turning = ("spin", "steer", "swivel")
    return {k: wheel for k, wheel in first.items() if model.links[k].joint.role in turning}


def _row(pose: Pose) -> list[float]:
    w, x, y, z = pose.quaternion
    return [*pose.place, x, y, z, w]


def _one_barrel(looks: tuple[Shape, ...]) -> tuple[Shape, ...]:
    """A roller of several spheres as one solid of revolution, with as few faces as show it."""
    if len(looks) < 2:
        return looks
    rings = sorted((look.pose.place[2], look.size[0]) for look in looks)
    (first, r), (last, q) = rings[0], rings[-1]
    rings = [(first - _CAP * r, _CAP * r), *rings, (last + _CAP * q, _CAP * q)]
    heights, radii = np.array(rings).T
    return (revolve(heights, radii, sides=_SIDES),)


def _shape(shape: Shape) -> dict[str, Any]:
    if shape.kind != "hull":
        kind = "cylinder" if shape.kind == "disc" else shape.kind
        return {"kind": kind, "size": shape.size}
    corners = np.array(shape.corners)
    rings = _rings(corners)
    if rings is not None:
        return {"kind": "lathe", "rings": packed(rings)}
    from scipy.spatial import ConvexHull

    hull = ConvexHull(corners)
    return {"kind": "hull", "corners": packed(corners), "faces": hull.simplices.tolist()}


def _rings(corners: Array) -> Array | None:
    """(K, 2): radius and height of the rings of a solid of revolution about z; None for others."""
    radius = np.hypot(corners[:, 0], corners[:, 1])
    heights = np.unique(corners[:, 2])
    found = []
    for height in heights:
        here = radius[corners[:, 2] == height]
        if len(here) < _SIDES or np.ptp(here) > _ROUND:
            return None
        found.append((here[0], height))
    step = max(1, -(-len(found) // _RINGS))
    return np.array(found if step == 1 else [*found[:-1:step], found[-1]])
