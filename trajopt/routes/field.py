"""Distance from what is kept out of, on a grid, and smoothly between its points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from trajopt.arrays import Array, rotation
from trajopt.world.scene import Scene

SPACING = 0.05  # m between grid points; chosen
MOST_POINTS = 160_000  # of a field whose distances are those of polygons; chosen: 0.5 s
MOST_CELLS = 1_000_000  # of a field made finer where it is narrow; chosen
_AROUND = 4.0  # m around start and goal where nothing bounds the scene; chosen
_BEYOND = 3.0  # m that a field reaches beyond the points it was asked around; chosen


@dataclass(frozen=True, eq=False)
class Field:
    """``distance`` (R, C), m, at points ``spacing`` m apart, from the nearest thing to keep out of,
    negative inside. ``origin`` (x, y, yaw) is the pose of point [0, 0]; rows go along its y."""

    distance: Array
    spacing: float
    origin: tuple[float, float, float]

    def grid(self, places: Array) -> Array:
        """(N, 2): column and row, with fractions, of places (N, 2) in the world."""
        local = (places - self.origin[:2]) @ rotation(self.origin[2])
        return np.asarray(local / self.spacing)

    def world(self, cells: Array) -> Array:
        """(N, 2): places of columns and rows (N, 2)."""
        return np.asarray((cells * self.spacing) @ rotation(self.origin[2]).T + self.origin[:2])

    def at(self, places: Array) -> Array:
        """(N,): distance at places, linear between grid points, that of the border beyond."""
        from scipy.ndimage import map_coordinates

        column, row = self.grid(places).T
        return np.asarray(map_coordinates(self.distance, [row, column], order=1, mode="nearest"))

    def cropped(self, places: Array, beyond: float = _BEYOND) -> Field:
        """The part around places (N, 2)."""
        cells = self.grid(places)
        room = int(np.ceil(beyond / self.spacing))
        size = np.array(self.distance.shape[::-1])
        low = np.clip(np.floor(cells.min(axis=0)).astype(int) - room, 0, size - 2)
        high = np.clip(np.ceil(cells.max(axis=0)).astype(int) + room, low + 2, size)
        x, y = self.world(low[None].astype(np.float64))[0].tolist()
        part = self.distance[low[1] : high[1], low[0] : high[0]]
        return Field(part, self.spacing, (x, y, self.origin[2]))

    def roomiest(self, places: Array) -> Array:
        """(N,): largest distance at the grid points around places (N, 2)."""
        from scipy.ndimage import maximum_filter

        column, row = np.rint(self.grid(places)).astype(np.intp).T
        most = maximum_filter(self.distance, 3, mode="nearest")
        rows, columns = self.distance.shape
        return np.asarray(most[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)])

    def finer(self, scene: Scene, spacing: float, places: Array, reach: float) -> Field:
        """The same at a smaller ``spacing`` (m), distances anew within ``reach`` (m) of places."""
        from scipy.ndimage import map_coordinates

        rows, columns = self.distance.shape
        size = np.array([columns - 1, rows - 1]) * self.spacing
        spacing = max(spacing, float(np.sqrt(np.prod(size) / MOST_CELLS)))
        count = np.floor(size / spacing).astype(int) + 1
        row, column = np.mgrid[: count[1], : count[0]] * (spacing / self.spacing)
        d = map_coordinates(self.distance, [row, column], order=1, mode="nearest")
        world = self.world(np.column_stack([column.ravel(), row.ravel()]))
        near = shapely.contains_xy(shapely.MultiPoint(places).buffer(reach, 4), *world.T)
        exact, _ = scene.keep_out.distances(shapely.points(world[near]))
        flat = d.ravel()
        flat[near] = np.where(exact > 0, exact, np.minimum(flat[near], 0.0))
        return Field(flat.reshape(d.shape), spacing, self.origin)

    def coarse(self, most: int) -> Field:
        """The largest distance in blocks of points, with at most about ``most`` blocks: a disc fits
        somewhere in a block exactly where it fits at one of its points."""
        factor = int(np.ceil(np.sqrt(self.distance.size / most)))
        if factor <= 1:
            return self
        rows, columns = (-(-n // factor) for n in self.distance.shape)
        padded = np.full((rows * factor, columns * factor), -np.inf)
        padded[: self.distance.shape[0], : self.distance.shape[1]] = self.distance
        blocks = padded.reshape(rows, factor, columns, factor).max(axis=(1, 3))
        x, y = self.world(np.full((1, 2), (factor - 1) / 2))[0].tolist()
        return Field(blocks, self.spacing * factor, (x, y, self.origin[2]))

    @cached_property
    def _coefficients(self) -> Array:
        from scipy.ndimage import spline_filter

        return np.asarray(
            np.pad(spline_filter(self.distance, order=3, mode="mirror"), 2, "reflect")
        )

    def smooth(self, places: Array) -> Array:
        """(6, N): value of the cubic B-spline through the distances, and its derivatives by x, y,
        xx, xy, yy in the world. Beyond the grid the border's value goes on, flat."""
        cells, size = self.grid(places), np.array(self.distance.shape[::-1])
        inside = np.clip(cells, 0.0, size - 1 - 1e-9)
        first = np.floor(inside).astype(np.intp)
        (bx, by), free = _basis(inside - first), (cells == inside).all(axis=1)
        column = first[:, 0, None] + np.arange(1, 5)  # two rows are padding, one is left of it
        row = first[:, 1, None] + np.arange(1, 5)
        block = self._coefficients[row[:, :, None], column[:, None, :]]
        along = np.matmul(block, bx.transpose(1, 2, 0))
        grid = np.matmul(by.transpose(1, 0, 2), along)  # (N, 3, 3): derivatives by y, by x
        found = grid[:, (0, 0, 1, 0, 1, 2), (0, 1, 0, 2, 1, 0)].T.copy()
        found[1:] *= free
        turn = rotation(self.origin[2])
        slope = turn @ (found[1:3] / self.spacing)
        bend = np.array([[found[3], found[4]], [found[4], found[5]]]) / self.spacing**2
        bend = np.einsum("ij,jkn,lk->iln", turn, bend, turn)
        return np.stack([found[0], *slope, bend[0, 0], bend[0, 1], bend[1, 1]])


