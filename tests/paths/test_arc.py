"""Arc length and its inverse at sharp bends, closed laps, turns on the spot, and bad arguments."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from trajopt.errors import ArgumentError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.speed import Speed
from trajopt.paths.path import Path
from trajopt.paths.samples import sample_path


def lane(apart: float) -> Path:
    """There and back, so close that the turn is nearly a cusp."""
    return Path.through([[0, 0], [1, 0], [2, apart], [1, 2 * apart], [0, 2 * apart]])


@pytest.mark.parametrize("apart", [0.3, 1e-2, 1e-4, 1e-6])
def test_length_and_inverse_hold_at_sharp_bends(apart):
    path = lane(apart)
    natural = CubicSpline(path.basis.knots, path.points, bc_type="natural")
    u = np.linspace(path.start, path.end, 60)
    np.testing.assert_allclose(path.position(u)[:, :2], natural(u), atol=1e-14)
    c = np.moveaxis(natural.c, 1, 0)[:, ::-1]
    np.testing.assert_allclose(path.scaled_cubics[1], c, atol=1e-12)
    s = np.linspace(0, path.length, 4001)
    np.testing.assert_allclose(path.parameter(path.locate(s)), s, atol=1e-12 * path.length)
    assert path.length == pytest.approx(exact_length(path), rel=1e-13)


def exact_length(path: Path) -> float:
    """Gauss-Legendre in extended precision, cells halved towards the slowest place."""
    nodes, weights = (m.astype(np.longdouble) for m in np.polynomial.legendre.leggauss(20))
    knots, cubics = path.scaled_cubics
    total = np.longdouble(0)
    for c, h in zip(cubics.astype(np.longdouble), np.diff(knots), strict=True):
        grid = np.linspace(0, h, 20001)[:, None]
        rates = np.sum((c[1] + 2 * c[2] * grid + 3 * c[3] * grid**2) ** 2, axis=1)
        slow, away = grid[int(np.argmin(rates)), 0], h * 2.0 ** -np.arange(45)
        edges = np.concatenate([np.linspace(0, h, 30), slow + away, slow - away, [slow]])
        edges = np.unique(np.clip(edges, 0, h)).astype(np.longdouble)
        half = np.diff(edges) / 2
        t = (edges[:-1, None] + half[:, None] * (1 + nodes))[..., None]
        rate = np.sqrt(np.sum((c[1] + 2 * c[2] * t + 3 * c[3] * t**2) ** 2, axis=-1))
        total += np.sum(rate @ weights * half)
    return float(total)


def test_ten_thousand_points_take_milliseconds():
    points = np.cumsum(np.random.default_rng(0).normal(0, 1, (10_000, 2)), axis=0)
    assert len(Path.through(points).scaled_cubics[1]) == 9_999  # loads what it needs
    best = np.inf
    for _ in range(5):
        start = time.perf_counter()
        assert len(Path.through(points).scaled_cubics[1]) == 9_999
        best = min(best, time.perf_counter() - start)
    assert best < 0.1  # 0.02 s where nothing else runs
    path = Path.through(points)
    natural = CubicSpline(path.basis.knots, points, bc_type="natural")
    u = np.linspace(path.start, path.end, 5000)
    np.testing.assert_allclose(path.position(u)[:, :2], natural(u), atol=1e-11)
    assert path.length > path.end


@pytest.mark.parametrize("count", [3, 5, 60])
def test_a_lap_is_scipys_periodic_spline(count):
    points = np.random.default_rng(count).normal(0, 1, (count, 2))
    path = Path.through(points, closed=True)
    periodic = CubicSpline(path.basis.knots, path.points, bc_type="periodic")
    u = np.linspace(path.start, path.end, 500)
    for order in range(3):
        np.testing.assert_allclose(
            path.position(u, order)[:, :2], periodic(u, order), atol=1e-9, rtol=1e-9
        )
    assert path.closed
    again = Path.through(np.vstack([points, points[:1]]), closed=True)  # the last is the first
    np.testing.assert_array_equal(again.points, path.points)
    for wrong in (points[:2], np.vstack([points[:2], points[:1]])):
        with pytest.raises(ArgumentError, match="three or more"):
            Path.through(wrong, closed=True)
    with pytest.raises(ArgumentError, match="closed"):
        Path.through(points, closed=True, start_direction=[1, 0])


def test_a_lap_whose_heading_turns_once_goes_on_turning():
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    path = Path.through(square, heading=np.arange(4) * np.pi / 2, closed=True)
    ends = np.array([path.start, path.end])
    assert np.diff(path.yaw(ends))[0] == pytest.approx(2 * np.pi)
    for order in (1, 2):
        rates = path.yaw(np.array([path.start, np.nextafter(path.end, 0)]), order)
        assert rates[0] == pytest.approx(rates[1], abs=1e-9)


def test_far_coordinates_lose_nothing():
    points = np.array([[0, 0], [1, 0.5], [1.2, 1.4], [2, 0.0]])
    here, far = Path.through(points), Path.through(points + np.array([1e6, -2e6]))
    assert far.length == pytest.approx(here.length, rel=1e-9)  # of the coordinates' own rounding
    s = np.linspace(0, here.length, 40)
    a, b = sample_path(here, s), sample_path(far, s)
    np.testing.assert_allclose(a.curvature, b.curvature, atol=1e-7)


def test_points_that_coincide_turn_on_the_spot_where_headings_differ():
    spot = Path.through([[0, 0], [0, 0]], heading=[0, 3.14], turning_length=0.4)
    assert spot.length == pytest.approx(0.4 * 3.14, rel=1e-12)
    samples = sample_path(spot, np.linspace(0, spot.length, 5))
    np.testing.assert_allclose(samples.twist, np.tile([0, 0, 1 / 0.4], (5, 1)), atol=1e-12)
    for heading in (None, [1.0, 1.0]):
        with pytest.raises(ArgumentError, match="cannot stand still"):
            Path.through([[0, 0], [0, 0]], heading=heading)


BAD = [None, "text", float("nan"), [[1, 2], ["a", 3]], {"x": 1}, object()]


@pytest.mark.parametrize(
    "bad",
    BAD,
    ids=lambda bad: type(bad).__name__ + (str(bad) if isinstance(bad, (str, float)) else ""),
)
@pytest.mark.parametrize(
    "argument", ["points", "heading", "knots", "start_direction", "turning_length"]
)
def test_bad_arguments_are_named(argument, bad):
    if bad is None and argument in ("heading", "knots", "start_direction"):
        return
    given = {"points": [[0, 0], [1, 0]], "heading": [0, 1], argument: bad}
    with pytest.raises(ArgumentError):
        Path.through(given.pop("points"), **given)


@pytest.mark.parametrize(
    "bad",
    [None, "fast", float("nan"), [[1, 2], [3]], object()],
    ids=lambda bad: type(bad).__name__ + (str(bad) if isinstance(bad, (str, float)) else ""),
)
def test_limits_refuse_what_is_no_number(bad):
    with pytest.raises(ArgumentError):
        Speed(bad)
    with pytest.raises(ArgumentError):
        Acceleration(1.0, bad)
