"""Whether no route can exist: the largest disc inside the outline cannot get from start to goal."""

from __future__ import annotations

import numpy as np
import shapely

from trajopt.arrays import Array, rotation
from trajopt.robots.robot import Robot
from trajopt.world.scene import Scene

_ROUND = (
    64  # segments to a quarter of a circle; chosen: 8e-5 of a radius is left out, on the safe side
)
_FAR = 50.0  # m around everything in which a way could lead; chosen


def why_none(
    robot: Robot,
    scene: Scene,
    ends: tuple[Array, Array],
    inner: tuple[float, float, float],
    clearance: float,
) -> tuple[bool, str]:
    """Whether it is proven that there is no route, and what to tell. ``inner``: centre (m, body
    frame) and radius of a disc inside the outline.

    The disc's centre keeps off everything by its radius and the clearance: what is left of the plane
    falls into pieces, and start and goal lie in different ones. Arcs are replaced by chords, which
    leave more room than there is, so a proof stands.
    """
    x, y, radius = inner
    places = [pose[:2] + rotation(pose[2]) @ np.array([x, y]) for pose in ends]
    solids = shapely.union_all(list(scene.keep_out.solids))
    wide = radius + clearance
    blocked = solids.buffer(wide * (1 - 1e-9), quad_segs=_ROUND)
    around = shapely.union_all([solids, *(shapely.Point(p) for p in places)]).envelope
    free = around.buffer(_FAR).difference(blocked)
    parts = [
        [k for k, part in enumerate(shapely.get_parts(free)) if part.intersects(shapely.Point(p))]
        for p in places
    ]
    if parts[0] != parts[1]:
        return True, (
            f"no route exists: a disc of {radius:.3f} m, which the outline of '{robot.name}' "
            f"holds, cannot get from start to goal keeping {clearance:g} m off"
        )
    return False, (
        f"none found, though a disc of {radius:.3f} m could pass; there may be one, with turns on "
        "the spot or backwards, which are not searched"
    )
