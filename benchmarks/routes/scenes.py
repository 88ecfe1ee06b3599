"""Maps that routes are tried on, sized by the robot: tables of problem files, and map files.

Lengths are multiples of the robot's half width where a gap has to be wide or narrow for it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from trajopt.robots.robot import Robot, robot

Tables = dict[str, Any]
LIMITS: Tables = {"speed": 1.5, "acceleration": 1.0, "deceleration": 1.0, "slip": True}
SPEEDS = {"powerbot": 14.0, "loc8": 15.0}  # rad/s of wheels, of robots whose motors name none


def size_of(body: Robot) -> tuple[float, float]:
    """Half width and length of the outline, m."""
    low, high = np.min(body.footprint, axis=0), np.max(body.footprint, axis=0)
    return float(high[1] - low[1]) / 2, float(high[0] - low[0])


def _tables(name: str, title: str, start: list[float], goal: list[float]) -> Tables:
    limits = dict(LIMITS)
    if name in SPEEDS:
        limits["wheel_speed"] = SPEEDS[name]
    return {
        "title": f"{title}, {name}",
        "robot": {"name": name},
        "start": {"pose": start},
        "goal": {"pose": goal},
        "ground": {"friction": 0.5},
        "limits": limits,
        "obstacles": [],
    }


def _wall(name: str, start: list[float], end: list[float], thickness: float = 0.1) -> Tables:
    return {
        "name": name,
        "kind": "wall",
        "height": 1.0,
        "start": start,
        "end": end,
        "thickness": thickness,
    }


def office(name: str, seed: int = 0) -> Tables:
    """Six rooms on a corridor, doors open by different angles, a desk in each room."""
    half, length = size_of(robot(name))
    door, room = 2 * half + 0.5 * length, 5 * length
    wide = 2.6 * length
    rng = np.random.default_rng(seed)
    width = 3 * room
    found = _tables(
        name,
        "Office",
        [0.5 * room, 0.4 * room, np.pi / 2],
        [2.5 * room, room + wide + 0.6 * room, np.pi / 2],
    )
    found["space"] = {"x": [0.0, width], "y": [0.0, 2 * room + wide]}
    things = []
    for side, y in (("south", room), ("north", room + wide)):
        for k in range(3):
            middle = (k + 0.5) * room + float(rng.uniform(-0.2, 0.2)) * room
            left, right = middle - door / 2, middle + door / 2
            things += [
                _wall(f"{side} {k} left", [k * room, y], [left, y]),
                _wall(f"{side} {k} right", [right, y], [(k + 1) * room, y]),
            ]
            turn = -1 if side == "south" else 1
            leaf = {
                "name": f"{side} {k} door",
                "kind": "door",
                "height": 1.0,
                "hinge": [right, y + turn * 0.05],
                "direction": np.pi,
                "angle": -turn * float(rng.uniform(1.4, 1.7)),
                "width": 0.8 * door,
                "thickness": 0.04,
            }
            things.append(leaf)
            x, up = (k + 0.5) * room, y + turn * 0.75 * room
            desk = shapely.box(x + 0.15 * room, up - 0.15 * room, x + 0.4 * room, up + 0.1 * room)
            things.append(_polygon(f"{side} {k} desk", desk))
        for k in (1, 2):
            low, high = (0.0, room) if side == "south" else (room + wide, 2 * room + wide)
            things.append(_wall(f"{side} between {k}", [k * room, low], [k * room, high]))
    return {**found, "obstacles": things}


def _polygon(name: str, shape: shapely.Polygon) -> Tables:
    ring = shapely.geometry.polygon.orient(shape).exterior.coords[:-1]
    corners = [[float(x), float(y)] for x, y in ring]
    return {"name": name, "kind": "polygon", "height": 1.0, "corners": corners}


def clutter(name: str, seed: int = 0) -> Tables:
    """Sixty polygons that leave room around start and goal."""
    half, length = size_of(robot(name))
    rng = np.random.default_rng(seed)
    x1, y1 = 24 * length, 16 * length
    ends = [[1.5 * length, 1.5 * length, 0.5], [x1 - 1.5 * length, y1 - 1.5 * length, 0.5]]
    found = _tables(name, "Clutter of 60 polygons", *ends)
    found["space"] = {"x": [0.0, x1], "y": [0.0, y1]}
    things: list[shapely.Polygon] = []
    while len(things) < 60:
        centre, count = rng.uniform([0, 0], [x1, y1]), int(rng.integers(3, 8))
        angles = np.sort(rng.uniform(0, 2 * np.pi, count))
        radius = rng.uniform(0.3, 0.9) * length
        ring = centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])
        shape = shapely.convex_hull(shapely.multipoints(ring))
        near = min(shape.distance(shapely.Point(e[:2])) for e in ends)
        apart = all(shape.distance(other) > 0.3 * half for other in things)
        if shape.area > 0.05 * length**2 and near > 1.2 * length and apart:
            things.append(shape)
    found["obstacles"] = [_polygon(f"thing {k}", shape) for k, shape in enumerate(things)]
    return found


def narrow(name: str, spare: float = 0.04) -> Tables:
    """A passage ``spare`` m wider than the robot through a thick wall, and no other way."""
    half, length = size_of(robot(name))
    x, y = 5 * length, 3 * length
    gap = 2 * half + spare
    found = _tables(
        name,
        f"Narrow passage, {100 * spare:g} cm to spare",
        [length, length, 0.0],
        [2 * x - length, length, 0.0],
    )
    found["space"] = {"x": [0.0, 2 * x], "y": [0.0, 2 * y]}
    thick = 0.8 * length
    found["obstacles"] = [
        _wall("below", [x, 0.0], [x, y - gap / 2], thick),
        _wall("above", [x, y + gap / 2], [x, 2 * y], thick),
    ]
    return found


def maze(name: str, seed: int = 0) -> Tables:
    """A random spanning tree of 6 x 4 places: one way through."""
    half, length = size_of(robot(name))
    cell = 2 * half + 1.2 * length
    columns, rows = 6, 4
    rng = np.random.default_rng(seed)
    passages, seen, stack = set(), {(0, 0)}, [(0, 0)]
    while stack:
        c, r = stack[-1]
        near = [(c + i, r + j) for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        near = [p for p in near if 0 <= p[0] < columns and 0 <= p[1] < rows and p not in seen]
        if not near:
            stack.pop()
            continue
        pick = near[int(rng.integers(len(near)))]
        passages.add(frozenset(((c, r), pick)))
        seen.add(pick)
        stack.append(pick)
    first = (1, 0) if frozenset(((0, 0), (1, 0))) in passages else (0, 1)
    last = (columns - 1, rows - 1)
    before = next(p for pair in passages if last in pair for p in pair if p != last)
    start = [cell / 2, cell / 2, float(np.arctan2(first[1], first[0]))]
    turn = float(np.arctan2(last[1] - before[1], last[0] - before[0]))
    found = _tables(name, "Maze", start, [(columns - 0.5) * cell, (rows - 0.5) * cell, turn])
    found["space"] = {"x": [0.0, columns * cell], "y": [0.0, rows * cell]}
    for c in range(columns):
        for r in range(rows):
            for i, j in ((1, 0), (0, 1)):
                other = (c + i, r + j)
                if other[0] >= columns or other[1] >= rows:
                    continue
                if frozenset(((c, r), other)) not in passages:
                    start_ = [other[0] * cell, other[1] * cell]
                    end = [start_[0] + j * cell, start_[1] + i * cell]
                    found["obstacles"].append(_wall(f"{c} {r} {i}", start_, end, 0.05))
    return found


def parking(name: str) -> Tables:
    """Into a bay across the lane, between two parked robots; to be driven forwards."""
    half, length = size_of(robot(name))
    bay, lane = 2.6 * half, 5 * length
    found = _tables(
        name,
        "Parking bay",
        [1.2 * length, 2.2 * length, 0.0],
        [9 * length, -0.9 * length, -np.pi / 2],
    )
    found["space"] = {"x": [0.0, 12 * length], "y": [-2.0 * length, lane]}
    x = 9 * length
    for k, place in enumerate((x - bay, x + bay)):
        box = shapely.box(place - half, -1.6 * length, place + half, -0.2 * length)
        found["obstacles"].append(_polygon(f"parked {k}", box))
    found["obstacles"].append(
        _polygon("kerb left", shapely.box(0.0, -2.0 * length, x - 2.5 * bay, 0.0))
    )
    found["obstacles"].append(
        _polygon("kerb right", shapely.box(x + 2.5 * bay, -2.0 * length, 12 * length, 0.0))
    )
    return found


def slopes(name: str) -> Tables:
    """A plane that rises across the way, with obstacles on it."""
    found = clutter(name, 3)
    found["title"] = f"Slope, {name}"
    found["obstacles"] = found["obstacles"][::3]
    found["ground"] = {"friction": 0.5, "plane": {"slope": 0.08, "direction": 1.2}}
    return found


def grid(name: str, folder: Path, cells: int = 2000, seed: int = 0) -> Tables:
    """A map of 2,000 x 2,000 cells as a map_server file, with a thousand discs and some walls."""
    _, length = size_of(robot(name))
    resolution = 0.05 * length / 0.9
    rng = np.random.default_rng(seed)
    grey = np.full((cells, cells), 254, dtype=np.uint8)
    row, column = np.mgrid[:61, :61] - 30
    for _ in range(cells * cells // 4500):
        r = int(rng.integers(6, 20))
        y, x = rng.integers(30, cells - 30, 2)
        grey[y - 30 : y + 31, x - 30 : x + 31][row**2 + column**2 <= r * r] = 0
    for k in range(1, 5):  # walls with two gaps each
        at = k * cells // 5
        grey[:, at - 2 : at + 2] = 0
        for gap in rng.integers(100, cells - 100, 2):
            grey[gap - 25 : gap + 25, at - 45 : at + 45] = 254
    grey[:2], grey[-2:], grey[:, :2], grey[:, -2:] = 0, 0, 0, 0
    room = 70
    ends = [(150, cells // 2), (cells - 150, cells // 3)]
    for x, y in ends:
        grey[y - room : y + room, x - room : x + room] = 254
    _write_map(grey, folder, "grid", ".pgm", resolution)
    (x0, y0), (x1, y1) = ((x * resolution, y * resolution) for x, y in ends)
    found = _tables(name, "Grid of 2,000 x 2,000 cells", [x0, y0, 0.0], [x1, y1, 0.0])
    found["map"] = {"file": str(folder / "grid.yaml")}
    return found


def _write_map(
    grey: NDArray[np.uint8], folder: Path, name: str, kind: str, resolution: float
) -> None:
    """A map_server file and its picture; ``grey`` has row 0 at the least y."""
    from PIL import Image

    Image.fromarray(grey[::-1]).save(folder / f"{name}{kind}")
    keys = {
        "image": f"{name}{kind}",
        "resolution": resolution,
        "origin": [0.0, 0.0, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    text = "".join(f"{key}: {value}\n" for key, value in keys.items())
    (folder / f"{name}.yaml").write_text(text, encoding="utf-8")


def write_lab(folder: Path) -> None:
    """The map of problems/map/lab.toml: three rooms with desks and pillars, 12 x 7 m."""
    grey = np.full((140, 240), 254, dtype=np.uint8)
    boxes = [
        (0, 0, 12, 0.1), (0, 6.9, 12, 7), (0, 0, 0.1, 7), (11.9, 0, 12, 7),
        (4.4, 0, 4.6, 4.4), (4.4, 5.9, 4.6, 7), (8.4, 0, 8.6, 1.0), (8.4, 2.5, 8.6, 7),
        (1.4, 2.4, 3.2, 3.4), (0.1, 5.2, 1.0, 6.9), (5.4, 0.1, 7.4, 0.8), (9.4, 3.2, 10.2, 5.2),
    ]  # fmt: skip
    for x0, y0, x1, y1 in boxes:
        grey[round(y0 * 20) : round(y1 * 20), round(x0 * 20) : round(x1 * 20)] = 0
    y, x = (np.mgrid[:140, :240] + 0.5) / 20
    for centre in ((6.5, 3.4), (3.0, 0.9)):
        grey[(x - centre[0]) ** 2 + (y - centre[1]) ** 2 < 0.3**2] = 0
    _write_map(grey, folder, "lab", ".png", 0.05)


SCENES: dict[str, Callable[[str], Tables]] = {
    "office": office,
    "clutter": clutter,
    "narrow": narrow,
    "maze": maze,
    "parking": parking,
    "slopes": slopes,
}
