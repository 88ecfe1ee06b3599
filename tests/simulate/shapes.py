"""What rollers and wheels reach, from their shapes: to be compared with closed forms."""

from __future__ import annotations

import math

import numpy as np

from trajopt.robots import robot
from trajopt.robots.description import WheelSection
from trajopt.simulate.model import Pose
from trajopt.simulate.rollers import Roller, normals

ROUND = np.linspace(-math.pi, math.pi, 2001)


def wheel(name: str = "loc8", **changes: object) -> WheelSection:
    """Front-left wheel of a shipped robot, with changed keys of the wheel and its rollers."""
    keys = {f"wheels.front-left.{key.replace('__', '.')}": value for key, value in changes.items()}
    return robot(name, keys).description.wheels[0]


def support_height(rollers: tuple[Roller, ...], phi: np.ndarray) -> np.ndarray:
    """Distance (m) from the axle down to the lowest point of the rollers when the place ``phi``
    (K,) is down."""
    down = normals(phi)
    best = np.full(phi.shape, -np.inf)
    for roller in rollers:
        turn = Pose.along(roller.axis).rotation
        for shape in roller.shapes:
            at = np.array(roller.centre) + turn @ np.array(shape.pose.place)
            local = down @ turn
            size = np.array(shape.size)
            if shape.kind in ("sphere", "ellipsoid"):
                reach = np.sqrt(np.sum((local * size) ** 2, axis=1))
            elif shape.kind == "cylinder":
                reach = size[0] * np.hypot(local[:, 0], local[:, 1]) + size[2] * abs(local[:, 2])
            else:
                reach = (local @ np.array(shape.corners).T).max(axis=1)
            best = np.maximum(best, down @ at + reach)
    return best