def _basis(t: Array) -> Array:
    """(2, 3, N, 4): for x and y the four cubic B-spline weights and their first two derivatives at
    shares t (N, 2) of a cell."""
    t = t.T[..., None]
    s = 1 - t
    weights = [s**3 / 6, (3 * t**3 - 6 * t**2 + 4) / 6, (3 * s**3 - 6 * s**2 + 4) / 6, t**3 / 6]
    first = [-(s**2) / 2, (9 * t**2 - 12 * t) / 6, -(9 * s**2 - 12 * s) / 6, t**2 / 2]
    second = [s, 3 * t - 2, 3 * s - 2, t]
    return np.stack([np.concatenate(part, axis=-1) for part in (weights, first, second)], axis=1)


def field_of(scene: Scene, ends: Array) -> Field:
    """The field of a scene, at least around ``ends`` (N, 2), the places it has to join."""
    if scene.map is not None:
        return _with_map(scene)
    corners = [ends - _AROUND, ends + _AROUND]
    solids = scene.keep_out.solids
    if scene.space is not None:
        corners = [shapely.get_coordinates(scene.space)]
    elif solids:
        bounds = shapely.total_bounds(list(solids))
        corners += [bounds[:2][None] - _AROUND, bounds[2:][None] + _AROUND]
    low, high = np.vstack(corners).min(axis=0) - SPACING, np.vstack(corners).max(axis=0) + SPACING
    spacing = max(SPACING, float(np.sqrt(np.prod(high - low) / MOST_POINTS)))
    count = np.ceil((high - low) / spacing).astype(int) + 1
    field = Field(np.zeros(count[::-1]), spacing, (float(low[0]), float(low[1]), 0.0))
    return Field(_distances(scene, field), field.spacing, field.origin)


def _distances(scene: Scene, field: Field) -> Array:
    """(R, C): distances of the grid points from the solids; inside, minus that from the nearest
    point outside, less half a spacing."""
    from scipy.ndimage import distance_transform_edt

    rows, columns = field.distance.shape
    row, column = np.mgrid[:rows, :columns]
    places = field.world(np.column_stack([column.ravel(), row.ravel()]).astype(np.float64))
    d, _ = scene.keep_out.distances(shapely.points(places))
    d = d.reshape(rows, columns)
    inside = d <= 0.0
    if inside.any() and not inside.all():
        depth = distance_transform_edt(inside) * field.spacing - field.spacing / 2
        d = np.where(inside, -depth, d)
    return np.where(np.isfinite(d), d, 1e3)


def _with_map(scene: Scene) -> Field:
    """At the middles of a map's cells: distance from occupied cells (exact across their sides),
    what lies beyond the map among them, and from all else."""
    from dataclasses import replace

    from scipy.ndimage import distance_transform_edt

    cells = scene.map
    assert cells is not None
    filled = np.pad(cells.occupied, 1, constant_values=True)
    outside = distance_transform_edt(~filled)[1:-1, 1:-1] - 0.5
    depth = distance_transform_edt(filled)[1:-1, 1:-1] - 0.5
    d = np.where(cells.occupied, -depth, outside) * cells.resolution
    x, y = cells.world(np.full((1, 2), cells.resolution / 2))[0].tolist()
    field = Field(d, cells.resolution, (x, y, cells.origin[2]))
    rest = replace(scene, map=None)
    if not rest.keep_out.solids:
        return field
    return Field(np.minimum(d, _distances(rest, field)), field.spacing, field.origin)
