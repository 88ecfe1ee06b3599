"""Maps as ROS's map_server reads them, and polygons from files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from PIL import Image

from trajopt.errors import ArgumentError
from trajopt.world.occupancy import OccupancyMap, load_map, stored
from trajopt.world.shape_files import load_polygons

KEYS: dict[str, Any] = {
    "image": "map.pgm",
    "resolution": 0.5,
    "origin": [1.0, 2.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}
# (255 - 205) / 255 = 0.19608: unknown by a hair, as map_saver writes it
GREYS = np.array([[0, 254, 205], [254, 254, 100]], dtype=np.uint8)


def write(folder: Path, picture: np.ndarray = GREYS, name: str = "map.pgm", **changes: Any) -> Path:
    Image.fromarray(picture).save(folder / name)
    keys = {**KEYS, "image": name, **changes}
    lines = [f"{key}: {json.dumps(value)}" for key, value in keys.items() if value is not None]
    file = folder / "map.yaml"
    file.write_text("\n".join(lines), encoding="utf-8")
    return file


def test_rows_of_the_picture_go_down_and_unknown_cells_count_as_occupied(tmp_path: Path) -> None:
    found = load_map(write(tmp_path))
    assert found.occupied.tolist() == [[False, False, True], [True, False, True]]
    free = load_map(write(tmp_path), unknown="free")
    assert free.occupied.tolist() == [[False, False, False], [True, False, False]]
    assert found.corners.tolist() == [[1.0, 2.0], [2.5, 2.0], [2.5, 3.0], [1.0, 3.0]]


def test_negate_and_thresholds(tmp_path: Path) -> None:
    found = load_map(write(tmp_path, negate=1), unknown="free")
    assert found.occupied.tolist() == [[True, True, False], [False, True, True]]
    lower = load_map(write(tmp_path, occupied_thresh=0.6), unknown="free")
    assert lower.occupied.tolist() == [[False, False, True], [True, False, False]]
    wider = load_map(write(tmp_path, free_thresh=0.2))
    assert wider.occupied.tolist() == [[False, False, True], [True, False, False]]


def test_modes(tmp_path: Path) -> None:
    seen = np.stack([GREYS, np.full((2, 3), 255, dtype=np.uint8)], axis=2)
    seen[1, 0, 1] = 0  # white, but left out by the alpha channel
    scale = load_map(write(tmp_path, seen, "map.png", mode="scale"))
    assert scale.occupied.tolist() == [[True, False, True], [True, False, True]]
    trinary = load_map(write(tmp_path, seen, "map.png"))
    assert trinary.occupied.tolist() == [[False, False, True], [True, False, True]]
    shares = np.array([[0, 100, 255], [50, 10, 70]], dtype=np.uint8)
    raw = load_map(write(tmp_path, shares, mode="raw"), unknown="free")
    assert raw.occupied.tolist() == [[False, False, True], [False, True, False]]
    known = load_map(write(tmp_path, shares, mode="raw"))
    assert known.occupied.tolist() == [[True, False, True], [False, True, True]]


def test_colours_are_averaged(tmp_path: Path) -> None:
    colours = np.stack([GREYS, GREYS, np.zeros_like(GREYS)], axis=2)
    found = load_map(write(tmp_path, colours, "map.png"), unknown="free")
    # 254 + 254 + 0 is a grey of 169: an occupancy of 0.34, neither free nor occupied
    assert found.occupied.tolist() == [[False, False, True], [True, False, False]]


def test_boxes_cover_the_cells_and_no_more() -> None:
    rng = np.random.default_rng(3)
    cells = rng.random((40, 30)) < 0.4
    found = OccupancyMap(cells, 0.1, (1.0, -2.0, 0.7))
    whole = shapely.union_all(shapely.polygons(found.polygons))
    assert whole.area == pytest.approx(cells.sum() * 0.01, rel=1e-9)
    assert len(found.boxes) < cells.sum()
    row, column = np.mgrid[:40, :30]
    local = np.column_stack([column.ravel() + 0.5, row.ravel() + 0.5]) * 0.1
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    middles = local @ turn.T + [1.0, -2.0]
    inside = shapely.contains_xy(whole, middles[:, 0], middles[:, 1])
    assert np.array_equal(inside.reshape(40, 30), cells)
    assert OccupancyMap(np.zeros((3, 3), dtype=bool), 1.0).boxes.shape == (0, 4)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"resolution": 0.0}, "resolution"),
        ({"resolution": None}, "resolution"),
        ({"origin": [0.0, 0.0]}, "origin"),
        ({"negate": 2}, "negate"),
        ({"negate": "no"}, "negate"),
        ({"occupied_thresh": 1.5}, "occupied_thresh"),
        ({"free_thresh": 0.9}, "free_thresh"),
        ({"mode": "grey"}, "mode"),
        ({"image": "none.pgm"}, "image"),
        ({"colour": 3}, "colour"),
    ],
)
def test_errors_name_file_and_key(tmp_path: Path, changes: dict[str, Any], key: str) -> None:
    with pytest.raises(ArgumentError, match=rf"map\.yaml: {key} = .*: expected"):
        load_map(write(tmp_path, **changes))


@pytest.mark.parametrize("text", ["", "[1, 2", "- 1", "image: [", "!!python/object:os.x {}"])
def test_what_is_no_map_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "map.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ArgumentError, match=r"map\.yaml"):
        load_map(file)
    with pytest.raises(ArgumentError, match="missing"):
        load_map(tmp_path / "none.yaml")


def test_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    file = write(tmp_path)
    (tmp_path / "map.pgm").write_bytes(b"P5\n9 9\n255\n\x00")
    with pytest.raises(ArgumentError, match=r"map\.yaml: image"):
        load_map(file)
    Image.fromarray(np.zeros((2, 2), dtype=np.uint16)).save(tmp_path / "map.png")
    with pytest.raises(ArgumentError, match="8-bit"):
        load_map(write(tmp_path, GREYS, "map.pgm", image="map.png"))


def test_a_stored_map_is_the_map(tmp_path: Path) -> None:
    file = write(tmp_path, negate=1, mode="scale", origin=[1.0, 2.0, 0.3])
    other = tmp_path / "copy"
    other.mkdir()
    for name, content in stored(file, "map.yaml").items():
        (other / name).write_bytes(content)
    one, two = load_map(file), load_map(other / "map.yaml")
    assert np.array_equal(one.occupied, two.occupied)
    assert (one.resolution, one.origin) == (two.resolution, two.origin)


def geojson(folder: Path, data: Any) -> Path:
    file = folder / "shapes.geojson"
    file.write_text(json.dumps(data), encoding="utf-8")
    return file


SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]]
HOLE = [[1, 1], [1, 2], [2, 2], [1, 1]]


def test_polygons_of_geojson(tmp_path: Path) -> None:
    far = [[[x + 9, y] for x, y in SQUARE]]
    data = {
        "type": "FeatureCollection",
        "features": [
            {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [SQUARE, HOLE]}},
            {"type": "Feature", "geometry": {"type": "MultiPolygon", "coordinates": [far, far]}},
        ],
    }
    found = load_polygons(geojson(tmp_path, data))
    assert [shape.area for shape in found] == [15.5, 16.0, 16.0]


def test_polygons_of_a_table(tmp_path: Path) -> None:
    file = tmp_path / "shapes.csv"
    file.write_text("polygon,x,y\n1,0,0\n1,1,0\n1,1,1\n2,5,5\n2,7,5\n2,7,7\n2,5,7\n")
    assert [shape.area for shape in load_polygons(file)] == [0.5, 4.0]


@pytest.mark.parametrize(
    "data",
    [
        {"type": "Point", "coordinates": [0, 0]},
        {"type": "Polygon", "coordinates": [[[0, 0], [1, 1], [1, 0], [0, 1], [0, 0]]]},
        {"type": "Polygon", "coordinates": [[[0, 0], ["a", 1], [1, 0]]]},
        {"type": "FeatureCollection", "features": []},
        [],
        {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [2, 0], [0, 0]]]},
    ],
)
def test_what_is_no_polygon_is_refused(tmp_path: Path, data: Any) -> None:
    with pytest.raises(ArgumentError, match=r"shapes\.geojson"):
        load_polygons(geojson(tmp_path, data))
