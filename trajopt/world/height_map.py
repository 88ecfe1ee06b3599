"""Ground given by heights on a regular grid, triangulated: from an array, a .npy file or a PNG
picture.

Each grid cell is split along the diagonal from its lower-left to its upper-right corner. Beyond the
grid the ground goes on level at the height of its edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, require_finite, require_positive
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path

LARGEST_GRID = 4_000_000  # points; 32 MB as doubles, a 40 m square at 2 cm; chosen
_CHECKS_PER_CELL = 2  # path samples a grid cell when slopes are checked; chosen


@dataclass(frozen=True, eq=False)
class HeightMap:
    """``heights`` (rows, columns), m: row i at y = origin_y + i spacing, column j at x = origin_x +
    j spacing.

    ``grade`` (rad): a path on it may nowhere be steeper. Raises ArgumentError for fewer than 2 x 2
    points, more than 4 million, numbers that are not finite, or a spacing that is not positive.
    """

    heights: Array
    spacing: float
    origin: tuple[float, float] = (0.0, 0.0)
    grade: float = np.pi / 3

    def __post_init__(self) -> None:
        _require_grid("terrain.heights", self.heights)
        require_positive("terrain.spacing", self.spacing, "m between grid points")
        require_finite("terrain.origin", self.origin, "m")
        if not 0 < self.grade < np.pi / 2:
            raise ArgumentError("terrain.grade", self.grade, "an angle between 0 and pi/2 rad")

    @property
    def size(self) -> tuple[float, float]:
        """Extent in x and y, m."""
        rows, columns = self.heights.shape
        return (columns - 1) * self.spacing, (rows - 1) * self.spacing

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Height of the triangulated surface, m, at world positions of any shape."""
        z, a, b, _, _ = self._cell(x, y)
        upper = np.where(
            b > a,
            z[0] + b * (z[2] - z[0]) + a * (z[3] - z[2]),
            z[0] + a * (z[1] - z[0]) + b * (z[3] - z[1]),
        )
        return np.asarray(upper)

    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """(dz/dx, dz/dy) of the triangle at world positions; 0 across the edge beyond the grid."""
        z, a, b, in_x, in_y = self._cell(x, y)
        left = b > a
        slope_x = np.where(left, z[3] - z[2], z[1] - z[0]) / self.spacing
        slope_y = np.where(left, z[2] - z[0], z[3] - z[1]) / self.spacing
        return np.where(in_x, slope_x, 0.0), np.where(in_y, slope_y, 0.0)

    def check(self, path: Path) -> None:
        """Raises InfeasibleError with place and angle where a path is steeper than ``grade``."""
        count = int(path.length / self.spacing * _CHECKS_PER_CELL) + 2
        s = np.linspace(0.0, path.length, count)
        p = path.position(path.locate(s))
        run = np.hypot(*np.diff(p[:, :2], axis=0).T)
        rise = np.abs(np.diff(self.height(p[:, 0], p[:, 1])))
        angle = np.arctan2(rise, np.where(run > 0, run, np.inf))
        i = int(np.argmax(angle))
        if angle[i] > self.grade:
            raise InfeasibleError(
                "grade",
                float(s[i]),
                f"the ground at ({p[i, 0]:.3g}, {p[i, 1]:.3g}) m is {np.degrees(angle[i]):.3g} deg "
                f"steep along the path, {np.degrees(self.grade):.3g} deg are allowed",
            )

    def _cell(
        self, x: ArrayLike, y: ArrayLike
    ) -> tuple[tuple[Array, ...], Array, Array, Array, Array]:
        """Corner heights (lower left, lower right, upper left, upper right), position inside the
        cell, and whether the position is inside the grid in x and in y."""
        px, py = np.broadcast_arrays(
            np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        )
        if not (np.all(np.isfinite(px)) and np.all(np.isfinite(py))):
            raise ArgumentError(
                "x, y", (px[:3].tolist() if px.ndim else float(px),), "finite positions, m"
            )
        rows, columns = self.heights.shape
        u, v = (px - self.origin[0]) / self.spacing, (py - self.origin[1]) / self.spacing
        cu, cv = np.clip(u, 0.0, columns - 1.0), np.clip(v, 0.0, rows - 1.0)
        j = np.minimum(cu.astype(np.intp), columns - 2)
        i = np.minimum(cv.astype(np.intp), rows - 2)
        z = self.heights
        return (
            (z[i, j], z[i, j + 1], z[i + 1, j], z[i + 1, j + 1]),
            cu - j,
            cv - i,
            cu == u,
            cv == v,
        )


