"""Ground given by triangles: from arrays, an .obj or an .stl file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trajopt.arrays import (
    Array,
    BoolArray,
    as_numbers,
    require_between,
    require_finite,
    require_positive,
)
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.files import LARGEST_TABLE, content_of
from trajopt.paths.path import Path
from trajopt.world.ground import Line
from trajopt.world.height_map import LARGEST_GRID, HeightMap

_STEEP = 1e-9  # share of a triangle's area seen from above below which it is a wall


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles ``faces`` (F, 3) of indices into ``vertices`` (V, 3), m: the ground is what one
    sees of them from above.

    Robots drive on a height map taken from it at ``spacing`` (m): ``map``. Raises ArgumentError for
    faces that are no triangles of these vertices, numbers that are not finite, or a mesh that shows
    nothing from above.
    """

    vertices: Array
    faces: NDArray[np.intp]
    spacing: float
    grade: float = np.pi / 3
    lines: ClassVar[tuple[Line, ...]] = ()
    bends: ClassVar[bool] = True
    level: ClassVar[bool] = False

    def __post_init__(self) -> None:
        require_positive("ground.spacing", self.spacing, "m between points of the mesh's map")
        require_between("ground.grade", self.grade, 0.0, np.pi / 2, "rad")
        count = len(require_finite("ground.vertices", self.vertices, "(V, 3), m", (None, 3)))
        expected = f"indices (F, 3) from 0 to {count - 1}"
        faces = as_numbers("ground.faces", self.faces, expected, (None, 3))
        if not len(faces) or np.min(faces) < 0 or np.max(faces) >= count or np.any(faces % 1):
            raise ArgumentError("ground.faces", self.faces, expected)

    @property
    def grain(self) -> float:
        return self.map.grain

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        return self.map.height(x, y)

    def partial(self, x: ArrayLike, y: ArrayLike, i: int, j: int) -> Array:
        return self.map.partial(x, y, i, j)

    def covers(self, x: ArrayLike, y: ArrayLike) -> BoolArray:
        seen, low = self._seen, self.map.origin
        row, column = (
            (np.asarray(y) - low[1]) / self.spacing,
            (np.asarray(x) - low[0]) / self.spacing,
        )
        i, j = (
            np.clip(np.floor(v).astype(np.intp), 0, n - 2)
            for v, n in zip((row, column), seen.shape, strict=True)
        )
        whole = seen[i, j] & seen[i + 1, j] & seen[i, j + 1] & seen[i + 1, j + 1]
        return np.asarray(whole & self.map.covers(x, y))

    def check(self, path: Path) -> None:
        """Raises InfeasibleError where a path leaves the mesh, or is steeper than ``grade``."""
        self.map.check(path)
        s = np.linspace(0.0, path.length, int(2 * path.length / self.spacing) + 2)
        p = path.position(path.locate(s))
        open_ = ~self.covers(p[:, 0], p[:, 1])
        if open_.any():
            at = int(np.argmax(open_))
            raise InfeasibleError(
                "ground",
                float(s[at]),
                f"the mesh has no ground at ({p[at, 0]:.3g}, {p[at, 1]:.3g}) m",
            )

    @property
    def map(self) -> HeightMap:
        """Heights at ``spacing``; where the mesh shows nothing, those of the nearest place."""
        return self._rastered[0]

    @property
    def _seen(self) -> BoolArray:
        return self._rastered[1]

    @cached_property
    def _rastered(self) -> tuple[HeightMap, BoolArray]:
        from scipy.ndimage import distance_transform_edt

        low, high = self.vertices[:, :2].min(axis=0), self.vertices[:, :2].max(axis=0)
        cells = np.floor((high - low) / self.spacing + 1e-9) + 1
        if not np.prod(cells) <= LARGEST_GRID:  # beyond all numbers, perhaps
            expected = f"a spacing that makes at most {LARGEST_GRID} points of the mesh"
            raise ArgumentError("ground.spacing", self.spacing, expected)
        columns, rows = cells.astype(int)
        heights = np.full((rows, columns), -np.inf)
        for corners in self.vertices[self.faces]:
            _paint(heights, (corners - [*low, 0.0]) / [self.spacing, self.spacing, 1.0])
        seen = np.isfinite(heights)
        if not seen.any():
            raise ArgumentError("ground.faces", len(self.faces), "triangles that show from above")
        nearest = distance_transform_edt(~seen, return_distances=False, return_indices=True)
        origin = (float(low[0]), float(low[1]))
        return HeightMap(heights[tuple(nearest)], self.spacing, origin, self.grade), seen


