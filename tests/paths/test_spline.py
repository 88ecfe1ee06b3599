"""Splines against scipy's, and the path parameter against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path
from trajopt.paths.samples import sample_path
from trajopt.paths.spline import SplineBasis, uniform_basis

numbers = st.floats(-5, 5)


@settings(max_examples=40, deadline=None)
@given(
    values=st.lists(numbers, min_size=3, max_size=7),
    gaps=st.lists(st.floats(0.1, 3), min_size=6, max_size=6),
    slopes=st.tuples(numbers, numbers),
    clamped=st.tuples(st.booleans(), st.booleans()),
)
def test_matches_scipy_with_natural_and_clamped_ends(values, gaps, slopes, clamped):
    knots = np.concatenate([[0.0], np.cumsum(gaps)])[: len(values)]
    basis = SplineBasis(tuple(knots), *clamped)
    ends = [(1, slope) if on else (2, 0.0) for on, slope in zip(clamped, slopes, strict=True)]
    control = np.array([*values, *(s for on, s in zip(clamped, slopes, strict=True) if on)])
    reference = CubicSpline(knots, values, bc_type=tuple(ends))
    u = np.linspace(knots[0], knots[-1], 50)
    for order in range(3):
        np.testing.assert_allclose(
            basis.matrix(u, order) @ control, reference(u, order), atol=1e-9 * 1e3
        )
    middle = (knots[1:] + knots[:-1]) / 2
    np.testing.assert_allclose(
        basis.matrix(middle, 3) @ control, reference(middle, 3), atol=1e-5, rtol=1e-7
    )


def test_polynomials_are_the_same_spline():
    basis = uniform_basis(4)
    values = np.array([[0.0, 1.0], [0.7, -1.0], [0.2, 0.5], [1.5, 0.3]])
    cubics = basis.polynomials(values)
    u = np.linspace(1, 4, 31)
    i = np.clip(u.astype(int) - 1, 0, 2)
    t = (u - 1 - i)[:, None]
    np.testing.assert_allclose(
        sum(cubics[i, k] * t**k for k in range(4)), basis.matrix(u) @ values, atol=1e-13
    )


@pytest.mark.parametrize("derivative", [1, 2, 3])
def test_derivatives_by_finite_differences(derivative):
    basis, h = uniform_basis(5), 1e-5
    u = np.array([1.3, 2.2, 3.7, 4.4])
    slope = (basis.matrix(u + h, derivative - 1) - basis.matrix(u - h, derivative - 1)) / (2 * h)
    np.testing.assert_allclose(basis.matrix(u, derivative), slope, atol=1e-8)


def test_third_derivative_left_of_a_knot_differs_from_right():
    basis = uniform_basis(4)
    values = np.array([0.0, 1.0, -1.0, 2.0])
    left, right = (basis.matrix(np.array([2.0 + d]), 3) @ values for d in (-1e-9, 1e-9))
    assert abs(left - right) > 1.0


@pytest.mark.parametrize("knots", [(1.0,), (1.0, 1.0), (2.0, 1.0), (0.0, np.nan), (0.0, np.inf)])
def test_bad_knots(knots):
    with pytest.raises(ArgumentError, match="increasing"):
        SplineBasis(knots)


def test_length_of_a_line_and_inverse():
    path = Path.through([[0, 0], [1, 1], [3, 3]])
    assert path.length == pytest.approx(3 * np.sqrt(2), abs=1e-12)
    s = np.linspace(0, path.length, 17)
    np.testing.assert_allclose(path.parameter(path.locate(s)), s, atol=1e-13)


def test_mixed_length_of_a_turning_line():
    path = Path.through([[0, 0], [1, 0], [2, 0]], heading=[0.0, 0.5, 1.0], turning_length=0.5)
    assert path.length == pytest.approx(np.hypot(2.0, 0.5 * 1.0), abs=1e-12)


def test_circle_curvature():
    angle = np.linspace(0, np.pi / 2, 40)
    points = 2.0 * np.column_stack([np.sin(angle), 1 - np.cos(angle)])
    path = Path.through(points, start_direction=[1, 0], end_direction=[0, 1])
    samples = sample_path(path, np.linspace(0, path.length, 25))
    np.testing.assert_allclose(samples.curvature, 0.5, atol=5e-4)
    np.testing.assert_allclose(samples.twist[:, 0], 1.0, atol=1e-12)


@pytest.mark.parametrize(
    "path",
    [
        Path.through([[0, 0], [1, 0.5], [1.5, -0.3], [2, 0.7]]),
        Path.through([[0, 0, 0], [1, 0.5, 0.1], [1.5, -0.3, 0.3], [2, 0.7, 0.2]]),
        Path.through(
            [[0, 0], [1, 0.5], [1.5, -0.3], [2, 0.7]],
            heading=[0, -0.4, 0.4, 1.0],
            turning_length=0.49,
        ),
    ],
    ids=["tangent", "tangent 3-D", "own heading"],
)
def test_sample_derivatives_by_finite_differences(path):
    h = 1e-5
    s = np.linspace(0, path.length, 23)[1:-1]
    before, here, after = (sample_path(path, s + d) for d in (-h, 0, h))
    np.testing.assert_allclose(
        (after.position - before.position) / (2 * h), here.tangent, atol=1e-7
    )
    np.testing.assert_allclose((after.twist - before.twist) / (2 * h), here.twist_rate, atol=3e-5)
    velocity = np.column_stack(
        [
            np.cos(here.yaw) * here.twist[:, 0] - np.sin(here.yaw) * here.twist[:, 1],
            np.sin(here.yaw) * here.twist[:, 0] + np.cos(here.yaw) * here.twist[:, 1],
        ]
    )
    level = np.hypot(here.tangent[:, 0], here.tangent[:, 1])
    scale = np.where(np.abs(here.slope) > 0, level, 1.0)[:, None]
    np.testing.assert_allclose(velocity * scale, here.tangent[:, :2], atol=1e-9)


def test_acceleration_of_a_circle_points_to_its_centre():
    angle = np.linspace(0, np.pi, 60)
    path = Path.through(np.column_stack([np.sin(angle), 1 - np.cos(angle)]))
    samples = sample_path(path, np.linspace(0.5, path.length - 0.5, 9))
    np.testing.assert_allclose(
        samples.acceleration_rate[:, 1], 1.0, atol=2e-3
    )  # v^2/r, to the left


def test_coinciding_points_are_named():
    with pytest.raises(ArgumentError, match=r"points\[2\]"):
        Path.through([[0, 0], [1, 0], [1, 0], [2, 0]])


def test_doubling_back_is_infeasible_and_says_where():
    path = Path(uniform_basis(3), np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0]]))
    with pytest.raises(InfeasibleError, match="doubles back") as caught:
        sample_path(path, np.linspace(0, path.length, 101))
    assert caught.value.place == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("points", "what"),
    [
        ([[0, 0]], "shape"),
        ([[0, 0], [np.nan, 1]], "finite"),
        ([0, 1, 2], "shape"),
        ([[0, 0, 0, 0], [1, 1, 1, 1]], "shape"),
    ],
)
def test_bad_points(points, what):
    with pytest.raises(ArgumentError, match=what):
        Path.through(points)


def test_a_heading_of_its_own_needs_level_ground():
    """Samples of such a path are planar, so its length would count a climb that its twist does
    not."""
    Path.through([[0, 0, 1], [1, 0, 1]], heading=[0, 1])
    with pytest.raises(ArgumentError, match="level ground"):
        Path.through([[0, 0, 0], [1, 0, 1]], heading=[0, 1])


@pytest.mark.parametrize("far", [1e8, 1e300, np.inf, np.nan])
def test_absurd_coordinates_are_named_not_computed_with(far: float) -> None:
    with pytest.raises(ArgumentError, match=r"at most 1e\+07|finite"):
        Path.through([[0.0, 0.0], [far, 2.0], [4.0, 0.0]])