def load_height_map(
    file: str | FilePath,
    spacing: float,
    *,
    origin: tuple[float, float] = (0.0, 0.0),
    relief: float | None = None,
    grade: float = np.pi / 3,
) -> HeightMap:
    """Height map from a .npy file (heights in m) or a PNG (grey levels; ``relief`` m is the height
    of white).

    The first row of a PNG is its upper edge (largest y). Raises ArgumentError, naming the file,
    where it is missing, empty, no picture or array, not two-dimensional, huge, or not finite.
    """
    path = FilePath(file)
    if not path.is_file():
        raise ArgumentError("terrain.file", str(path), "an existing .npy or .png file")
    if path.stat().st_size == 0:
        raise ArgumentError("terrain.file", str(path), "a file that is not empty")
    if path.suffix.lower() == ".npy":
        heights = _from_npy(path)
    elif path.suffix.lower() == ".png":
        if relief is None or not np.isfinite(relief):
            raise ArgumentError(
                "terrain.relief", relief, "the height of white, m: a PNG has no unit"
            )
        heights = _from_png(path) * relief
    else:
        raise ArgumentError("terrain.file", str(path), "a name that ends in .npy or .png")
    _require_grid(f"terrain.file {path.name}", heights)
    return HeightMap(heights, spacing, origin, grade)


def _from_npy(path: FilePath) -> Array:
    try:
        mapped = np.load(
            path, mmap_mode="r", allow_pickle=False
        )  # a huge file is refused before it is read
    except (ValueError, EOFError, OSError) as error:
        raise ArgumentError(
            "terrain.file", str(path), f"a .npy array of numbers ({error})"
        ) from error
    if mapped.dtype.kind not in "fiu":
        raise ArgumentError(
            "terrain.file", str(path), f"real numbers (this one holds {mapped.dtype})"
        )
    if mapped.ndim == 2 and mapped.size > LARGEST_GRID:
        _too_large(str(path), mapped.shape)
    return np.array(mapped, dtype=np.float64)


def _from_png(path: FilePath) -> Array:
    """Grey levels 0..1, row 0 at the lower edge."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as picture:
            if picture.width * picture.height > LARGEST_GRID:
                _too_large(str(path), (picture.height, picture.width))
            deep = picture.mode in ("I", "I;16", "I;16B")
            grey = np.asarray(picture if deep else picture.convert("L"), dtype=np.float64)
    except (UnidentifiedImageError, OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise ArgumentError("terrain.file", str(path), f"a readable PNG ({error})") from error
    return np.asarray(grey[::-1] / (65535.0 if deep else 255.0))


def _require_grid(argument: str, heights: Array) -> None:
    shape = np.shape(heights)
    if len(shape) != 2 or min(shape) < 2:
        raise ArgumentError(argument, shape, "heights of shape (rows, columns), at least 2 x 2")
    if shape[0] * shape[1] > LARGEST_GRID:
        _too_large(argument, shape)
    if not np.all(np.isfinite(heights)):
        i, j = np.argwhere(~np.isfinite(heights))[0]
        raise ArgumentError(
            argument, f"{heights[i, j]} at row {i}, column {j}", "finite heights, m"
        )


def _too_large(argument: str, shape: tuple[int, ...]) -> None:
    raise ArgumentError(
        argument, shape, f"at most {LARGEST_GRID} grid points; coarsen or crop the map"
    )
