"""Isotropy against singular values, closed forms and [udengaard2008]'s Tables I, II, eq. 4 and
Figures 9, 11."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.theses.asoc_study import best_ratio
from trajopt.errors import ArgumentError
from trajopt.robots.mobility import forward_at, inverse_at
from trajopt.systems.asoc.isotropy import Contact, isotropy, mean_isotropy, spread_modules
from trajopt.systems.asoc.modules import AsocGeometry, asoc_robot, wheel_steering

# [udengaard2008], Table I by converged quadrature (an independent computation): N, lost, partial ->
# value.
TABLE_1 = [
    (2, (), (0,), 0.450),
    (2, (), (0, 1), 0.0),
    (3, (), (), 1.0),
    (3, (), (0,), 0.702),
    (3, (), (0, 1), 0.508),
    (3, (), (0, 1, 2), 0.266),
    (3, (0,), (), 0.5774),
    (3, (0,), (1,), 0.370),
    (3, (0,), (1, 2), 0.0),
    (4, (), (), 1.0),
    (4, (), (0,), 0.789),
    (4, (), (0, 1), 0.643),
    (4, (), (0, 2), 0.707),
    (4, (), (0, 1, 2), 0.544),
    (4, (), (0, 1, 2, 3), 0.396),
    (4, (0,), (), 0.7071),
    (4, (0,), (1,), 0.5525),
    (4, (0,), (2,), 0.759),
    (4, (0,), (1, 2), 0.485),
    (4, (0,), (1, 2, 3), 0.257),
    (4, (0, 1), (), 0.4142),
    (4, (0, 1), (2,), 0.290),
    (4, (0, 1), (2, 3), 0.0),
]


def mean(*arguments, **options):
    return mean_isotropy(*arguments, rng=np.random.default_rng(1), **options)


@pytest.mark.parametrize(("modules", "lost", "partial", "expected"), TABLE_1)
def test_table_1(modules, lost, partial, expected) -> None:
    found = mean(spread_modules(modules), 2.0, contact=Contact(lost, partial))
    assert found.value == pytest.approx(expected, abs=0.002)
    assert found.error < 1e-3


@pytest.mark.parametrize(
    ("degrees", "expected", "ratio"), [(15, 0.9871, 2.07), (30, 0.9505, 2.27), (45, 0.8962, 2.83)]
)
def test_table_2(degrees, expected, ratio) -> None:
    tilt = np.radians(degrees)
    found = mean(
        spread_modules(4),
        ratio,
        tilts=(-tilt, 0.0, tilt),
        jacobian="forward",
        points=1024,
        shifts=4,
    )
    assert found.value == pytest.approx(expected, abs=0.002)


@pytest.mark.parametrize("jacobian", ["inverse", "forward"])
@pytest.mark.parametrize(
    ("ratio", "expected"), [(1.0, 0.58), (1.5, 0.79), (2.0, 1.0), (2.5, 0.83), (3.0, 0.72)]
)
def test_figure_9(ratio, expected, jacobian) -> None:
    assert mean(spread_modules(3), ratio, jacobian=jacobian).value == pytest.approx(
        expected, abs=0.005
    )


@pytest.mark.parametrize(
    ("degrees", "expected"),
    [((120, 240), 1.0), ((90, 180), 0.707), ((60, 120), 0.447), ((30, 60), 0.216), ((0, 0), 0.0)],
)
def test_figure_11(degrees, expected) -> None:
    angles = np.radians([0, *degrees])
    places = np.column_stack([np.cos(angles), np.sin(angles)])
    assert mean(places, 2.0).value == pytest.approx(expected, abs=0.005)


@pytest.mark.parametrize("degrees", [10, 30, 45])
def test_equation_4(degrees) -> None:
    """One tilt common to all modules: the best ratio is 2/cos(beta), where isotropy is 1."""
    tilt = np.radians(degrees)
    ratios = np.linspace(1.8, 3.2, 701)
    values = np.array(
        [mean(spread_modules(3), r, tilts=(tilt,), points=64, shifts=2).value for r in ratios]
    )
    assert best_ratio(values, ratios)[0] == pytest.approx(2 / np.cos(tilt), rel=0.005)
    assert values.max() == pytest.approx(1.0, abs=0.002)


def test_gram_formula_equals_singular_values_of_the_platform() -> None:
    rng = np.random.default_rng(3)
    geometry = AsocGeometry(3, split=0.23, offset=0.09, module_radius=0.6)
    platform = asoc_robot(geometry)
    for _ in range(20):
        alpha = rng.uniform(-np.pi, np.pi, 3)
        rows = inverse_at(platform, wheel_steering(geometry, alpha)) / [1.0, 1.0, 0.6]
        singular = np.linalg.svd(rows, compute_uv=False)
        found = isotropy(geometry.positions, 0.23 / 0.09, alpha[None], length=0.6)
        assert found[0] == pytest.approx(singular[-1] / singular[0], rel=1e-9)


def test_at_ratio_two_least_squares_agree_with_the_mean_of_equation_2() -> None:
    geometry = AsocGeometry(3)
    platform = asoc_robot(geometry)
    alpha = np.array([0.3, 1.0, -2.0])
    singular = np.linalg.svd(
        forward_at(platform, wheel_steering(geometry, alpha)) * [[1], [1], [0.5]], compute_uv=False
    )
    found = isotropy(geometry.positions, 2.0, alpha[None], length=0.5, jacobian="forward")
    assert found[0] == pytest.approx(singular[-1] / singular[0], rel=1e-9)


def test_error_shrinks_with_points() -> None:
    contact = Contact((), (0, 1, 2, 3))
    coarse = mean(spread_modules(4), 2.0, contact=contact, points=64)
    fine = mean(spread_modules(4), 2.0, contact=contact, points=4096)
    assert fine.error < coarse.error / 4
    assert abs(fine.value - coarse.value) < 6 * coarse.error


def test_same_seed_same_bits() -> None:
    assert mean(spread_modules(3), 1.7) == mean(spread_modules(3), 1.7)


@pytest.mark.parametrize(
    "call",
    [
        lambda: mean(spread_modules(3), 0.0),
        lambda: mean(spread_modules(3), np.nan),
        lambda: mean(spread_modules(3), 2.0, contact=Contact((0,), (0,))),
        lambda: mean(spread_modules(2), 2.0, contact=Contact((0, 1))),
        lambda: mean(spread_modules(3), 2.0, tilts=()),
        lambda: mean(spread_modules(3), 2.0, tilts=(2.0,)),
        lambda: mean(spread_modules(3), 2.0, length=0.0),
        lambda: mean(spread_modules(3), 2.0, jacobian="both"),
        lambda: isotropy(spread_modules(3), 2.0, np.zeros((4, 2))),
        lambda: isotropy([1.0, 2.0], 2.0, np.zeros((4, 2))),
    ],
)
def test_bad_input_is_refused(call) -> None:
    with pytest.raises(ArgumentError):
        call()
