"""What routes are made of, each against an independent computation."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from scipy.interpolate import BSpline, RectBivariateSpline

from trajopt.arrays import Array
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.tip import Tip
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples
from trajopt.paths.segments import Clothoid
from trajopt.robots.robot import robot
from trajopt.routes.bspline import as_path, knots_of
from trajopt.routes.cells import kind_of, shared_numbers, symbols_of
from trajopt.routes.cover import cover
from trajopt.routes.envelope import Envelope, envelope_of
from trajopt.routes.field import Field, field_of
from trajopt.routes.ways import ways
from trajopt.timing.track import track
from trajopt.world.obstacles import Circle, Wall
from trajopt.world.occupancy import OccupancyMap
from trajopt.world.plane import Plane
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

LIMITS = (Speed(1.2), Acceleration(1.0, 1.4), Slip(0.5), WheelSpeed(12.0), WheelAcceleration(9.0))


def test_a_path_is_the_b_spline() -> None:
    rng = np.random.default_rng(0)
    for axes in (2, 3):
        points = np.cumsum(rng.uniform(0.2, 1.0, (11, axes)), axis=0)
        path = as_path(points, 0.3)
        u = np.linspace(0.0, 8.0, 200)
        curve = BSpline(knots_of(11), points, 3)
        for order in range(3):
            there = path.position(u, order)[:, :2]
            assert there == pytest.approx(curve(u, nu=order)[:, :2], abs=1e-9)
        if axes == 3:
            assert path.yaw(u) == pytest.approx(curve(u)[:, 2], abs=1e-9)


@pytest.mark.parametrize("name", ["powerbot", "car", "omni-3", "swerve"])
def test_discs_lie_inside_the_outline_and_reach_it(name: str) -> None:
    footprint = tuple(robot(name).footprint)
    found, shape = cover(footprint), shapely.Polygon(footprint)
    discs = shapely.union_all(
        shapely.buffer(shapely.points(found.centres), found.radii, quad_segs=64)
    )
    assert discs.difference(shape.buffer(1e-9)).area < 1e-12
    edge = shapely.segmentize(shape.exterior, 0.002)
    far = shapely.distance(discs, shapely.points(shapely.get_coordinates(edge)))
    assert far.max() <= found.gap * 1.3  # places in between those that were asked for
    assert found.inner[2] == pytest.approx(shapely.maximum_inscribed_circle(shape).length, rel=0.02)


def test_a_smooth_field_is_a_spline_with_its_derivatives() -> None:
    rng = np.random.default_rng(1)
    values = rng.uniform(0.0, 1.0, (14, 17)).cumsum(axis=0)
    turn = 0.6
    field = Field(values, 0.1, (1.0, -2.0, turn))
    local = rng.uniform(0.35, 0.9, (40, 2))
    c, s = np.cos(turn), np.sin(turn)
    places = local @ np.array([[c, s], [-s, c]]) + [1.0, -2.0]
    found = field.smooth(places)
    reference = RectBivariateSpline(0.1 * np.arange(14), 0.1 * np.arange(17), values)
    # different conditions at the border: alike inside to a few per cent, exact at grid points
    assert found[0] == pytest.approx(reference(local[:, 1], local[:, 0], grid=False), rel=2e-2)
    nodes = field.world(np.array([[5.0, 6.0], [3.0, 9.0], [0.0, 0.0]]))
    assert field.smooth(nodes)[0] == pytest.approx([values[6, 5], values[9, 3], values[0, 0]])
    h = 1e-6
    for k, step in enumerate(np.eye(2) * h):
        high, low = field.smooth(places + step), field.smooth(places - step)
        slope = (high - low) / (2 * h)
        assert found[1 + k] == pytest.approx(slope[0], abs=1e-5)
        assert found[3 + k] == pytest.approx(slope[1], rel=1e-4, abs=1e-3)
        assert found[4 + k] == pytest.approx(slope[2], rel=1e-4, abs=1e-3)


def test_distances_of_shapes_and_of_cells_agree() -> None:
    cells = np.zeros((60, 80), dtype=bool)
    cells[20:30, 40:44] = True
    cells[45, 10:70] = True
    grid = OccupancyMap(cells, 0.05, (3.0, 1.0, 0.5))
    scene = Scene(0.5, Flat(), map=grid)
    rng = np.random.default_rng(2)
    local = rng.uniform([0.5, 0.3], [3.5, 2.7], (300, 2))
    places = grid.world(local)
    exact = shapely.distance(
        shapely.union_all([*shapely.polygons(grid.polygons)]), shapely.points(places)
    )
    border = np.minimum.reduce([local[:, 0], 4 - local[:, 0], local[:, 1], 3 - local[:, 1]])
    exact = np.minimum(exact, border)
    found = field_of(scene, places[:2]).at(places)
    outside = exact > 0.05
    assert np.abs(found - exact)[outside].max() < 0.05
    assert np.median(np.abs(found - exact)[outside]) < 0.01


def test_ways_pass_posts_on_both_sides() -> None:
    posts = (Circle("a", 1.0, (3.0, 2.0), 0.3), Circle("b", 1.0, (6.0, 2.0), 0.3))
    scene = Scene(0.5, Flat(), posts, space=shapely.box(0, 0, 9, 4))
    start, goal = np.array([1.0, 2.0]), np.array([8.0, 2.0])
    field = field_of(scene, np.array([start, goal]))
    found = ways(field, start, goal, 0.3, 0.6, 9)
    sides = set()
    for way in found:
        x, y = way.points.T
        sides.add(tuple(bool(np.interp(post.centre[0], x, y) > 2.0) for post in posts))
        assert field.at(way.points[1:-1]).min() > 0.25
    assert sides >= {(True, True), (False, False)}
    assert len(sides) == len(found)
    assert found[0].length == min(way.length for way in found)


def test_no_way_through_a_closed_wall() -> None:
    wall = (Wall("w", 1.0, (4.0, 0.0), (4.0, 4.0), 0.1),)
    scene = Scene(0.5, Flat(), wall, space=shapely.box(0, 0, 9, 4))
    ends = np.array([[1.0, 2.0], [8.0, 2.0]])
    assert ways(field_of(scene, ends), *ends, 0.3, 0.6, 3) == []


def test_an_envelope_of_a_differential_drive() -> None:
    found = envelope_of(robot("small-differential"), LIMITS, False)
    assert found.speed == 1.2
    assert found.box[0] <= 1.0
    assert found.box[1] <= 1.4
    # (1 -+ b kappa) v / r <= 12 with r = 0.0975 and b = 0.165
    assert found.first == pytest.approx(
        np.array([[1.0, 0.0, -0.165], [1.0, 0.0, 0.165]]) / 0.0975 / 12
    )
    assert found.changes == pytest.approx([12 / 9] * 2)


def accelerations(samples: PathSamples, motion: tuple[Array, Array], envelope: Envelope) -> Array:
    """(N, 4): what cones and planes of an envelope are linear in, from s'' and s'^2 (N,)."""
    sdd, sd2 = motion
    origin = (
        samples.velocity[:, :2] * sdd[:, None] + samples.acceleration_rate[:, :2] * sd2[:, None]
    )
    yaw = samples.turning[:, 2] * sdd + samples.turning_rate[:, 2] * sd2
    centripetal = (samples.turning[:, 2] ** 2 * sd2)[:, None] * envelope.cog
    x, y, z = envelope.down
    cos, sin = np.cos(samples.yaw), np.sin(samples.yaw)
    gravity = 9.80665 * np.column_stack([cos * x + sin * y, cos * y - sin * x])
    return np.column_stack([origin - centripetal - gravity, yaw, np.full(len(sdd), z)])


