"""Clearance along a whole motion, against closed forms and dense independent sampling."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapely
from shapely import affinity

from trajopt.paths.path import Path
from trajopt.world.clearance import TOLERANCE, path_clearance
from trajopt.world.keep_out import KeepOut, outside_of, without_holes
from trajopt.world.obstacles import Circle, Wall
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

OUTLINE = ((0.5, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.5, -0.2))


def keep_out(*shapes: shapely.Polygon) -> KeepOut:
    return KeepOut(tuple(shapes), tuple(f"thing {k}" for k in range(len(shapes))))


def sampled(path: Path, solids: KeepOut, count: int = 4000) -> float:
    """Least distance at places evenly in the spline's parameter, by shapely's own transforms."""
    outline, whole = shapely.Polygon(OUTLINE), shapely.union_all(list(solids.solids))
    u = np.linspace(path.start, path.end, count)
    least = np.inf
    for (x, y, _), yaw in zip(path.position(u), path.yaw(u), strict=True):
        turned = affinity.rotate(outline, yaw, origin=(0, 0), use_radians=True)
        least = min(least, affinity.translate(turned, x, y).distance(whole))
    return float(least)


def test_straight_past_a_wall() -> None:
    path = Path.through([[0.0, 0.0], [3.0, 0.0]])
    found = path_clearance(path, OUTLINE, keep_out(shapely.box(1, 0.25, 2, 1)))
    assert found.distance == pytest.approx(0.05, abs=1e-12)
    assert 0.05 - TOLERANCE <= found.bound <= 0.05
    assert found.name == "thing 0"
    assert found.pose[2] == 0.0


def test_a_corner_between_two_coarse_places_is_seen() -> None:
    """A spike that the outline passes within a short stretch only."""
    path = Path.through([[0.0, 0.0], [10.0, 0.0]])
    spike = shapely.Polygon([(6.7, 0.21), (6.71, 3.0), (6.69, 3.0)])
    found = path_clearance(path, OUTLINE, keep_out(spike))
    assert found.distance == pytest.approx(0.01, abs=1e-9)
    assert 6.2 - 1e-9 <= found.s <= 7.0 + 1e-9
    assert found.bound >= 0.01 - TOLERANCE


def test_overlap_is_negative_by_its_depth() -> None:
    path = Path.through([[0.0, 0.0], [3.0, 0.0]])
    found = path_clearance(path, OUTLINE, keep_out(shapely.box(1, 0.15, 2, 1)))
    assert found.distance == pytest.approx(-0.05, abs=1e-9)
    assert "0.050 m inside 'thing 0'" in str(found)


@pytest.mark.parametrize("seed", range(12))
def test_bound_and_distance_enclose_dense_samples(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.column_stack([np.arange(5) * 1.5, rng.uniform(-1, 1, 5)])
    heading = rng.uniform(-3, 3, 5) if seed % 2 else None
    path = Path.through(points, heading=heading, turning_length=0.4)
    solids = []
    for x, y in rng.uniform([-1, -4], [7, 4], (40, 2)):
        solid = shapely.Point(x, y).buffer(rng.uniform(0.05, 0.4), quad_segs=2)
        if (
            solid.distance(shapely.LineString(path.position(np.linspace(0, path.end, 300))[:, :2]))
            > 0.7
        ):
            solids.append(solid)
    found = path_clearance(path, OUTLINE, keep_out(*solids))
    dense = sampled(path, keep_out(*solids))
    assert found.bound <= dense
    assert found.distance <= dense + 1e-9 + TOLERANCE
    assert found.distance - found.bound <= TOLERANCE * (1 + 1e-9)


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("reach", [0.0, 3.0])
def test_travel_of_a_point_is_bounded_and_the_bound_is_near(free: bool, reach: float) -> None:
    """Against the integral of speed and turning by 400 places an interval; near once these are short."""
    rng = np.random.default_rng(3)
    points = np.column_stack([np.arange(6) * 1.5, rng.uniform(-1, 1, 6)])
    path = Path.through(points, heading=rng.uniform(-3, 3, 6) if free else None, turning_length=0.4)
    knots = path.basis.knots
    for parts, most in ((1, np.inf), (8, 1.6), (64, 1.03)):
        u = np.unique(np.concatenate([np.linspace(*ends, parts + 1) for ends in pairwise(knots)]))
        bound = path.swept(u[:-1], u[1:], reach)
        t = np.linspace(u[:-1], u[1:], 401, axis=1)
        place = path.position(t.ravel()).reshape(*t.shape, -1)[..., :2]
        yaw = np.unwrap(path.yaw(t.ravel())).reshape(t.shape)
        way = np.linalg.norm(np.diff(place, axis=1), axis=2).sum(axis=1)
        true = way + reach * np.abs(np.diff(yaw, axis=1)).sum(axis=1)
        assert (bound >= true * (1 - 1e-4)).all()
        assert bound.sum() <= most * true.sum()


def test_enough_ends_early_and_stays_a_bound() -> None:
    path = Path.through([[0.0, 0.0], [2.0, 0.3], [4.0, 0.0]])
    wall = keep_out(shapely.box(0, 0.8, 4, 1))
    exact, early = (
        path_clearance(path, OUTLINE, wall),
        path_clearance(path, OUTLINE, wall, enough=0.1),
    )
    assert 0.1 <= early.bound <= exact.distance
    assert early.bound <= exact.bound


def test_nothing_to_keep_out_of() -> None:
    found = path_clearance(Path.through([[0.0, 0.0], [1.0, 0.0]]), OUTLINE, keep_out())
    assert found.distance == found.bound == np.inf


def test_a_space_keeps_the_outline_inside() -> None:
    ring = shapely.Polygon(
        [(0, 0), (10, 0), (10, 6), (0, 6)],
        [[(4, 2), (6, 2), (6, 4), (4, 4)], [(8, 5), (9, 5), (9, 5.5)]],
    )
    scene = Scene(0.5, Flat(), (Circle("post", 1.0, (2.0, 5.0), 0.3),), space=ring)
    path = Path.through([[1.0, 1.0], [9.0, 1.0]])
    found = path_clearance(path, OUTLINE, scene.keep_out)
    assert (found.name, found.distance) == ("space", pytest.approx(0.5, abs=1e-9))
    outside = list(outside_of(ring))
    assert not any(part.interiors for part in outside)
    assert all(part.intersection(ring).area < 1e-12 for part in outside)
    around = ring.envelope.buffer(10.0, join_style="mitre").area
    assert sum(part.area for part in outside) == pytest.approx(around - ring.area)


def test_parts_without_holes_make_up_the_shape() -> None:
    rng = np.random.default_rng(1)
    shape = shapely.box(0, 0, 10, 10)
    for x, y in rng.uniform(1, 9, (25, 2)):
        shape = shape.difference(shapely.Point(x, y).buffer(0.6))
    parts = list(without_holes(shape))
    assert not any(part.interiors for part in parts)
    assert sum(part.area for part in parts) == pytest.approx(shape.area)
    assert shapely.union_all(parts).symmetric_difference(shape).area < 1e-9


def test_a_scene_for_physics_holds_what_is_near() -> None:
    cells = np.zeros((100, 100), dtype=bool)
    cells[:, 40] = True
    from trajopt.world.occupancy import OccupancyMap

    scene = Scene(0.5, Flat(), (Wall("w", 1.0, (0, 9), (1, 9), 0.1),), map=OccupancyMap(cells, 0.1))
    near = scene.around(np.array([[3.0, 3.0], [3.5, 3.0]]), 1.5)
    assert [thing.name for thing in near.obstacles] == ["w", "map 0"]
    assert near.map is None
    far = scene.around(np.array([[2.0, 3.0], [3.0, 3.0]]), 0.5)
    assert [thing.name for thing in far.obstacles] == ["w"]
    path = Path.through([[1.0, 3.0], [0.5, 3.0], [0.2, 3.0]])
    left = path_clearance(path, OUTLINE, scene.keep_out)
    assert (left.name, left.distance) == ("beyond the map", pytest.approx(-0.3, abs=1e-9))
