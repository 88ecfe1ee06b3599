"""Wheel geometry against closed forms: what is built must have the rim's support function."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.simulate.shapes import ROUND, support_height, wheel
from trajopt.errors import ArgumentError
from trajopt.robots import robot
from trajopt.simulate.build import build
from trajopt.simulate.rollers import (
    inscribed,
    normals,
    outline_point,
    revolve,
    ring,
    turned,
)

RADIUS = 0.098


def rollers(**changes):
    section = wheel(**changes)
    return ring(section, section.rollers)


@settings(max_examples=20, deadline=None)
@given(
    radius=st.floats(0.05, 0.4),
    count=st.integers(12, 24),
    share=st.floats(0.06, 0.15),
    angle=st.sampled_from([-60.0, -45.0, 0.0, 30.0, 45.0]),
    spheres=st.integers(5, 9),
)
def test_sphere_chain_touches_the_rim_and_never_passes_it(radius, count, share, angle, spheres):
    built = support_height(
        rollers(
            radius=radius,
            mass=2.0,
            rollers__count=count,
            rollers__radius=share * radius,
            rollers__angle=math.radians(angle),
            rollers__spheres=spheres,
        ),
        ROUND,
    )
    # between two neighbours a wheel on spheres sinks by at most R (1 - cos(half their spacing))
    sag = radius * (1.0 - math.cos(math.pi / (count * spheres)))
    assert np.max(built) <= radius + 1e-7 * radius
    assert np.min(built) >= radius - 1.05 * sag - 1e-6 * radius


@pytest.mark.parametrize("angle", [0.0, 45.0])
@pytest.mark.parametrize(
    ("shape", "below", "above"),
    [("barrel", 6e-5, 1e-6), ("ellipsoid", 1e-4, 1e-7), ("cylinder", 1e-7, 2e-3)],
)
def test_other_shapes_deviate_as_their_geometry_says(shape, below, above, angle) -> None:
    made = rollers(rollers__shape=shape, rollers__angle=math.radians(angle))
    built = support_height(made, ROUND)
    assert np.min(built) >= RADIUS - below - 1e-9
    assert np.max(built) <= RADIUS + above


def test_cones_stand_out_at_one_end() -> None:
    built = support_height(rollers(rollers__shape="cone"), ROUND)
    assert RADIUS + 1e-3 < np.max(built) < RADIUS + 4e-3


def test_cylinder_ends_stand_out_by_the_closed_form() -> None:
    built = support_height(rollers(rollers__shape="cylinder"), ROUND)
    edge, lean = math.pi / 18, math.sin(math.pi / 18) * math.cos(math.radians(45.0))
    expected = 0.0885 / math.cos(edge) + 0.0095 * math.sqrt(1.0 - lean**2)
    assert np.max(built) == pytest.approx(expected, abs=1e-5)  # the peak lies just beside the edge


def test_inscribed_radius_of_a_circle_is_the_distance_to_the_rim() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.06, 0.06, size=(50, 3))
    radii, touched = inscribed(points, lambda phi: np.full_like(phi, RADIUS))
    distance = np.hypot(points[:, 0], points[:, 2])
    np.testing.assert_allclose(radii, RADIUS - distance, atol=1e-9)
    np.testing.assert_allclose(np.sum(normals(touched) * points, axis=1), distance, atol=1e-8)


def test_outline_point_of_an_ellipse() -> None:
    a, b = 0.098, 0.05
    for phi in (-1.2, 0.0, 0.4, 2.5):
        point = outline_point(phi, lambda p: np.sqrt((a * np.sin(p)) ** 2 + (b * np.cos(p)) ** 2))
        assert (point[0] / a) ** 2 + (point[2] / b) ** 2 == pytest.approx(1.0, abs=1e-8)
        gradient = np.array([point[0] / a**2, 0.0, point[2] / b**2])
        np.testing.assert_allclose(
            gradient / np.linalg.norm(gradient), normals(np.array(phi)), atol=1e-6
        )


@pytest.mark.parametrize("degrees", [-45.0, 0.0, 45.0])
def test_rollers_lean_as_asked_where_they_meet_the_ground(degrees: float) -> None:
    made = rollers(rollers__angle=math.radians(degrees))
    lowest = min(made, key=lambda r: r.centre[2])
    assert math.atan2(lowest.axis[1], lowest.axis[0]) == pytest.approx(math.radians(degrees))
    assert lowest.axis[2] == pytest.approx(0.0)


def test_ellipsoids_have_the_rims_curvature() -> None:
    (shape,) = rollers(rollers__shape="ellipsoid")[0].shapes
    assert shape.size[2] ** 2 == pytest.approx(0.0095**2 + 2 * 0.0095 * 0.0885, rel=5e-3)


def test_turning_a_roller_carries_its_normal_angle() -> None:
    roller = rollers()[0]
    for phi in (0.3, 2.0):
        moved = turned(roller, phi)
        np.testing.assert_allclose(moved.centre, 0.0885 * normals(np.array(phi)), atol=1e-12)
        assert np.dot(moved.axis, moved.centre) == pytest.approx(
            np.dot(roller.axis, roller.centre), abs=1e-12
        )


def test_revolved_corners_lie_on_the_profile() -> None:
    stations, radii = np.array([-0.01, 0.0, 0.02]), np.array([0.004, 0.006, 0.003])
    corners = np.array(revolve(stations, radii, sides=16).corners).reshape(3, 16, 3)
    np.testing.assert_allclose(
        np.hypot(corners[..., 0], corners[..., 1]), radii[:, None].repeat(16, 1)
    )
    np.testing.assert_allclose(corners[..., 2], stations[:, None].repeat(16, 1))


@pytest.mark.parametrize(
    ("keys", "named"),
    [
        ({"rollers.radius": 0.06}, "wheels.front-left.rollers.radius"),
        ({"rollers.count": 2}, "wheels.front-left.rollers.count"),
        ({"rollers.mass": 0.09}, "wheels.front-left.rollers.mass"),
    ],
)
def test_impossible_wheels_name_the_key(keys: dict[str, float], named: str) -> None:
    bad = robot("loc8", {f"wheels.front-left.{key}": value for key, value in keys.items()})
    with pytest.raises(ArgumentError) as caught:
        build(bad)
    assert caught.value.argument == named