@pytest.mark.parametrize("slope", [0.0, 0.15])
def test_cones_and_planes_are_the_limits(slope: float) -> None:
    """Against friction used and rows on a curved path, on level ground and on a plane."""
    body, slip, tip = robot("swerve"), Slip(0.5, rule="least_norm"), Tip()
    ground = Plane(slope, 0.7)
    envelope = envelope_of(body, (slip, tip), False, ground)
    path = Path.through([[0, 0], [1.0, 0.6], [2.0, 0.2], [2.5, 1.5]])
    along = track(path, body, ground)
    s = np.linspace(0.05, 0.95, 60) * along.path.length
    samples = along.samples(s, along.path.locate(s))
    rng = np.random.default_rng(5)
    sdd, sd2 = rng.uniform(-1.5, 1.5, 60), rng.uniform(0.0, 2.0, 60)
    # On a plane the body's frame leans; headings in the ground plan differ by its square.
    w = accelerations(samples, (sdd, sd2), envelope)
    cone = np.einsum("cij,nj->cni", envelope.cones[:, 0], w)
    inside = np.sqrt(np.cos(np.pi / slip.sides))
    used = (np.linalg.norm(cone[..., :3], axis=2) / cone[..., 3]).max(axis=0) * inside
    needed = slip.needed(samples, body, sdd, sd2)
    assert used == pytest.approx(needed, rel=1e-9 if slope == 0 else 0.02)
    rows = tip.rows(samples, body)
    left = rows.c - rows.a * sdd[:, None] - rows.b * sd2[:, None]
    level = tip.rows(track(path, body).samples(s[:1], path.locate(s[:1])), body).c
    assert w @ envelope.planes[:, 0].T == pytest.approx(
        left / level, abs=1e-9 if slope == 0 else 0.01
    )


