"""Height maps from files: .npy arrays, PNG and TIFF pictures."""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.world.height_map import LARGEST_GRID, HeightMap, require_grid, too_large


def load_height_map(
    file: str | FilePath,
    spacing: float,
    *,
    origin: tuple[float, float] = (0.0, 0.0),
    relief: float | None = None,
    grade: float = np.pi / 3,
) -> HeightMap:
    """Height map from a .npy array or a TIFF of floats (heights in m), or from a PNG or a TIFF of
    grey levels, where ``relief`` (m) is the height of white.

    The first row of a picture is its upper edge (largest y). Raises ArgumentError, naming the file,
    where it is missing, empty, no picture or array, not two-dimensional, huge, or not finite, and
    for a relief where heights are in m already.
    """
    path = FilePath(file)
    if not path.is_file():
        raise ArgumentError("ground.file", str(path), "an existing .npy, .png or .tif file")
    if path.stat().st_size == 0:
        raise ArgumentError("ground.file", str(path), "a file that is not empty")
    kind = path.suffix.lower()
    if kind == ".npy":
        heights, metres = _from_npy(path), True
    elif kind in (".png", ".tif", ".tiff"):
        heights, metres = _from_picture(path)
    else:
        raise ArgumentError("ground.file", str(path), "a name that ends in .npy, .png or .tif")
    require_grid(f"ground.file {path.name}", heights)
    if metres and relief is not None:
        raise ArgumentError("ground.relief", relief, f"none: {path.name} holds heights in m")
    if not metres and (relief is None or not np.isfinite(relief)):
        raise ArgumentError("ground.relief", relief, "the height of white, m: grey has no unit")
    return HeightMap(heights if relief is None else heights * relief, spacing, origin, grade)


def _from_npy(path: FilePath) -> Array:
    try:
        mapped = np.load(
            path, mmap_mode="r", allow_pickle=False
        )  # a huge file is refused before it is read
    except Exception as error:  # a damaged header fails in many ways, in the tokenizer too
        raise ArgumentError(
            "ground.file", str(path), f"a .npy array of numbers ({error})"
        ) from error
    if mapped.dtype.kind not in "fiu":
        raise ArgumentError(
            "ground.file", str(path), f"real numbers (this one holds {mapped.dtype})"
        )
    if mapped.ndim == 2 and mapped.size > LARGEST_GRID:
        too_large(str(path), mapped.shape)
    return np.array(mapped, dtype=np.float64)


def _from_picture(path: FilePath) -> tuple[Array, bool]:
    """Values with row 0 at the lower edge, and whether they are metres (floats) or grey levels 0 to
    1."""
    from PIL import Image

    try:
        with Image.open(path) as picture:
            if picture.width * picture.height > LARGEST_GRID:
                too_large(str(path), (picture.height, picture.width))
            metres = picture.mode == "F"
            deep = picture.mode in ("I", "I;16", "I;16B")
            values = np.asarray(
                picture if deep or metres else picture.convert("L"), dtype=np.float64
            )
    except ArgumentError:
        raise
    except Exception as error:  # so do damaged pictures
        raise ArgumentError("ground.file", str(path), f"a readable picture ({error})") from error
    return values[::-1] / (1.0 if metres else 65535.0 if deep else 255.0), metres
