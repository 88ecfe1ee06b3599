"""Ground shapes: heights, derivatives, files; paths laid on them."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image
from world.shapes import GROUNDS, HILLS, ORIGIN, PATHS, TILTED, mesh_of, plane_map

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path
from trajopt.world.height_files import load_height_map
from trajopt.world.height_map import HeightMap
from trajopt.world.laid import lay
from trajopt.world.mesh import Mesh, load_mesh
from trajopt.world.plane import Plane
from trajopt.world.ramp import Ramp, Ramps
from trajopt.world.terrain import Flat


@pytest.mark.parametrize("name", GROUNDS)
def test_partials_are_derivatives_of_each_other(name):
    ground, rng, h = GROUNDS[name], np.random.default_rng(1), 1e-5
    x, y = rng.uniform(-1, 3, (2, 200))
    for i, j in [(a, b) for a in range(4) for b in range(4 - a)]:
        for di, dj in ((1, 0), (0, 1)):
            ahead, behind = (ground.partial(x + k * h * di, y + k * h * dj, i, j) for k in (1, -1))
            expected = (ahead - behind) / (2 * h)
            found = ground.partial(x, y, i + di, j + dj)
            near_line = np.zeros(len(x), dtype=bool)
            for line in ground.lines:
                d = x * np.cos(line.direction) + y * np.sin(line.direction) - line.distance
                near_line |= np.abs(d) <= 2 * h
            scale = 1 + np.abs(found[~near_line]).max()
            np.testing.assert_allclose(found[~near_line], expected[~near_line], atol=2e-5 * scale)


def test_plane_rises_by_its_slope_along_its_direction():
    plane = Plane(0.3, 0.7)
    d = np.array([np.cos(0.7), np.sin(0.7)])
    assert float(plane.height(*(2 * d))) == pytest.approx(2 * np.tan(0.3), rel=1e-12)
    assert float(plane.height(-d[1], d[0])) == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(ArgumentError, match="slope"):
        Plane(2.0, 0.0)


@pytest.mark.parametrize("edge", ["mean", "smooth"])
def test_ramp_is_the_sharp_ramp_averaged_over_its_rounding(edge):
    ramp = Ramp((0.3, 0.0), 0.0, 2.0, 0.4, 0.5, edge)
    x = np.linspace(-1, 4, 300)
    offset = np.linspace(-0.5, 0.5, 100001)
    offset = (offset[1:] + offset[:-1]) / 2 * 0.5
    sharp = lambda d: 0.4 * np.clip(d / 2.0, 0, 1)  # noqa: E731
    if edge == "mean":
        expected = [sharp(v - 0.3 + offset).mean() for v in x]
    else:
        rng = np.random.default_rng(0)
        spread = rng.uniform(-1, 1, (3, 400000)).sum(axis=0) * 0.5 / 6
        expected = [sharp(v - 0.3 + np.concatenate([spread, -spread])).mean() for v in x]
    tolerance = 1e-6 if edge == "mean" else 3e-4
    np.testing.assert_allclose(ramp.height_at(x, 0 * x), expected, atol=tolerance)
    assert ramp.height_at(np.array([300.0]), np.array([5.0]))[0] == pytest.approx(0.4, abs=1e-14)
    beyond = Ramps((ramp,), 1.0).partial(np.array([-5.0, 1.0, 5.0]), np.zeros(3), 1, 0)
    np.testing.assert_allclose(beyond, [0.0, 0.2, 0.0], atol=1e-13)


def test_smooth_surface_of_a_plane_map_is_the_plane():
    ground, rng = plane_map(TILTED), np.random.default_rng(2)
    x, y = rng.uniform(-2.9, 5.9, (2, 500))
    for i, j in [(a, b) for a in range(5) for b in range(5 - a)]:
        tolerance = 1e-13 / 0.1 ** (i + j) * 10
        np.testing.assert_allclose(
            ground.partial(x, y, i, j), TILTED.partial(x, y, i, j), atol=tolerance
        )


def test_smooth_surface_passes_through_the_grid_points_also_of_small_maps():
    for shape in ((2, 2), (2, 7), (4, 3), (9, 9)):
        heights = np.random.default_rng(3).normal(size=shape)
        ground = HeightMap(heights, 0.5, (1.0, 2.0))
        x, y = np.meshgrid(1.0 + 0.5 * np.arange(shape[1]), 2.0 + 0.5 * np.arange(shape[0]))
        np.testing.assert_allclose(ground.partial(x, y, 0, 0), heights, atol=1e-10)


def test_mesh_is_what_one_sees_from_above():
    mesh = mesh_of(HILLS)
    np.testing.assert_allclose(mesh.map.heights, HILLS.heights, atol=1e-12)
    table = np.array([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]])
    floor = table * [4, 4, 0] - [1, 1, 0]
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    both = Mesh(np.vstack([floor, table]), faces, 0.25)
    assert float(both.height(0.5, 0.5)) == 1.0
    assert float(both.height(2.5, 0.5)) == 0.0
    hole = Mesh(floor, np.array([[0, 1, 2]]), 0.25)
    hole.check(Path.through([[0, -0.5], [2.0, 0.0]]))
    with pytest.raises(InfeasibleError, match="no ground"):
        hole.check(Path.through([[0, -0.5], [-0.5, 2.0]]))
    with pytest.raises(ArgumentError, match="faces"):
        Mesh(floor, np.array([[0, 1, 9]]), 0.25)
    wall = Mesh(np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1.0]]), np.array([[0, 1, 2]]), 0.25)
    with pytest.raises(ArgumentError, match="above"):
        _ = wall.map


def test_mesh_files(tmp_path):
    corners = np.array([[0, 0, 0], [2, 0, 0.5], [2, 2, 1], [0, 2, 0.5]])
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["vn 0 0 1", "f 1/1 2/2 3//3 -1"]
    (tmp_path / "a.obj").write_text("# a\n" + "\n".join(lines))
    faces = [corners[[0, 1, 2]], corners[[0, 2, 3]]]
    text = "\n".join("vertex " + " ".join(map(str, p)) for face in faces for p in face)
    (tmp_path / "b.stl").write_text("solid a\n" + text)
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("tag", "<u2")])
    rows = np.zeros(2, kind)
    rows["corners"] = faces
    (tmp_path / "c.stl").write_bytes(b" " * 80 + (2).to_bytes(4, "little") + rows.tobytes())
    for name in ("a.obj", "b.stl", "c.stl"):
        mesh = load_mesh(tmp_path / name, 0.5)
        assert float(mesh.height(1.0, 1.0)) == pytest.approx(0.5)
        assert float(mesh.height(1.5, 0.5)) == pytest.approx(0.5)
    (tmp_path / "bad.obj").write_text("v 0 0 x")
    (tmp_path / "empty.obj").write_text("v 0 0 0")
    for name in ("bad.obj", "empty.obj", "missing.stl", "a.ply"):
        with pytest.raises(ArgumentError, match=r"ground\.file"):
            load_mesh(tmp_path / name, 0.5)


def test_tiff_files(tmp_path):
    metres = np.random.default_rng(4).normal(size=(5, 6)).astype(np.float32)
    Image.fromarray(metres[::-1]).save(tmp_path / "a.tif")
    np.testing.assert_array_equal(load_height_map(tmp_path / "a.tif", 0.1).heights, metres)
    with pytest.raises(ArgumentError, match="heights in m"):
        load_height_map(tmp_path / "a.tif", 0.1, relief=2.0)
    grey = np.arange(20, dtype=np.uint16).reshape(4, 5) * 3000
    Image.fromarray(grey[::-1]).save(tmp_path / "b.tif")
    found = load_height_map(tmp_path / "b.tif", 0.1, relief=2.0).heights
    np.testing.assert_allclose(found, grey / 65535 * 2.0, atol=1e-12)
    with pytest.raises(ArgumentError, match="relief"):
        load_height_map(tmp_path / "b.tif", 0.1)


@pytest.mark.parametrize("name", GROUNDS)
@pytest.mark.parametrize("kind", PATHS)
def test_laid_path_is_the_plane_curve_at_the_ground_s_height(name, kind):
    ground, plane = GROUNDS[name], PATHS[kind]
    laid = lay(plane, ground)
    u = np.linspace(plane.start, plane.end, 777)
    p = laid.position(u)
    np.testing.assert_allclose(p[:, :2], plane.position(u)[:, :2], atol=1e-12)
    np.testing.assert_allclose(p[:, 2], ground.partial(p[:, 0], p[:, 1], 0, 0), atol=1e-8)
    np.testing.assert_allclose(laid.yaw(u), plane.yaw(u), atol=1e-12)
    fine = laid.position(np.linspace(plane.start, plane.end, 200001))
    steps = np.sum(np.diff(fine, axis=0) ** 2, axis=1)
    if kind == "own":
        yaw = laid.yaw(np.linspace(plane.start, plane.end, 200001))
        steps = steps + (0.5 * np.diff(yaw)) ** 2
    assert laid.length == pytest.approx(np.sum(np.sqrt(steps)), rel=1e-8)


def test_knots_stand_where_a_path_crosses_lines_of_the_ground():
    ground = GROUNDS["smooth ramp"]
    laid = lay(PATHS["along"], ground)
    p = laid.position(np.asarray(laid.basis.knots))
    for line in ground.lines:
        d = p[:, 0] * np.cos(line.direction) + p[:, 1] * np.sin(line.direction) - line.distance
        assert np.abs(d).min() < 1e-12


@pytest.mark.parametrize("edge", ["mean", "smooth"])
def test_lines_are_where_derivatives_of_a_ramp_jump(edge):
    ramp, order = Ramp((0.5, 0.3), 0.4, 2.0, 0.3, 0.4, edge), 2 if edge == "mean" else 4
    ahead = np.array([np.cos(0.4), np.sin(0.4)])

    def bend(d: np.ndarray) -> np.ndarray:
        """Along the ramp, at distances d from the origin's parallel to its foot."""
        x, y = d * ahead[0] + 0.7 * ahead[1], d * ahead[1] - 0.7 * ahead[0]
        return ramp.rise(ramp.along(x, y), order)

    places = np.array([line.distance for line in ramp.lines])
    assert np.abs(bend(places + 1e-9) - bend(places - 1e-9)).min() > 0.01
    between = (np.sort(places)[1:] + np.sort(places)[:-1]) / 2
    np.testing.assert_allclose(bend(between + 1e-3), bend(between - 1e-3), atol=1e-9)


def test_paths_off_the_ground_are_refused_with_place():
    flat = Path.through([[0, 0, 0], [1, 0, 0], [2, 0, 0]])
    with pytest.raises(InfeasibleError, match="below the ground") as caught:
        lay(flat, Plane(0.1, 0.0))
    assert caught.value.place == pytest.approx(2.0)
    with pytest.raises(InfeasibleError, match="above the ground"):
        lay(Path.through([[0, 0, 0], [1, 0, 0.1]]), Flat())
    on = Path.through([[0, 0, 0], [np.cos(0.1), 0, np.sin(0.1)]])
    assert lay(on, Plane(0.1, 0.0)) is on
    with pytest.raises(InfeasibleError, match="leaves the height map"):
        lay(Path.through([[0, 0], [ORIGIN[0] - 1, 0]]), HILLS)
    with pytest.raises(InfeasibleError, match="steep"):
        lay(Path.through([[0, 0], [3, 1.3]]), Ramps((Ramp((0.5, 0), 0.4, 2.0, 0.6, 0.4),), 0.2))
