"""Polygons from files: GeoJSON, and CSV tables of corners."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import shapely

from trajopt.errors import ArgumentError
from trajopt.files import LARGEST, content_of, read_table

LARGEST_FILE = 20_000_000  # bytes; chosen: some 100,000 polygons
_POLYGONS = ("Polygon", "MultiPolygon")


def load_polygons(file: str | FilePath) -> tuple[shapely.Polygon, ...]:
    """Polygons, with holes, of a ``.geojson`` or ``.json`` file (a geometry, a feature or a
    collection of them; coordinates are x, y in m), or of a ``.csv`` file with columns polygon, x, y:
    corners in order, those with the same number in ``polygon`` make one.

    Raises ArgumentError, naming the file and which polygon is wrong.
    """
    path = FilePath(file)
    kind = path.suffix.lower()
    if kind not in (".csv", ".geojson", ".json"):
        raise ArgumentError(str(path), kind or "no suffix", "a name that ends in .geojson or .csv")
    found = list(_of_csv(path) if kind == ".csv" else _of_geojson(path))
    if not found:
        raise ArgumentError(str(path), "none", "at least one polygon")
    for i, shape in enumerate(found):
        require_polygon(f"{path}, polygon {i}", shape)
    return tuple(found)


def require_polygon(where: str, shape: shapely.Polygon) -> None:
    """Raises ArgumentError for a polygon whose edges cross, or that has no area."""
    corners = shapely.get_coordinates(shape)
    if len(corners) == 0 or not np.all(np.abs(corners) <= LARGEST):
        raise ArgumentError(where, shape.wkt, f"corners within {LARGEST:g} m")
    if not shape.is_valid or shape.area <= 0:
        reason = shapely.is_valid_reason(shape) if shape.area > 0 else "no area"
        raise ArgumentError(where, reason, "a polygon whose edges do not cross")


def _of_csv(path: FilePath) -> Iterator[shapely.Polygon]:
    table = read_table(path, ("polygon", "x", "y"))
    corners = np.column_stack([table["x"], table["y"]])
    for number in dict.fromkeys(table["polygon"].tolist()):
        mine = corners[table["polygon"] == number]
        if len(mine) < 3:
            raise ArgumentError(f"{path}, polygon {number:g}", len(mine), "three corners or more")
        yield shapely.Polygon(mine)


def _of_geojson(path: FilePath) -> Iterator[shapely.Polygon]:
    try:
        data = json.loads(content_of(path, LARGEST_FILE))
        yield from _polygons(path, data)
    except ArgumentError:
        raise
    except FileNotFoundError:
        raise ArgumentError(str(path), "missing", "a GeoJSON file") from None
    except (OSError, ValueError, TypeError, RecursionError, shapely.GEOSException) as error:
        raise ArgumentError(str(path), str(error), "a GeoJSON file of polygons") from None


def _polygons(path: FilePath, data: Any) -> Iterator[shapely.Polygon]:
    kind = data.get("type") if isinstance(data, dict) else None
    if kind == "FeatureCollection":
        for feature in data.get("features", ()):
            yield from _polygons(path, feature)
    elif kind == "Feature":
        yield from _polygons(path, data.get("geometry"))
    elif kind == "GeometryCollection":
        for geometry in data.get("geometries", ()):
            yield from _polygons(path, geometry)
    elif kind in _POLYGONS:
        rings = data["coordinates"]
        for part in [rings] if kind == "Polygon" else rings:
            outer, *holes = ([tuple(map(float, place[:2])) for place in ring] for ring in part)
            yield shapely.Polygon(outer, holes)
    else:
        raise ArgumentError(str(path), kind, "geometries of kind " + " or ".join(_POLYGONS))
