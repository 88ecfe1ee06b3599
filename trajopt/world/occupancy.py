"""Occupancy maps as ROS's ``map_server`` writes them: a YAML file and a picture of cells."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from trajopt.arrays import Array, BoolArray, as_numbers, require_finite, require_positive, rotation
from trajopt.errors import ArgumentError
from trajopt.files import content_of

LARGEST_PICTURE = 100_000_000  # bytes; chosen, twenty times a 2,000 x 2,000 map
MOST_CELLS = 25_000_000  # chosen: 5,000 x 5,000
_LARGEST_YAML = 100_000  # bytes; chosen, a hundred times what map_server writes
_KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_MODES = ("trinary", "scale", "raw")
_WHITE = 255.0  # grey level of a picture's white


@dataclass(frozen=True, eq=False)
class OccupancyMap:
    """Square cells of ``resolution`` m that are ``occupied`` (R, C), row 0 at the least y of the
    map's own axes; ``origin`` (x, y, yaw) is the world's pose of its lower left corner, m and rad.

    Raises ArgumentError for another shape, a size that is none, or a pose that is not finite.
    """

    occupied: BoolArray
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        cells = self.occupied
        if not (isinstance(cells, np.ndarray) and cells.dtype == bool and cells.ndim == 2):
            raise ArgumentError("map.occupied", type(cells).__name__, "a bool array (R, C)")
        if not 0 < cells.size <= MOST_CELLS:
            raise ArgumentError("map.occupied", cells.shape, f"1 to {MOST_CELLS:,} cells")
        require_positive("map.resolution", self.resolution, "m")
        require_finite("map.origin", self.origin, "x, y, yaw", (3,))

    def world(self, places: Array) -> Array:
        """(..., 2): places of the map's axes, m from its corner, in the world."""
        return np.asarray(places @ rotation(self.origin[2]).T + self.origin[:2])

    @cached_property
    def corners(self) -> Array:
        """(4, 2): of the whole map in the world, counter-clockwise, m."""
        rows, columns = self.occupied.shape
        box = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]]) * self.resolution
        return self.world(box.astype(np.float64))

    @cached_property
    def boxes(self) -> Array:
        """(B, 4): low x, low y, high x, high y (m, the map's axes) of rectangles that cover the
        occupied cells and no other: runs along rows, joined where the next row has the same."""
        rows, columns = self.occupied.shape
        padded = np.zeros((rows, columns + 2), dtype=np.int8)
        padded[:, 1:-1] = self.occupied
        edges = np.diff(padded, axis=1)
        row, first = np.nonzero(edges == 1)
        _, after = np.nonzero(edges == -1)
        order = np.lexsort((row, after, first))
        row, first, after = row[order], first[order], after[order]
        fresh = np.ones(len(row), dtype=bool)
        if len(row):
            same = (np.diff(first) == 0) & (np.diff(after) == 0) & (np.diff(row) == 1)
            fresh[1:] = ~same
        start = np.flatnonzero(fresh)
        last = np.append(start[1:], len(row)) - 1 if len(start) else start
        cells = np.column_stack([first[start], row[start], after[start], row[last] + 1])
        return np.asarray(cells * self.resolution, dtype=np.float64)

    @cached_property
    def polygons(self) -> Array:
        """(B, 4, 2): ``boxes`` in the world, counter-clockwise, m."""
        x0, y0, x1, y1 = self.boxes.T
        corners = np.stack([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]).transpose(2, 0, 1)
        return self.world(corners)


def load_map(file: str | FilePath, *, unknown: str = "occupied") -> OccupancyMap:
    """Map of a ``map_server`` YAML file; its picture is looked for beside it.

    With occupancy p = (255 - grey) / 255, or grey / 255 with ``negate``, a cell is occupied above
    ``occupied_thresh``, free below ``free_thresh``, unknown between, and ``unknown`` ("occupied" or
    "free") says what that counts as. Mode "scale" is the same but for cells that the picture's
    alpha channel leaves out, which are unknown; in mode "raw" grey levels are occupancies in
    per cent, above 100 unknown. Raises ArgumentError, naming file and key.
    """
    if unknown not in ("occupied", "free"):
        raise ArgumentError("unknown", unknown, "occupied or free")
    path = FilePath(file)
    keys = _yaml(path)
    grey, seen = _picture(path.parent / keys["image"], path)
    mode, share = keys["mode"], grey / _WHITE if keys["negate"] else 1.0 - grey / _WHITE
    if mode == "raw":
        share, seen = grey / 100.0, seen & (grey <= 100.0)
    if mode == "trinary":
        seen = np.ones_like(seen)
    filled = seen & (share > keys["occupied_thresh"])
    if unknown == "occupied":
        filled |= ~(seen & (share < keys["free_thresh"]))
    return OccupancyMap(filled[::-1].copy(), keys["resolution"], keys["origin"])


