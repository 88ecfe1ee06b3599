"""How near a robot's outline comes to what it keeps out of, along the whole path.

Distances between polygons are exact at the places looked at. Between two of them, a and b, no point
of the outline moves farther than M, the integral of |dp| + reach |d yaw|, so nowhere between can it
be nearer than (d_a + d_b - M) / 2. Intervals are halved until that bound is close enough. M is
itself bounded by ``Path.swept``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from trajopt.arrays import Array, IndexArray
from trajopt.paths.path import Path
from trajopt.world.crossing import depth_of, outlines_at
from trajopt.world.keep_out import KeepOut

TOLERANCE = 1e-3  # m between the least distance found and its bound; chosen
_FIRST = 4  # places a segment of the spline, at first; chosen
_MOST_PLACES = 400_000  # chosen: where turning is too sharp for the bound it ends here
_MOST_ROUNDS = 40  # halvings: below rounding


@dataclass(frozen=True)
class Clearance:
    """The least ``distance`` (m) of the outline from what it keeps out of, where it was found: at
    path parameter ``s`` (m), at ``pose`` (x, y, yaw), from ``name``. Negative: minus the depth of an
    overlap. Nowhere on the path is it less than ``bound`` (m): between places too. inf where there
    is nothing to keep out of."""

    distance: float
    bound: float
    s: float
    pose: tuple[float, float, float]
    name: str

    def __str__(self) -> str:
        if self.distance < 0:
            return (
                f"the outline is {-self.distance:.3f} m inside '{self.name}' at s = {self.s:.3f} m"
            )
        return (
            f"the outline comes as near as {self.distance:.3f} m to '{self.name}' at "
            f"s = {self.s:.3f} m"
        )


def path_clearance(
    path: Path,
    footprint: Sequence[tuple[float, float]],
    keep_out: KeepOut,
    *,
    enough: float = np.inf,
    tolerance: float = TOLERANCE,
) -> Clearance:
    """Clearance of a ``footprint`` (K, 2), m, body frame, along a path in the ground plan.

    ``distance`` - ``bound`` is at most ``tolerance`` (m), unless the outline overlaps something, or
    the bound is ``enough`` (m) already.
    """
    reach = float(np.hypot(*np.transpose(footprint)).max())
    knots = np.asarray(path.basis.knots)
    share = np.arange(_FIRST) / _FIRST
    u = np.append((knots[:-1, None] + np.diff(knots)[:, None] * share).ravel(), knots[-1])
    d, which = outline_distances(path, u, footprint, keep_out)
    for _ in range(_MOST_ROUNDS):
        travel = path.swept(u[:-1], u[1:], reach)
        bound = (d[:-1] + d[1:] - travel) / 2
        open_ = bound < min(d.min() - tolerance, enough)
        middle = (u[:-1] + u[1:]) / 2
        open_ &= (middle > u[:-1]) & (middle < u[1:])
        if not (d.min() > 0 and open_.any()) or len(u) > _MOST_PLACES:
            break
        fresh = middle[open_]
        more, what = outline_distances(path, fresh, footprint, keep_out)
        order = np.argsort(np.concatenate([u, fresh]), kind="stable")
        u, d = np.concatenate([u, fresh])[order], np.concatenate([d, more])[order]
        which = np.concatenate([which, what])[order]
    at = int(np.argmin(d))
    place, yaw = path.position(u[[at]])[0], float(path.yaw(u[[at]])[0])
    return Clearance(
        float(d[at]),
        float(min(bound.min(), d[at])),
        float(path.parameter(u[[at]])[0]),
        (float(place[0]), float(place[1]), yaw),
        keep_out.names[which[at]] if which[at] >= 0 else "",
    )


def outline_distances(
    path: Path, u: Array, footprint: Sequence[tuple[float, float]], keep_out: KeepOut
) -> tuple[Array, IndexArray]:
    """Distances at spline parameters (N,), minus the depth where interiors meet; nearest solids."""
    outlines = shapely.polygons(outlines_at(path.position(u)[:, :2], path.yaw(u), footprint))
    d, which = keep_out.distances(outlines)
    for i in np.flatnonzero(d <= 0.0):
        met = keep_out.within(outlines[i])
        depths = [depth_of(keep_out.solids[k], outlines[i]) for k in met]
        d[i], which[i] = -max(depths), met[int(np.argmax(depths))]
    return d, which
