"""The double wheel: outline, coverage by rollers, clearance, mirrored hubs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.simulate.shapes import support_height, wheel
from trajopt.errors import ArgumentError
from trajopt.robots import robot
from trajopt.simulate.build import build
from trajopt.simulate.double import double_rollers, hub_support
from trajopt.simulate.pybullet import MAX_JOINTS
from trajopt.simulate.rollers import Roller, outline_point

ROUND = np.linspace(-math.pi, math.pi, 3601)
RADIUS, MINOR = 0.098, 0.047


def rollers(**changes):
    section = wheel("loc8-smdw", **changes)
    return double_rollers(section, section.rollers, section.double)


def hub(made: tuple[Roller, ...], side: float) -> tuple[Roller, ...]:
    return tuple(roller for roller in made if roller.centre[1] * side > 0.0)


@pytest.mark.parametrize("shape", ["spheres", "barrel", "ellipsoid"])
def test_rollers_make_the_hub_outline(shape: str) -> None:
    outline = hub_support(RADIUS, MINOR, ROUND)
    built = support_height(hub(rollers(rollers__shape=shape), 1.0), ROUND)
    circle = np.cos(ROUND) < 0.0
    assert np.max(built - outline) < 1e-6
    assert np.min((built - outline)[circle]) > -2e-4
    if shape != "ellipsoid":  # an ellipsoid cannot follow the changing curvature of the ellipse
        assert np.min(built - outline) > -2e-4


def test_the_assembly_is_round_and_the_hubs_are_half_a_turn_apart() -> None:
    made = rollers()
    built = support_height(made, ROUND)
    assert np.max(built) <= RADIUS + 1e-6
    assert np.min(built) >= RADIUS - 5e-5
    outer, inner = (support_height(hub(made, side), ROUND) for side in (1.0, -1.0))
    np.testing.assert_allclose(outer, np.roll(inner[:-1], 1800)[np.r_[0:3600, 0]], atol=1e-7)


@pytest.mark.parametrize(("outer", "side"), [("left", 1.0), ("right", -1.0)])
def test_clearance_lets_a_five_centimetre_step_under_the_outer_hub(outer, side) -> None:
    made, down = rollers(double__outer=outer), np.array([0.0])
    assert RADIUS - support_height(hub(made, side), down)[0] > 0.05
    assert support_height(hub(made, -side), down)[0] == pytest.approx(RADIUS, abs=5e-5)


def test_hubs_stand_a_gap_apart() -> None:
    for gap in (0.03, 0.05):
        places = [abs(roller.centre[1]) for roller in rollers(double__gap=gap, width=0.15)]
        assert places == pytest.approx([(gap + 0.045) / 2] * len(places))


def test_contact_offsets_of_the_thesis_follow_from_the_sizes_fitted_to_them() -> None:
    # [guzman2015], Figure 4.10: 4.63 cm at 30 deg, 3.49 cm at 60 deg; flat-faced cam, offset
    # h'(phi)
    for degrees, printed in ((30.0, 0.0463), (60.0, 0.0349)):
        phi = math.radians(degrees)
        point = outline_point(phi, lambda p: hub_support(0.1029, 0.0554, p))
        along = point @ np.array([math.cos(phi), 0.0, -math.sin(phi)])
        assert abs(along) == pytest.approx(printed, rel=0.01)


def test_a_robot_on_double_wheels_fits_into_bullet() -> None:
    model = build(robot("loc8-smdw"))
    assert len(model.links) - 1 <= MAX_JOINTS
    for k in range(4):
        assert sum(link.mass for link in model.links if link.wheel == k) == pytest.approx(1.44)


@pytest.mark.parametrize(
    ("keys", "named"),
    [
        ({"rollers.mass": 0.06}, "rollers.mass"),
        ({"double.minor_radius": 0.02, "double.roller_radius": 0.03}, "double.roller_radius"),
        ({"double.rollers": 2}, "double.rollers"),
    ],
)
def test_impossible_wheels_name_the_key(keys: dict[str, float], named: str) -> None:
    bad = robot("loc8-smdw", {f"wheels.front-left.{key}": value for key, value in keys.items()})
    with pytest.raises(ArgumentError, match=f"wheels.front-left.{named}"):
        build(bad)