def parts_of(file: FilePath) -> tuple[FilePath, ...]:
    """The file and, of a ``map_server`` file, its picture. Raises ArgumentError."""
    if file.suffix.lower() not in (".yaml", ".yml"):
        return (file,)
    return file, file.parent / _yaml(file)["image"]


def stored(file: FilePath, name: str) -> dict[str, bytes]:
    """What a copy of a map under ``name`` (its YAML file) holds, by file name, with the picture
    beside it."""
    import yaml

    keys, picture = _yaml(file), parts_of(file)[1]
    image = f"{FilePath(name).stem}_picture{picture.suffix}"
    text = yaml.safe_dump({**keys, "origin": list(keys["origin"]), "image": image})
    return {name: text.encode(), image: picture.read_bytes()}


def _yaml(path: FilePath) -> dict[str, Any]:
    """The keys, checked. Raises ArgumentError, naming file and key."""
    import yaml

    try:
        found = yaml.safe_load(content_of(path, _LARGEST_YAML).decode())
    except FileNotFoundError:
        raise ArgumentError(str(path), "missing", "a map_server file (*.yaml)") from None
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        raise ArgumentError(str(path), str(error), "a map_server file (*.yaml)") from None
    if not isinstance(found, dict):
        raise ArgumentError(str(path), found, "keys " + ", ".join(_KEYS))

    def wrong(key: str, expected: str) -> ArgumentError:
        return ArgumentError(f"{path}: {key}", found.get(key, "missing"), expected)

    for key in found:
        if key not in (*_KEYS, "mode"):
            raise ArgumentError(f"{path}: {key}", found[key], f"one of {', '.join(_KEYS)}, mode")
    for key in _KEYS:
        if key not in found:
            raise wrong(key, "this key to be given")
    if not isinstance(found["image"], str) or not found["image"]:
        raise wrong("image", "the name of a picture, from the file's folder")
    require_positive(f"{path}: resolution", found["resolution"], "m")
    origin = require_finite(f"{path}: origin", found["origin"], "x, y, yaw", (3,))
    if isinstance(found["negate"], float) or found["negate"] not in (0, 1):
        raise wrong("negate", "0 or 1")
    for key in ("occupied_thresh", "free_thresh"):
        if not 0 <= as_numbers(f"{path}: {key}", found[key], "a number from 0 to 1", ()) <= 1:
            raise wrong(key, "a number from 0 to 1")
    if not found["free_thresh"] <= found["occupied_thresh"]:
        raise wrong("free_thresh", f"at most occupied_thresh = {found['occupied_thresh']}")
    mode = found.setdefault("mode", "trinary")
    if mode not in _MODES:
        raise wrong("mode", "one of " + ", ".join(_MODES))
    return {
        **found,
        "resolution": float(found["resolution"]),
        "origin": (float(origin[0]), float(origin[1]), math.remainder(origin[2], math.tau)),
    }


def _picture(file: FilePath, source: FilePath) -> tuple[Array, BoolArray]:
    """Grey levels 0 to 255 (R, C), row 0 at the top, and where the alpha channel is full. Raises
    ArgumentError, naming the YAML file ``source``."""
    import io

    from PIL import Image

    where, expected = f"{source}: image", "a picture (PGM, PNG) of 8-bit grey or colour"
    try:
        with Image.open(io.BytesIO(content_of(file, LARGEST_PICTURE))) as picture:
            if picture.width * picture.height > MOST_CELLS:
                size = f"{picture.width} x {picture.height}"
                raise ArgumentError(where, size, f"at most {MOST_CELLS:,} cells")
            if picture.mode in ("1", "P"):
                full = picture.convert("RGBA" if "transparency" in picture.info else "RGB")
                values = np.asarray(full)
            elif picture.mode in ("L", "LA", "RGB", "RGBA"):
                values = np.asarray(picture)
            else:
                raise ArgumentError(where, f"{file}: mode {picture.mode}", expected)
    except ArgumentError:
        raise
    except FileNotFoundError:
        raise ArgumentError(where, str(file), "an existing picture") from None
    except Exception as error:  # damaged pictures fail in many ways
        raise ArgumentError(where, f"{file}: {error}", expected) from None
    if values.ndim == 2:
        return values.astype(np.float64), np.ones(values.shape, dtype=bool)
    colours = values.shape[2] - (values.shape[2] in (2, 4))
    seen = np.ones(values.shape[:2], dtype=bool)
    if colours < values.shape[2]:
        seen = values[..., -1] == 255
    return np.mean(values[..., :colours], axis=2, dtype=np.float64), seen