def test_rows_of_a_car_follow_its_curvature() -> None:
    """Friction by the rule of each wheel, at curvatures between those that were read."""
    body, slip = robot("car"), Slip(0.6, rule="least_norm")
    envelope = envelope_of(body, (slip,), False)
    assert envelope.cones.shape[1] > 1
    for bend in np.linspace(-0.95, 0.95, 6) * envelope.curvature:
        path = Path.segments([Clothoid(1.0, bend, bend)], start=(0.0, 0.0, 0.0))
        s = np.full(5, path.length / 2)
        samples = track(path, body).samples(s, path.locate(s))
        motion = np.linspace(-1.0, 1.0, 5), np.full(5, 1.0)
        w = accelerations(samples, motion, envelope)
        powers = samples.curvature[0] ** np.arange(envelope.cones.shape[1])
        cone = np.einsum("cpij,p,nj->cni", envelope.cones, powers, w)
        used = (np.linalg.norm(cone[..., :3], axis=2) / cone[..., 3]).max(axis=0)
        needed = slip.needed(samples, body, *motion)
        assert used == pytest.approx(needed, rel=0.01, abs=0.01)


@pytest.mark.parametrize(("name", "free"), [("powerbot", False), ("car", False), ("loc8", True)])
def test_derivatives_of_a_cell_and_its_discs(name: str, free: bool) -> None:
    """Central differences of CasADi's own values; a cell's value against NumPy."""
    body = robot(name)
    limits = (Speed(1.2), Acceleration(1.0, 1.4), WheelSpeed(12.0), Slip(0.5), Tip())
    envelope = envelope_of(body, limits, free, Plane(0.1, 0.4))
    kind = kind_of(envelope)
    symbols = symbols_of(kind, 3)
    rng = np.random.default_rng(3)
    control = np.cumsum(
        rng.uniform(0.3, 0.8, (4, kind.axes)) * [1.0, 0.4, 0.3][: kind.axes], axis=0
    )
    z = np.concatenate([control.ravel(), [0.7, 0.9]])
    u = np.array([2.2, 2.4, 2.3])
    rows = [BSpline(knots_of(9), np.eye(9), 3)(u, nu=k)[:, 2:6] for k in range(3)]
    w = np.concatenate(
        [*(rows[k][0] for k in range(3)), *(rows[k][1] for k in range(3)), rows[1][2]]
    )
    shared = shared_numbers(envelope, kind, [1.0, 0.3, 0.2, 0.1, 0.6])
    lam = rng.uniform(-1, 1, symbols.rows)

    def first(at: Array) -> tuple[Array, Array]:
        return np.asarray(symbols.gradient(at, w, shared)), np.asarray(
            symbols.slopes(at, w, shared)
        )

    gradient, slopes = first(z)
    bends = np.asarray(symbols.bends(z, w, shared, 0.8, lam))
    bends = bends + np.triu(bends, 1).T
    h = 1e-6
    for k in range(len(z)):
        step = h * np.eye(len(z))[k]
        cost, row = (
            (np.asarray(f(z + step, w, shared)) - np.asarray(f(z - step, w, shared))).ravel()
            / (2 * h)
            for f in (symbols.cost, symbols.rows_of)
        )
        assert gradient[k] == pytest.approx(cost, rel=1e-5, abs=1e-6)
        assert slopes[:, k] == pytest.approx(row, rel=1e-5, abs=1e-5)
        (high_g, high_j), (low_g, low_j) = first(z + step), first(z - step)
        bent = (0.8 * (high_g - low_g).ravel() + (high_j - low_j).T @ lam) / (2 * h)
        assert bends[:, k] == pytest.approx(bent, rel=1e-4, abs=1e-4)
    at, wn = z[: 4 * kind.axes], w[12:20]
    centres = rng.uniform(-0.4, 0.4, 6)
    d = rng.uniform(-1, 1, (5, 3))
    weight = rng.uniform(0, 1, 3)
    found = np.asarray(symbols.disc_slopes(at, wn, centres, d[0], d[1]))
    bent = np.asarray(symbols.disc_bends(at, wn, centres, weight, *d))
    bent = bent + np.triu(bent, 1).T

    def value(there: np.ndarray) -> float:
        """Of the quadratic distance with these derivatives at ``at``."""
        p = np.asarray(symbols.spots(there, wn, centres)).reshape(3, 2) - base
        square = d[2] * p[:, 0] ** 2 / 2 + d[3] * p[:, 0] * p[:, 1] + d[4] * p[:, 1] ** 2 / 2
        return float(weight @ (d[0] * p[:, 0] + d[1] * p[:, 1] + square))

    base = np.asarray(symbols.spots(at, wn, centres)).reshape(3, 2)
    h = 1e-4
    for k in range(len(at)):
        for j in range(len(at)):
            a, b = h * np.eye(len(at))[k], h * np.eye(len(at))[j]
            second = value(at + a + b) - value(at + a - b) - value(at - a + b) + value(at - a - b)
            assert bent[k, j] == pytest.approx(second / (4 * h * h), abs=2e-5)
        step = h * np.eye(len(at))[k]
        slope = (value(at + step) - value(at - step)) / (2 * h)
        assert weight @ found[:, k] == pytest.approx(slope, abs=1e-5)
