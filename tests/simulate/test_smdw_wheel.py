"""The double wheel: outline, coverage by rollers, clearance, mirrored hubs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from trajopt.errors import TrajoptError
from trajopt.robots.robot import robot
from trajopt.simulate.pybullet import MAX_JOINTS
from trajopt.simulate.rollers import RollerWheel, Shape, outline_point, support_height
from trajopt.systems.smdw.climbing import DEFAULT_WHEEL as SIZES
from trajopt.systems.smdw.geometry import support_down
from trajopt.systems.smdw.loc8_model import roller_robot
from trajopt.systems.smdw.wheel import smdw_wheel

ROUND = np.linspace(-math.pi, math.pi, 3601)


def built_wheel(left: bool = True, **changes: object) -> RollerWheel:
    """A wheel of the shipped robot with other keys, on its left or right side."""
    keys = {f"wheels.all.{key.replace('__', '.')}": value for key, value in changes.items()}
    return smdw_wheel(robot("loc8-smdw", keys).description.wheels[0 if left else 1])


def hub(wheel: RollerWheel, side: float) -> RollerWheel:
    rollers = tuple(roller for roller in wheel.rollers if roller.centre[1] * side > 0.0)
    return RollerWheel(
        wheel.radius, wheel.width, wheel.angle, rollers, wheel.hub_mass, wheel.roller_mass
    )


@pytest.mark.parametrize("shape", ["spheres", "barrel", "ellipsoid"])
def test_rollers_make_the_hub_outline(shape: Shape) -> None:
    wheel = built_wheel(rollers__shape=shape)
    outline = support_down(SIZES, ROUND)
    built = support_height(hub(wheel, 1.0), ROUND)
    circle = np.cos(ROUND) < 0.0
    assert np.max(built - outline) < 1e-6
    assert np.min((built - outline)[circle]) > -2e-4
    if shape != "ellipsoid":  # an ellipsoid cannot follow the changing curvature of the ellipse
        assert np.min(built - outline) > -2e-4


def test_the_assembly_is_round_and_the_hubs_are_half_a_turn_apart() -> None:
    wheel = built_wheel()
    built = support_height(wheel, ROUND)
    assert np.max(built) <= SIZES.radius + 1e-6
    assert np.min(built) >= SIZES.radius - 5e-5
    outer, inner = (support_height(hub(wheel, side), ROUND) for side in (1.0, -1.0))
    np.testing.assert_allclose(outer, np.roll(inner[:-1], 1800)[np.r_[0:3600, 0]], atol=1e-7)


def test_clearance_lets_a_five_centimetre_step_under_the_outer_hub() -> None:
    for left in (True, False):
        wheel = built_wheel(left)
        side = 1.0 if left else -1.0
        down = np.array([0.0])
        assert SIZES.radius - support_height(hub(wheel, side), down)[0] > 0.05
        assert support_height(hub(wheel, -side), down)[0] == pytest.approx(SIZES.radius, abs=5e-5)


def test_contact_offsets_of_the_thesis_follow_from_the_sizes_fitted_to_them() -> None:
    # [guzman2015], Figure 4.10: 4.63 cm at 30 deg, 3.49 cm at 60 deg; flat-faced cam, offset
    # h'(phi)
    sizes = replace(SIZES, radius=0.1029, minor_radius=0.0554)
    for degrees, printed in ((30.0, 0.0463), (60.0, 0.0349)):
        phi = math.radians(degrees)
        point = outline_point(phi, lambda p: support_down(sizes, p))
        along = point @ np.array([math.cos(phi), 0.0, -math.sin(phi)])
        assert abs(along) == pytest.approx(printed, rel=0.01)


def test_robot_has_the_printed_wheel_mass_and_fits_into_bullet() -> None:
    found = roller_robot(robot("loc8-smdw"))
    assert [wheel.mass for wheel in found.wheels] == pytest.approx([1.44] * 4)
    assert 4 + sum(len(wheel.rollers) for wheel in found.wheels) <= MAX_JOINTS
    np.testing.assert_allclose(
        found.wheel_speeds(0.0, 1.0, 0.0), np.array([-1.0, 1.0, 1.0, -1.0]) / 0.098, rtol=1e-12
    )


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: replace(SIZES, minor_radius=0.2), "minor_radius"),
        (lambda: replace(SIZES, depth=0.0), "depth"),
        (lambda: built_wheel(rollers__count=1), "rollers"),
        (lambda: built_wheel(mass=0.5), "mass"),
        (
            lambda: built_wheel(double__minor_radius=0.02, double__roller_radius=0.03),
            "roller_radius",
        ),
    ],
)
def test_impossible_wheels_name_the_argument(make: object, named: str) -> None:
    with pytest.raises(TrajoptError, match=named):
        make()  # type: ignore[operator]
