"""Rows of every wheel against finite differences, platforms against the printed kinematics and
ranks."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.theses.asoc_study import wheel_frame
from benchmarks.theses.textbook import TEXTBOOK, planar
from benchmarks.theses.textbook import wheel as textbook_wheel
from trajopt.errors import ArgumentError
from trajopt.optimize.symbols import numpy_on_symbols
from trajopt.robots.mobility import (
    admissible_at,
    forward_at,
    inverse_at,
    mobility_of,
    pfaffian,
    pfaffian_rows,
    rotation_centre,
    steering_for,
    steering_rates,
)
from trajopt.robots.robot import Robot, robot
from trajopt.robots.wheel import Wheel, WheelKind
from trajopt.systems.asoc.modules import (
    AsocGeometry,
    asoc_robot,
    link_velocities,
    module_inverse,
    module_jacobian,
    wheel_positions,
    wheel_steering,
)
from trajopt.systems.asoc.modules import steering_rates as module_rates

ANGLE = st.floats(-3.0, 3.0)
RATE = st.floats(-2.0, 2.0)
STEP = 1e-5  # s, of the finite differences


def body_at(t: float, twist: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position and rotation of a body with constant world velocity and yaw rate; exact at t = 0."""
    yaw0 = pose[2]
    rotate0 = np.array([[np.cos(yaw0), -np.sin(yaw0)], [np.sin(yaw0), np.cos(yaw0)]])
    yaw = yaw0 + t * twist[2]
    rotate = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    return pose[:2] + rotate0 @ twist[:2] * t, rotate


def wheel_velocity(
    wheel: Wheel, twist: np.ndarray, pose: np.ndarray, beta: float, rate: float
) -> np.ndarray:
    """World velocity of the wheel centre by central differences of its position, from geometry
    alone."""

    def centre(t: float) -> np.ndarray:
        place, rotate = body_at(t, twist, pose)
        heading = wheel.alpha + beta + rate * t - np.pi / 2  # of the wheel plane, in the body
        ahead, left = (
            np.array([np.cos(heading), np.sin(heading)]),
            np.array([-np.sin(heading), np.cos(heading)]),
        )
        return place + rotate @ (
            np.array(wheel.position) + wheel.offset * ahead + wheel.lateral * left
        )

    return (centre(STEP) - centre(-STEP)) / (2 * STEP)


@settings(max_examples=40, deadline=None)
@given(
    kind=st.sampled_from(list(WheelKind)),
    alpha=ANGLE,
    beta=ANGLE,
    gamma=st.floats(-1.2, 1.2),
    offset=st.floats(0.05, 0.4),
    lateral=st.floats(-0.3, 0.3),
    yaw=ANGLE,
    vx=RATE,
    vy=RATE,
    wz=RATE,
    rate=RATE,
    spin=RATE,
)
def test_rows_agree_with_finite_differences(
    kind, alpha, beta, gamma, offset, lateral, yaw, vx, vy, wz, rate, spin
) -> None:
    castor, swedish = kind is WheelKind.CASTOR, kind is WheelKind.SWEDISH
    wheel = Wheel(
        kind,
        0.7,
        alpha,
        beta,
        0.11,
        gamma=gamma if swedish else 0.0,
        offset=-offset if castor else 0.0,
        lateral=lateral if castor else 0.0,
    )
    twist, pose = np.array([vx, vy, wz]), np.array([0.3, -0.2, yaw])
    rate = rate if kind in (WheelKind.CASTOR, WheelKind.STEERED) else 0.0
    velocity = wheel_velocity(wheel, twist, pose, beta, rate)
    heading = yaw + alpha + beta - np.pi / 2
    ahead = np.array([np.cos(heading), np.sin(heading)])
    left = np.array([-np.sin(heading), np.cos(heading)])
    contact = (
        velocity - wheel.radius * spin * ahead
    )  # of the tyre's lowest point, spinning at `spin`
    turn = wheel.gamma
    along = np.cos(turn) * ahead + np.sin(turn) * left
    across = -np.sin(turn) * ahead + np.cos(turn) * left
    roll, slide = wheel.rolling(), wheel.sliding()
    left_over = np.dot((roll.x, roll.y, roll.yaw), twist) - roll.spin * spin - roll.steer * rate
    assert left_over == pytest.approx(contact @ along, abs=1e-8)
    left_over = (
        np.dot((slide.x, slide.y, slide.yaw), twist) - slide.spin * spin - slide.steer * rate
    )
    assert left_over == pytest.approx(contact @ across, abs=1e-8)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("differential", (2, 0, 2)),
        ("bicycle", (1, 1, 2)),
        ("tricycle", (1, 1, 2)),
        ("two-steer", (1, 2, 3)),
        ("three-omni", (3, 0, 3)),
        ("four-mecanum", (3, 0, 3)),
        ("asoc", (3, 0, 3)),
    ],
)
def test_mobility_table(name: str, expected: tuple[int, int, int]) -> None:
    found = mobility_of(TEXTBOOK[name])
    assert (found.mobility, found.steerability, found.manoeuvrability) == expected


