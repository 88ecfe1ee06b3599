"""All that an outline keeps out of, for many poses at once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from trajopt.arrays import Array, BoolArray, IndexArray

_FAR = 10.0  # m around a space that is its outside, chosen: beyond what one step could jump
_INSIDE = "T********"  # of shapely: the interiors meet, a touch is none


@dataclass(frozen=True, eq=False)
class KeepOut:
    """``solids`` are polygons that outlines keep out of; ``names`` says of what each is a part."""

    solids: tuple[shapely.Polygon, ...]
    names: tuple[str, ...]

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(self.solids)

    def distances(self, shapes: Array) -> tuple[Array, IndexArray]:
        """(N,), (N,): distance (m) of shapely geometries from the nearest solid, 0 where they meet,
        and which solid that is; inf and -1 where there is none."""
        count = len(shapes)
        least, which = np.full(count, np.inf), np.full(count, -1, dtype=np.intp)
        if self.solids and count:
            (mine, solid), found = self._tree.query_nearest(
                shapes, return_distance=True, all_matches=False
            )
            least[mine], which[mine] = found, solid
        return least, which

    def overlaps(self, shapes: Array) -> BoolArray:
        """(N,): whether the interiors of geometry and solids meet; a touch is none."""
        met = np.zeros(len(shapes), dtype=bool)
        if self.solids and len(shapes):
            mine, solid = self._tree.query(shapes, predicate="intersects")
            deep = shapely.relate_pattern(self._tree.geometries[solid], shapes[mine], _INSIDE)
            met[mine[deep]] = True
        return met

    def within(self, area: shapely.Polygon) -> tuple[int, ...]:
        """Numbers of the solids that meet an area."""
        return tuple(sorted(self._tree.query(area, predicate="intersects").tolist()))


def outside_of(space: shapely.Polygon) -> Iterator[shapely.Polygon]:
    """Polygons without holes that cover what is not ``space``, as far as _FAR from it."""
    yield from without_holes(space.envelope.buffer(_FAR, join_style="mitre").difference(space))


def without_holes(shape: shapely.Geometry) -> Iterator[shapely.Polygon]:
    """Polygons without holes that make up a shape: cut upright through the middle of a hole until
    none is left."""
    for part in shapely.get_parts(shape):
        if part.geom_type != "Polygon" or part.area <= 0:
            continue
        if not part.interiors:
            yield part
            continue
        x0, y0, x1, y1 = part.bounds
        low, _, high, _ = part.interiors[0].bounds
        middle = (low + high) / 2
        for left, right in ((x0, middle), (middle, x1)):
            yield from without_holes(part.intersection(shapely.box(left, y0, right, y1)))
