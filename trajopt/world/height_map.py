"""Ground given by heights on a regular grid.

Two surfaces pass through the grid's points. Physics, and the wheels of [udengaard2008], roll on the
triangulated one: each cell is split along the diagonal from its lower-left to its upper-right
corner, and beyond the grid the ground goes on level at the height of its edge. Postures follow a
smooth one, a spline of fifth degree, whose derivatives are continuous up to the fourth.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import (
    Array,
    BoolArray,
    as_numbers,
    require_between,
    require_finite,
    require_positive,
)
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path
from trajopt.world.ground import Line

LARGEST_GRID = 4_000_000  # points; 32 MB as doubles, a 40 m square at 2 cm; chosen
_CHECKS_PER_CELL = 2  # path samples a grid cell when slopes are checked; chosen
_PLANE = 1e-9  # m, chosen: a map whose second differences are smaller is plane
_DEGREE = 5  # of the smooth surface: its fourth derivatives, which steering needs, are continuous


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
    lines: ClassVar[tuple[Line, ...]] = ()
    bends: ClassVar[bool] = True
    level: ClassVar[bool] = False

    def __post_init__(self) -> None:
        require_grid("ground.heights", self.heights)
        require_positive("ground.spacing", self.spacing, "m between grid points")
        require_finite("ground.origin", self.origin, "m", (2,))
        require_between("ground.grade", self.grade, 0.0, np.pi / 2, "rad")

    @property
    def size(self) -> tuple[float, float]:
        """Extent in x and y, m."""
        rows, columns = self.heights.shape
        return (columns - 1) * self.spacing, (rows - 1) * self.spacing

    @cached_property
    def grain(self) -> float:
        bend = (np.abs(np.diff(self.heights, 2, axis=k)).max(initial=0.0) for k in (0, 1))
        twist = np.abs(np.diff(np.diff(self.heights, axis=0), axis=1)).max()
        return self.spacing if max(*bend, twist) > _PLANE else np.inf

    def partial(self, x: ArrayLike, y: ArrayLike, i: int, j: int) -> Array:
        """d^(i+j) h / dx^i dy^j of the smooth surface, which passes through all grid points."""
        px, py = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        rows, columns = self.heights.shape
        if i > min(_DEGREE, columns - 1) or j > min(_DEGREE, rows - 1):
            return np.zeros(px.shape)
        return np.asarray(self._spline.ev(py, px, dx=j, dy=i))

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import RectBivariateSpline

        rows, columns = self.heights.shape
        return RectBivariateSpline(
            self.origin[1] + self.spacing * np.arange(rows),
            self.origin[0] + self.spacing * np.arange(columns),
            self.heights,
            kx=min(_DEGREE, rows - 1),
            ky=min(_DEGREE, columns - 1),
        )

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

    def covers(self, x: ArrayLike, y: ArrayLike) -> BoolArray:
        sides = zip((x, y), self.origin, self.size, strict=True)
        inside = [np.abs(np.asarray(v) - a - n / 2) <= n / 2 + 1e-9 for v, a, n in sides]
        return np.asarray(inside[0] & inside[1])

    def check(self, path: Path) -> None:
        """Raises InfeasibleError with place where a path leaves the map, or is steeper than
        ``grade``."""
        count = int(path.length / self.spacing * _CHECKS_PER_CELL) + 2
        s = np.linspace(0.0, path.length, count)
        p = path.position(path.locate(s))
        low = np.asarray(self.origin)
        outside = ~self.covers(p[:, 0], p[:, 1])
        if outside.any():
            i = int(np.argmax(outside))
            x1, y1 = low + self.size
            raise InfeasibleError(
                "ground",
                float(s[i]),
                f"the path leaves the height map at ({p[i, 0]:.3g}, {p[i, 1]:.3g}) m; "
                f"the map covers x {low[0]:g} to {x1:g}, y {low[1]:g} to {y1:g} m",
            )
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


def require_grid(argument: str, heights: Array) -> None:
    """Raises ArgumentError unless ``heights`` (rows, columns) make a map."""
    expected = "heights of shape (rows, columns), at least 2 x 2"
    shape = as_numbers(argument, heights, expected, (None, None)).shape
    if min(shape) < 2:
        raise ArgumentError(argument, shape, expected)
    if shape[0] * shape[1] > LARGEST_GRID:
        too_large(argument, shape)
    if not np.all(np.isfinite(heights)):
        i, j = np.argwhere(~np.isfinite(heights))[0]
        raise ArgumentError(
            argument, f"{heights[i, j]} at row {i}, column {j}", "finite heights, m"
        )


def too_large(argument: str, shape: tuple[int, ...]) -> None:
    """The ArgumentError for a map with more points than memory should hold."""
    raise ArgumentError(
        argument, shape, f"at most {LARGEST_GRID} grid points; coarsen or crop the map"
    )
