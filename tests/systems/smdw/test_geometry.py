"""Two ways to the same wheel: closed form against point cloud, and both against the printed
numbers."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.theses.smdw_study import lifting_torque, meet_step_cloud, outline
from trajopt.errors import ArgumentError
from trajopt.systems.smdw.climbing import (
    DEFAULT_WHEEL,
    FITTED_WHEEL,
    LARGEST_FORWARD_ALPHA,
    Motion,
    clearing_angle,
    climb_window,
    covers_climb,
    forward_alphas,
    lift,
    loc8_smdw,
    region_of_contact,
    verdict,
)
from trajopt.systems.smdw.geometry import DoubleWheel, contact_offset, meet_step, support_down


def turned(angle: float) -> np.ndarray:
    x, z = outline(DEFAULT_WHEEL)
    c, s = math.cos(angle), math.sin(angle)
    return np.stack([c * x + s * z, -s * x + c * z])


@pytest.mark.parametrize("height", [0.02, 0.035, 0.05])
def test_cloud_and_closed_form_agree_on_the_whole_grid(height: float) -> None:
    """Within 1e-4 m and 0.1 deg at every node: no node had to be left out."""
    yaws = np.radians(np.arange(-177.0, 0.0, 9.7))
    for theta in np.radians(np.arange(-180.0, 180.0, 7.3)):
        exact = meet_step(DEFAULT_WHEEL, theta, yaws, height)
        for k, yaw in enumerate(yaws):
            cloud = meet_step_cloud(DEFAULT_WHEEL, float(theta), float(yaw), height)
            where = f"theta {math.degrees(theta):.1f} yaw {math.degrees(yaw):.1f}"
            assert bool(cloud.over) == bool(exact.over[k]), where
            assert cloud.line == pytest.approx(exact.line[k], abs=1e-5), where
            if cloud.over:
                assert cloud.clearance == pytest.approx(exact.clearance[k], abs=1e-4), where
                assert cloud.offset == pytest.approx(exact.offset[k], abs=1e-4), where
                assert cloud.arm == pytest.approx(exact.arm[k], abs=1e-4), where
                assert math.degrees(cloud.tangent) == pytest.approx(
                    math.degrees(exact.tangent[k]), abs=0.1
                ), where


@given(st.floats(-7.0, 7.0))
def test_support_function_is_the_lowest_point_of_the_outline(angle: float) -> None:
    x, z = turned(angle)
    lowest = int(np.argmin(z))
    assert support_down(DEFAULT_WHEEL, angle) == pytest.approx(-z[lowest], abs=1e-7)
    if (
        abs(math.cos(angle)) > 1e-3
    ):  # at the joint of circle and ellipse the lowest point is the same
        assert contact_offset(DEFAULT_WHEEL, angle) == pytest.approx(x[lowest], abs=1e-4)


@settings(max_examples=60)
@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, 0.0), st.floats(0.005, 0.09))
def test_no_point_of_either_hub_contradicts_the_meeting(
    theta: float, yaw: float, height: float
) -> None:
    """Straight from the definition: nothing of the carrying hub below the step is beyond the line,
    and nothing of the lifted hub beyond the line is below the clearance."""
    found = meet_step(DEFAULT_WHEEL, theta, yaw, height)
    half, full = DEFAULT_WHEEL.gap / 2, DEFAULT_WHEEL.gap / 2 + DEFAULT_WHEEL.depth
    facing_lifted = math.cos(theta) >= 0
    for facing, lifted in ((True, facing_lifted), (False, not facing_lifted)):
        x, z = turned(theta if facing else theta + math.pi)
        for y in (half, full):
            ahead = math.cos(yaw) * x - math.sin(yaw) * (y if facing else -y) - found.line
            up = z + DEFAULT_WHEEL.radius
            if lifted:
                beyond = up[ahead > 1e-5]
                assert beyond.size == 0 or beyond.min() > found.clearance - 1e-4
            else:
                assert ahead[up < height - 1e-9].max() < 1e-9


def test_printed_contact_offsets_are_met_by_fitted_sizes_only() -> None:
    printed = [0.0463, 0.0349]  # m at 30 and 60 deg, Figure 4.10
    angles = np.radians([30.0, 60.0])
    assert contact_offset(FITTED_WHEEL, angles) == pytest.approx(printed, rel=0.01)
    assert FITTED_WHEEL.greatest_clearance == pytest.approx(0.0475, abs=1e-4)
    assert not verdict(FITTED_WHEEL, 0.0, Motion.LEFT, 0.0, 0.05).climbs
    assert contact_offset(DEFAULT_WHEEL, angles) == pytest.approx([0.05027, 0.03636], abs=1e-5)
    assert contact_offset(DEFAULT_WHEEL, np.radians([0.0, 90.0])) == pytest.approx(
        [0.0, 0.0], abs=1e-15
    )


def test_forward_range_of_a_five_centimetre_step_contains_35_degrees() -> None:
    low, high = forward_alphas(DEFAULT_WHEEL, 0.05, theta=0.0) or (0.0, 0.0)
    assert math.degrees(low) == pytest.approx(34.6, abs=0.2)
    assert low < math.radians(35) < high == pytest.approx(LARGEST_FORWARD_ALPHA, abs=1e-3)
    any_low, _ = forward_alphas(DEFAULT_WHEEL, 0.05) or (0.0, 0.0)
    assert any_low < low
    assert forward_alphas(FITTED_WHEEL, 0.05) is None


def test_windows_end_where_the_hub_no_longer_clears_the_step() -> None:
    for height in (0.035, 0.05):
        lateral = climb_window(DEFAULT_WHEEL, Motion.LEFT, 0.0, height)
        assert lateral is not None
        assert support_down(DEFAULT_WHEEL, lateral.high) == pytest.approx(
            DEFAULT_WHEEL.radius - height, abs=1e-12
        )
        forward = climb_window(DEFAULT_WHEEL, Motion.FORWARD, math.radians(-35), height)
        assert forward is not None
        for angle, climbs in (
            (forward.low, True),
            (forward.high, True),
            (forward.low - 0.01, False),
            (forward.high + 0.01, False),
        ):
            assert (
                verdict(DEFAULT_WHEEL, angle, Motion.FORWARD, math.radians(-35), height).climbs
                is climbs
            )
    assert climb_window(DEFAULT_WHEEL, Motion.LEFT, 0.0, 0.052) is None
    assert climb_window(DEFAULT_WHEEL, Motion.FORWARD, 0.0, 0.05) is None


def test_lateral_cover_ends_between_ten_and_thirty_degrees() -> None:
    """Figure 4.13: at 10 deg the projection covers the region of contact, at 30 deg it does not."""
    assert covers_climb(DEFAULT_WHEEL, math.radians(10), 0.05)
    assert not covers_climb(DEFAULT_WHEEL, math.radians(30), 0.05)
    assert not covers_climb(DEFAULT_WHEEL, math.radians(-30), 0.05)
    low, high = region_of_contact(DEFAULT_WHEEL)
    assert low == pytest.approx(0.0, abs=1e-9)
    # The greatest contact offset of an ellipse is Rc - Re.
    assert high == pytest.approx(DEFAULT_WHEEL.greatest_clearance, rel=1e-5)


def test_lifting_torque_is_the_slope_of_the_lift() -> None:
    """Virtual work: load * d(lift)/d(theta) = torque."""
    theta, step = np.linspace(0.05, 1.5, 40), 1e-6
    slope = (lift(DEFAULT_WHEEL, theta + step) - lift(DEFAULT_WHEEL, theta - step)) / (2 * step)
    assert lifting_torque(DEFAULT_WHEEL, theta, 50.0) == pytest.approx(50.0 * slope, rel=1e-6)


def test_bad_input_is_named() -> None:
    with pytest.raises(ArgumentError, match="minor_radius"):
        DoubleWheel(0.1, 0.2, 0.04, 0.03)
    with pytest.raises(ArgumentError, match="height"):
        meet_step(DEFAULT_WHEEL, 0.0, -1.0, 0.2)
    with pytest.raises(ArgumentError, match="yaw"):
        meet_step(DEFAULT_WHEEL, 0.0, 0.5, 0.05)
    with pytest.raises(ArgumentError, match="height"):
        clearing_angle(DEFAULT_WHEEL, 0.06)
    with pytest.raises(ArgumentError, match="height"):
        verdict(DEFAULT_WHEEL, 0.0, Motion.LEFT, 0.0, -0.01)
    assert "at most Rc - Re" in verdict(DEFAULT_WHEEL, 0.0, Motion.LEFT, 0.0, 0.06).reason


def test_footprint_holds_all_wheels() -> None:
    robot = loc8_smdw()
    assert robot.name == "loc8-smdw"
    assert max(x for x, _ in robot.footprint) == pytest.approx(0.376 + 0.098)
    assert max(y for _, y in robot.footprint) == pytest.approx(0.316 + 0.06)