def _paint(heights: Array, corners: Array) -> None:
    """Raises the grid points that a triangle covers to its height: corners (3, 3) in cells, cells,
    m."""
    (x0, y0, _), (x1, y1, _), (x2, y2, _) = corners
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    reach = max(np.ptp(corners[:, 0]), np.ptp(corners[:, 1]))
    if abs(area) <= _STEEP * reach**2:
        return
    first = np.maximum(np.ceil(corners[:, :2].min(axis=0) - 1e-9).astype(int), 0)
    last = np.floor(corners[:, :2].max(axis=0) + 1e-9).astype(int) + 1
    here = heights[first[1] : last[1], first[0] : last[0]]
    y, x = np.mgrid[first[1] : first[1] + here.shape[0], first[0] : first[0] + here.shape[1]]
    b = ((x - x0) * (y2 - y0) - (x2 - x0) * (y - y0)) / area
    c = ((x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)) / area
    inside = (b >= -1e-9) & (c >= -1e-9) & (b + c <= 1 + 1e-9)
    z = corners[0, 2] * (1 - b - c) + corners[1, 2] * b + corners[2, 2] * c
    here[inside] = np.maximum(here[inside], z[inside])


def load_mesh(file: str | FilePath, spacing: float, *, grade: float = np.pi / 3) -> Mesh:
    """Mesh of an .obj or .stl file (text or binary), z up, m; ``spacing`` and ``grade`` as in
    ``Mesh``.

    Raises ArgumentError, naming the file, where it is missing or holds no triangles.
    """
    path = FilePath(file)
    readers = {".obj": _from_obj, ".stl": _from_stl}
    if path.suffix.lower() not in readers or not path.is_file():
        raise ArgumentError("ground.file", str(path), "an existing .obj or .stl file")
    try:
        vertices, faces = readers[path.suffix.lower()](path)
    except (OSError, ValueError, IndexError, OverflowError) as error:
        raise ArgumentError("ground.file", str(path), f"triangles ({error})") from error
    if not len(faces):
        raise ArgumentError("ground.file", str(path), "at least one triangle")
    return Mesh(vertices, faces, spacing, grade)


def _from_obj(path: FilePath) -> tuple[Array, NDArray[np.intp]]:
    """Lines ``v x y z`` and ``f a b c ...`` (from 1, or back from the last); polygons fan out."""
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    for line in content_of(path, LARGEST_TABLE).decode().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(w) for w in words[1:4]])
        elif words[:1] == ["f"]:
            index = [int(w.split("/")[0]) for w in words[1:]]
            index = [i - 1 if i > 0 else len(vertices) + i for i in index]
            faces += [[index[0], index[k], index[k + 1]] for k in range(1, len(index) - 1)]
    return np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.intp).reshape(-1, 3)


def _from_stl(path: FilePath) -> tuple[Array, NDArray[np.intp]]:
    """Binary: 80 bytes, a count, 50 bytes a triangle; text: lines ``vertex x y z``."""
    data = content_of(path, LARGEST_TABLE)
    count = int.from_bytes(data[80:84], "little")
    if len(data) == 84 + 50 * count:
        kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("tag", "<u2")])
        vertices = np.frombuffer(data, kind, count, 84)["corners"].reshape(-1, 3)
    else:
        words = [line.split() for line in data.decode("ascii").splitlines()]
        rows = [[float(w) for w in word[1:4]] for word in words if word[:1] == ["vertex"]]
        vertices = np.array(rows, dtype=np.float64).reshape(-1, 3)
    whole = len(vertices) // 3 * 3
    return np.asarray(vertices[:whole], np.float64), np.arange(whole, dtype=np.intp).reshape(-1, 3)
