"""Wheel geometry against closed forms: what is built must have the rim's support function."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trajopt.errors import ArgumentError
from trajopt.simulate.rollers import (
    Ellipsoid,
    Revolved,
    Shape,
    SphereChain,
    inscribed,
    mecanum_wheel,
    normals,
    outline_point,
    revolve,
    support_height,
    turned,
)

RADIUS = 0.098
ROUND = np.linspace(-math.pi, math.pi, 2001)


@settings(max_examples=20, deadline=None)
@given(
    radius=st.floats(0.05, 0.2),
    rollers=st.integers(12, 24),
    share=st.floats(0.06, 0.15),
    angle=st.sampled_from([-60.0, -45.0, 30.0, 45.0]),
    spheres=st.integers(5, 9),
)
def test_sphere_chain_touches_the_rim_and_never_passes_it(
    radius: float, rollers: int, share: float, angle: float, spheres: int
) -> None:
    wheel = mecanum_wheel(
        radius,
        rollers=rollers,
        roller_radius=share * radius,
        angle=math.radians(angle),
        spheres=spheres,
        mass=2.0,
    )
    built = support_height(wheel, ROUND)
    # between two neighbours a wheel on spheres sinks by at most R (1 - cos(half their spacing))
    sag = radius * (1.0 - math.cos(math.pi / (rollers * spheres)))
    assert np.max(built) <= radius + 1e-8
    assert np.min(built) >= radius - 1.05 * sag - 1e-7


@pytest.mark.parametrize(
    ("shape", "below", "above"),
    [
        ("barrel", 2e-5, 1e-7),
        ("ellipsoid", 1e-4, 1e-7),
        ("cylinder", 1e-7, 1.4e-3),
        ("cone", 0.0, 4e-3),
    ],
)
def test_other_shapes_deviate_as_their_geometry_says(
    shape: Shape, below: float, above: float
) -> None:
    built = support_height(mecanum_wheel(RADIUS, shape=shape), ROUND)
    assert np.min(built) >= RADIUS - below - 1e-9
    assert np.max(built) <= RADIUS + above


def test_cylinder_ends_stand_out_by_the_closed_form() -> None:
    built = support_height(
        mecanum_wheel(RADIUS, rollers=18, roller_radius=0.0095, shape="cylinder"), ROUND
    )
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


def test_mecanum_rollers_lean_as_asked_where_they_meet_the_ground() -> None:
    for degrees in (-45.0, 45.0):
        lowest = min(
            mecanum_wheel(RADIUS, angle=math.radians(degrees)).rollers, key=lambda r: r.centre[2]
        )
        assert math.atan2(lowest.axis[1], lowest.axis[0]) == pytest.approx(math.radians(degrees))
        assert lowest.axis[2] == pytest.approx(0.0)


def test_masses_add_up_and_ellipsoid_has_the_local_curvature() -> None:
    wheel = mecanum_wheel(RADIUS, shape="ellipsoid", mass=1.44)
    assert wheel.mass == pytest.approx(1.44)
    profile = wheel.rollers[0].profile
    assert isinstance(profile, Ellipsoid)
    assert profile.half_length**2 == pytest.approx(0.0095**2 + 2 * 0.0095 * 0.0885, rel=5e-3)


def test_turning_a_roller_carries_its_normal_angle() -> None:
    roller = mecanum_wheel(RADIUS).rollers[0]
    for phi in (0.3, 2.0):
        moved = turned(roller, phi)
        np.testing.assert_allclose(moved.centre, 0.0885 * normals(np.array(phi)), atol=1e-12)
        assert np.dot(moved.axis, moved.centre) == pytest.approx(
            np.dot(roller.axis, roller.centre), abs=1e-12
        )


def test_revolved_vertices_lie_on_the_profile_and_shrink_inside() -> None:
    profile = mecanum_wheel(RADIUS, shape="barrel").rollers[0].profile
    assert isinstance(profile, Revolved)
    vertices = revolve(profile, sides=16)
    rings = vertices.reshape(len(profile.stations), 16, 3)
    np.testing.assert_allclose(
        np.hypot(rings[..., 0], rings[..., 1]), np.array(profile.radii)[:, None] * np.ones(16)
    )
    slim = revolve(profile, sides=16, shrink=1e-3).reshape(rings.shape)
    assert np.all(np.hypot(slim[..., 0], slim[..., 1]) < np.hypot(rings[..., 0], rings[..., 1]))
    assert slim[0, 0, 2] > rings[0, 0, 2]


def test_profiles_have_the_shape_that_was_asked_for() -> None:
    chain = mecanum_wheel(RADIUS, spheres=7).rollers[0].profile
    cone = mecanum_wheel(RADIUS, shape="cone").rollers[0].profile
    assert isinstance(chain, SphereChain)
    assert len(chain.radii) == 7
    assert max(chain.radii) == pytest.approx(0.0095)
    assert isinstance(cone, Revolved)
    assert sum(cone.radii) / 2 == pytest.approx(0.0095)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"radius": 0.0}, "radius"),
        ({"radius": math.nan}, "radius"),
        ({"radius": 0.098, "roller_radius": 0.06}, "roller_radius"),
        ({"radius": 0.098, "angle": 0.0}, "angle"),
        ({"radius": 0.098, "rollers": 2}, "rollers"),
        ({"radius": 0.24, "rollers": 3}, "rollers"),
        ({"radius": 0.098, "mass": 0.3}, "mass"),
        ({"radius": 0.098, "roller_mass": 0.001}, "roller_mass"),
        ({"radius": 0.098, "spheres": 0}, "spheres"),
        ({"radius": 0.098, "shape": "cube"}, "shape"),
    ],
)
def test_impossible_wheels_name_the_argument(arguments: dict[str, float], named: str) -> None:
    with pytest.raises(ArgumentError) as caught:
        mecanum_wheel(**arguments)  # type: ignore[arg-type]
    assert caught.value.argument == named
