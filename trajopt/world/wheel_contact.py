"""Where a thin wheel touches a triangulated surface ([udengaard2008], section 4.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, require_positive
from trajopt.world.height_map import HeightMap


@dataclass(frozen=True, eq=False)
class WheelContact:
    """For n wheels: ``centre_height`` (m) of the lowest position that touches nothing, ``along``
    (m) of the contact ahead of the centre, ``inclination`` (rad) of the surface touched, > 0 uphill
    along the wheel."""

    centre_height: Array
    along: Array
    inclination: Array


def wheel_contact(
    ground: HeightMap, x: ArrayLike, y: ArrayLike, heading: ArrayLike, radius: float
) -> WheelContact:
    """Contact of discs that stand upright at (x, y) and roll along ``heading`` (rad), all (n,).

    The wheel's plane cuts the triangulation in a broken line. The disc rests on the point s of the
    line that lifts it most, z(s) + sqrt(radius^2 - s^2): a break, or where a straight piece is
    tangent. Exact.
    """
    require_positive("radius", radius, "m")
    px, py, angle = np.broadcast_arrays(
        *(np.atleast_1d(np.asarray(v, dtype=np.float64)) for v in (x, y, heading))
    )
    cos, sin = np.cos(angle), np.sin(angle)
    s = _breaks(ground, px, py, cos, sin, radius)  # (n, k) sorted, ends included
    z = ground.height(px[:, None] + s * cos[:, None], py[:, None] + s * sin[:, None])
    width = np.diff(s, axis=1)
    slope = np.diff(z, axis=1) / np.where(width > 1e-12, width, np.inf)
    tangent = np.clip(slope * radius / np.sqrt(1 + slope**2), s[:, :-1], s[:, 1:])
    lift = (
        z[:, :-1] + slope * (tangent - s[:, :-1]) + np.sqrt(np.maximum(radius**2 - tangent**2, 0.0))
    )
    best = np.argmax(lift, axis=1)[:, None]
    along = np.take_along_axis(tangent, best, axis=1)[:, 0]
    # the wheel's path is normal to the radius to the contact, also at a break of the line
    return WheelContact(
        np.take_along_axis(lift, best, axis=1)[:, 0],
        along,
        np.arcsin(np.clip(along / radius, -1, 1)),
    )


def _breaks(ground: HeightMap, x: Array, y: Array, cos: Array, sin: Array, radius: float) -> Array:
    """(n, k): where lines of the mesh (columns, rows, diagonals) cross each wheel, within +-radius,
    sorted."""
    u, v = (x - ground.origin[0]) / ground.spacing, (y - ground.origin[1]) / ground.spacing
    reach = radius / ground.spacing
    found = [np.full((len(x), 1), -radius), np.full((len(x), 1), radius)]
    for place, rate, least in ((u, cos, 1.0), (v, sin, 1.0), (u - v, cos - sin, np.sqrt(2.0))):
        lines = np.arange(-np.ceil(reach * least), np.ceil(reach * least) + 2)
        level = np.floor(place)[:, None] + lines
        moving = np.abs(rate) > 1e-12
        steps = (level - place[:, None]) / np.where(moving, rate, np.inf)[:, None] * ground.spacing
        found.append(np.clip(steps, -radius, radius))
    return np.sort(np.concatenate(found, axis=1), axis=1)
