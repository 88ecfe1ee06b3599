"""An outline as discs that lie inside it and reach it everywhere to within a gap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely

from trajopt.arrays import Array

GAP = 1 / 8  # of the largest disc: what discs may leave of the outline; chosen, 4 cm of 0.3 m
_STEP = 0.25  # of the gap, between places of the outline that discs must reach; chosen
_CLOSE = 1e-4  # of the longer side: how near the largest disc is to the largest there is; chosen
_SIDE = 40  # places along the longer side where discs may have their centres; chosen


@dataclass(frozen=True, eq=False)
class Cover:
    """``centres`` (J, 2), m, body frame, and ``radii`` (J,), m: inside the outline, which is nowhere
    farther than ``gap`` (m) from them. ``inner``: the largest disc that fits inside (x, y, radius)."""

    centres: Array
    radii: Array
    gap: float
    inner: tuple[float, float, float]


@lru_cache(maxsize=32)
def cover(footprint: Sequence[tuple[float, float]]) -> Cover:
    """Discs for a footprint (K corners, m, body frame), few of them: each next one is that which
    reaches most of what is left."""
    shape = shapely.Polygon(footprint)
    low, high = np.reshape(shape.bounds, (2, 2))
    spacing = float((high - low).max()) / _SIDE
    x, y = np.meshgrid(
        *(np.arange(a, b, spacing) + spacing / 2 for a, b in zip(low, high, strict=True))
    )
    centres = np.column_stack([x.ravel(), y.ravel()])
    middle = (low + high) / 2  # and on the axes of symmetry, where a rectangle's best discs are
    centres = np.vstack(
        [centres, centres * [1, 0] + [0, middle[1]], centres * [0, 1] + [middle[0], 0]]
    )
    largest = shapely.maximum_inscribed_circle(shape, tolerance=_CLOSE * float((high - low).max()))
    centres = np.vstack([shapely.get_coordinates(largest)[:1], centres])
    centres = centres[shapely.contains_xy(shape, centres[:, 0], centres[:, 1])]
    radii, best = shapely.distance(shape.exterior, shapely.points(centres)), 0
    gap = GAP * float(radii[best])
    along = np.arange(0.0, shape.exterior.length, _STEP * gap)
    edge = shapely.get_coordinates(shape.exterior.interpolate(along))
    far = np.linalg.norm(centres[:, None] - edge, axis=2)
    reached = far <= radii[:, None] + gap
    open_, chosen = np.ones(len(edge), dtype=bool), [best]
    open_ &= ~reached[best]
    while open_.any():
        gain = (reached & open_).sum(axis=1)
        if not gain.any():  # corners sharper than the grid of centres: discs of no size there
            at = int(np.argmax(open_))
            centres, radii = np.vstack([centres, edge[at]]), np.append(radii, 0.0)
            reached = np.vstack([reached, np.linalg.norm(edge - edge[at], axis=1) <= gap])
            gain = np.append(gain, 1)
        chosen.append(int(np.argmax(gain)))
        open_ &= ~reached[chosen[-1]]
    inner = (float(centres[best, 0]), float(centres[best, 1]), float(radii[best]))
    return Cover(centres[chosen], radii[chosen], gap, inner)
