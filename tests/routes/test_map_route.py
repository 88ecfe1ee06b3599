"""A route on a map of cells, from its files to a run folder and back, and in physics."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely
from PIL import Image

from trajopt.pipeline import solve, validate
from trajopt.problem import load_problem
from trajopt.report.path_picture import path_figure
from trajopt.report.run_folder import read_solution, write_solution
from trajopt.solution import Solution
from trajopt.world.occupancy import load_map

PROBLEM = """
title = "A map of two rooms"
[robot]
name = "small-differential"
[start]
pose = [0.8, 0.8, 0.0]
[goal]
pose = [4.8, 0.8, 0.0]
[map]
file = "rooms.yaml"
[ground]
friction = 0.5
[limits]
speed = 1.0
acceleration = 0.8
deceleration = 0.8
clearance = 0.03
"""
YAML = """image: rooms.png
resolution: 0.05
origin: [0.0, 0.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("rooms")
    grey = np.full((60, 120), 254, dtype=np.uint8)  # 6 x 3 m, row 0 at the least y
    grey[:40, 58:62] = 0
    grey[:1], grey[-1:], grey[:, :1], grey[:, -1:] = 0, 0, 0, 0
    Image.fromarray(grey[::-1]).save(place / "rooms.png")
    (place / "rooms.yaml").write_text(YAML, encoding="utf-8")
    (place / "problem.toml").write_text(PROBLEM, encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def solution(folder: Path) -> Solution:
    return solve(load_problem(folder / "problem.toml"))


def test_it_keeps_its_distance_from_the_cells(folder: Path, solution: Solution) -> None:
    assert solution.holds, solution.faults
    assert solution.clearance is not None
    assert solution.clearance.name == "map"
    cells = shapely.union_all(shapely.polygons(load_map(folder / "rooms.yaml").polygons))
    assert solution.path is not None
    u = np.linspace(solution.path.start, solution.path.end, 2000)
    outline = np.array(solution.problem.robot.footprint)
    least = np.inf
    for (x, y, _), yaw in zip(solution.path.position(u), solution.path.yaw(u), strict=True):
        c, s = np.cos(yaw), np.sin(yaw)
        corners = outline @ np.array([[c, s], [-s, c]]) + [x, y]
        least = min(least, shapely.Polygon(corners).distance(cells))
    assert least >= 0.03 - 1e-6
    assert solution.clearance.bound <= least <= solution.clearance.distance + 2e-3


def test_a_run_folder_stands_alone(solution: Solution, tmp_path: Path) -> None:
    write_solution(solution, tmp_path / "run", seed=0)
    assert solution.problem.map is not None
    found = read_solution(tmp_path / "run")
    assert found.path is not None
    assert solution.path is not None
    assert np.array_equal(found.path.coordinates, solution.path.coordinates)
    assert found.duration == solution.duration
    assert found.holds
    assert np.array_equal(found.problem.scene.map.occupied, solution.problem.scene.map.occupied)  # type: ignore[union-attr]
    write_solution(found, tmp_path / "run", seed=0)  # over its own files
    assert read_solution(tmp_path / "run").duration == solution.duration


def test_the_picture_shows_map_ways_and_the_nearest_place(solution: Solution) -> None:
    assert solution.path is not None
    told = path_figure(solution, solution.path).axes[0].get_legend_handles_labels()[1]
    assert "map" in told
    assert "swept by the outline" in told
    assert any(label.startswith("tried: ") for label in told)
    assert any(label.startswith("nearest: 0.0") for label in told)


def test_nothing_is_touched_in_physics(solution: Solution) -> None:
    assert solution.trajectory is not None
    report = validate(solution.trajectory, solution.problem, engine="mujoco", control="pose")
    assert not report.contacts
    assert report.final_distance < 0.05