def test_two_fixed_wheels_that_are_not_parallel_cannot_drive() -> None:
    places = ((0.5, 0.0, 0.3), (-0.2, 0.4, 1.5), (-0.2, -0.4, -0.9))
    platform = planar(
        "stuck", *(textbook_wheel("fixed", x, y, angle=angle) for x, y, angle in places)
    )
    assert mobility_of(platform).mobility == 0
    assert admissible_at(platform).shape == (3, 0)
    assert np.all(forward_at(platform) == 0)


def test_mecanum_matrices_of_thesis_000() -> None:
    """[guzman2015] has y to the right: its matrices equal ours under y -> -y."""
    a, b, radius = 0.3, 0.25, 0.1
    total = a + b
    printed = np.array([[1, 1, -total], [1, -1, total], [1, -1, -total], [1, 1, total]]) / radius
    mapping = np.diag([1.0, -1.0, 1.0])
    platform = Robot.mecanum(
        name="mine",
        mass=30.0,
        cog=(0.0, 0.0, 0.15),
        chassis=(0.5, 0.4, 0.1),
        clearance=0.1,
        wheelbase=2 * a,
        track=2 * b,
        radius=radius,
        width=0.05,
        wheel_mass=1.0,
        torque=5.0,
        rollers=12,
        roller_radius=0.01,
    )
    np.testing.assert_allclose(platform.inverse, printed @ mapping, atol=1e-12)
    inverse = (
        radius
        / 4
        * np.array([[1, 1, 1, 1], [1, -1, -1, 1], [-1 / total, 1 / total, -1 / total, 1 / total]])
    )
    np.testing.assert_allclose(platform.forward, mapping @ inverse, atol=1e-12)


def test_two_fixed_wheels_drive_as_the_lecture_says() -> None:
    b, radius, v, turn = 0.25, 0.1, 0.8, 0.6
    speeds = radius * TEXTBOOK["differential"].inverse @ np.array([v, 0.0, turn])
    np.testing.assert_allclose(speeds, [v - b * turn, v + b * turn], atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(
    alpha=st.lists(ANGLE, min_size=3, max_size=3),
    vx=RATE,
    vy=RATE,
    wz=RATE,
    split=st.floats(0.1, 0.5),
    offset=st.floats(0.05, 0.3),
)
def test_asoc_rows_give_equations_1_and_18(alpha, vx, vy, wz, split, offset) -> None:
    geometry = AsocGeometry(3, split, offset)
    platform, twist = asoc_robot(geometry), np.array([vx, vy, wz])
    steering = wheel_steering(geometry, alpha)
    speeds = (geometry.wheel_radius * inverse_at(platform, steering) @ twist).reshape(3, 2)
    links = link_velocities(geometry.positions, twist)
    for angle, pair, link in zip(alpha, speeds, links, strict=True):
        c, s, ratio = np.cos(angle), np.sin(angle), offset / split
        printed = np.array(
            [[c / 2 - ratio * s, c / 2 + ratio * s], [s / 2 + ratio * c, s / 2 - ratio * c]]
        )
        np.testing.assert_allclose(printed @ pair, link, atol=1e-10)  # eq. 18
        forward, sideways = c * link[0] + s * link[1], -s * link[0] + c * link[1]
        np.testing.assert_allclose(
            [pair.sum() / 2, ratio * (pair[0] - pair[1])], [forward, sideways], atol=1e-10
        )  # eq. 1
    np.testing.assert_allclose(
        np.repeat(module_rates(alpha, links, offset, wz), 2),
        steering_rates(platform, steering, twist),
        atol=1e-10,
    )
    np.testing.assert_allclose(
        forward_at(platform, steering) @ (speeds.ravel() / geometry.wheel_radius), twist, atol=1e-9
    )


def test_module_inverse_and_platform_angles_agree() -> None:
    alpha = np.array([0.3, -1.0, 2.0])
    product = module_inverse(alpha, 0.21, 0.09, 0.4) @ module_jacobian(alpha, 0.21, 0.09, 0.4)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(2), (3, 2, 2)), atol=1e-12)
    geometry = AsocGeometry(3, 0.21, 0.09)
    turned = asoc_robot(geometry, alpha)
    np.testing.assert_allclose(
        turned.inverse,
        inverse_at(asoc_robot(geometry), wheel_steering(geometry, alpha)),
        atol=1e-12,
    )
    assert turned.admissible.shape == (3, 3)


def test_frames_of_table_viii_put_the_wheels_where_the_rows_have_them() -> None:
    geometry, alpha = AsocGeometry(4, 0.22, 0.09), np.array([0.3, -1.0, 2.0, 0.1])
    for module in range(4):
        for wheel in (1, 2):
            frame = wheel_frame(geometry, module, wheel, float(alpha[module]), 0.0, drop=0.3)
            np.testing.assert_allclose(
                frame[:2, 3], wheel_positions(geometry, alpha)[module, wheel - 1], atol=1e-12
            )
            assert frame[2, 3] == pytest.approx(-0.3)
            np.testing.assert_allclose(frame[:3, :3] @ frame[:3, :3].T, np.eye(3), atol=1e-12)
    tilted = [wheel_frame(geometry, 1, wheel, 0.5, 0.3) for wheel in (1, 2)]
    seen = np.linalg.norm(tilted[0][:2, 3] - tilted[1][:2, 3])
    assert seen == pytest.approx(
        0.22 * np.cos(0.3)
    )  # the split seen from above shrinks (Figure 12)


def test_printed_errors_of_the_lecture_fail_on_a_rolling_wheel() -> None:
    """A unicycle rolling at yaw satisfies R^T and not the R that eqs. 5-10 print."""
    yaw, speed, radius = 0.7, 0.4, 0.1
    platform = planar("unicycle", textbook_wheel("fixed", 0.0, 0.0))
    rates = np.array([speed * np.cos(yaw), speed * np.sin(yaw), 0.3, speed / radius, 0.0])
    np.testing.assert_allclose(pfaffian(platform, yaw=yaw) @ rates, 0.0, atol=1e-12)
    printed = np.array(
        [[np.cos(yaw), -np.sin(yaw), 0.0, -radius, 0.0], [np.sin(yaw), np.cos(yaw), 0.0, 0.0, 0.0]]
    )
    assert np.max(np.abs(printed @ rates)) > 0.1


@pytest.mark.parametrize("kind", [WheelKind.SPHERICAL, WheelKind.SWEDISH])
def test_printed_sliding_rows_lack_a_term(kind: WheelKind) -> None:
    """Spherical: + l sin(beta) (printed -); Swedish: the spin acts along the roller too."""
    wheel = Wheel(kind, 0.5, 0.4, 0.9, 0.1, gamma=np.pi / 4 if kind is WheelKind.SWEDISH else 0.0)
    row = wheel.sliding()
    assert row.yaw == pytest.approx(0.5 * np.sin(0.9 + wheel.gamma))
    assert row.spin == pytest.approx(-0.1 * np.sin(wheel.gamma))


def test_same_rows_on_symbols() -> None:
    platform = asoc_robot(AsocGeometry(2))
    angles = ca.MX.sym("beta", 4)
    with numpy_on_symbols(True):
        matrix = ca.vertcat(
            *[ca.horzcat(*row) for row in pfaffian_rows(platform, [angles[i] for i in range(4)])]
        )
    numbers = np.array([0.3, 0.3, -0.8, -0.8])
    symbolic = np.array(ca.Function("a", [angles], [matrix])(numbers))
    np.testing.assert_allclose(symbolic, pfaffian(platform, numbers), atol=1e-14)


@pytest.mark.parametrize("name", ["bicycle", "tricycle", "two-steer"])
def test_steered_wheels_follow_a_common_centre(name: str) -> None:
    platform = TEXTBOOK[name]
    twist = np.array([0.8, 0.0, 0.5]) if name != "two-steer" else np.array([0.8, 0.3, 0.5])
    angles = steering_for(platform, twist)
    basis = admissible_at(platform, angles)
    np.testing.assert_allclose(basis @ basis.T @ twist, twist, atol=1e-12)
    rates = inverse_at(platform, angles) @ twist
    np.testing.assert_allclose(forward_at(platform, angles) @ rates, twist, atol=1e-12)
    centre = rotation_centre(twist)
    point = centre[:2] / centre[2]
    np.testing.assert_allclose(
        [twist[0] - twist[2] * point[1], twist[1] + twist[2] * point[0]], 0, atol=1e-12
    )


def test_centre_of_a_translation_is_at_infinity_and_of_rest_nowhere() -> None:
    assert rotation_centre([1.0, 0.0, 0.0]).tolist() == pytest.approx([0.0, 1.0, 0.0])
    with pytest.raises(ArgumentError, match="twist"):
        rotation_centre([0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    "call",
    [
        lambda: inverse_at(TEXTBOOK["two-steer"], [0.1]),
        lambda: pfaffian(TEXTBOOK["two-steer"], [np.nan, 0.0]),
        lambda: robot("tank"),
        lambda: AsocGeometry(1),
        lambda: AsocGeometry(3, split=np.nan),
        lambda: asoc_robot(AsocGeometry(3), [0.0]),
        lambda: wheel_frame(AsocGeometry(3), 3, 1, 0.0, 0.0),
        lambda: Wheel(WheelKind.FIXED, 0.5, 0.0, 0.0, 0.1, lateral=0.1),
        lambda: pfaffian_rows(TEXTBOOK["two-steer"], [0.0]),
    ],
)
def test_bad_input_is_refused(call) -> None:
    with pytest.raises(ArgumentError):
        call()
