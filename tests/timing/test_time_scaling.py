"""Time scaling against closed forms, on every limit and path, and its failures."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scaling_cases import (
    ARGUMENTS,
    PATHS,
    ROBOTS,
    limit,
    random_limits,
    random_path,
    robot_for,
)

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.limit import is_linear
from trajopt.limits.registry import LIMITS
from trajopt.paths.path import Path
from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.timing.scaling import time_scale

ENGINES = ("toppra", "compiled")
KEPT = -1e-9


def trapezoid(
    length: float,
    speed: float,
    forward: float,
    braking: float,
    start: float = 0.0,
    end: float = 0.0,
) -> float:
    """Least time on a straight line with speed, acceleration and braking limits."""
    peak2 = (2 * forward * braking * length + braking * start**2 + forward * end**2) / (
        forward + braking
    )
    peak = min(speed, np.sqrt(peak2))
    cruise = length - (peak**2 - start**2) / (2 * forward) - (peak**2 - end**2) / (2 * braking)
    return (peak - start) / forward + (peak - end) / braking + max(cruise, 0.0) / peak


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("speed", "forward", "braking", "start", "end"),
    [
        (1.0, 0.5, 1.0, 0.0, 0.0),
        (9.0, 0.5, 1.0, 0.0, 0.0),
        (1.0, 2.0, 0.7, 0.4, 0.9),
        (1.0, 1.0, 1.0, 1.0, 1.0),
    ],
)
def test_straight_line_takes_the_bang_bang_time(engine, speed, forward, braking, start, end):
    path = Path.through([[0, 0], [1, 1], [2, 2]])
    limits = [
        limit("speed", largest=speed),
        limit("acceleration", forward=forward, braking=braking),
    ]
    result = time_scale(path, limits, start_speed=start, end_speed=end, engine=engine)
    # The switching points lie between gridpoints: error of second order in the grid.
    expected = trapezoid(path.length, speed, forward, braking, start, end)
    assert result.duration == pytest.approx(expected, rel=2e-5)
    assert result.sd[0] * result.slowdown == pytest.approx(start, abs=1e-9)
    assert result.sd[-1] * result.slowdown == pytest.approx(end, abs=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_circle_is_driven_at_the_speed_friction_allows(engine):
    radius, friction, angles = 2.0, 0.3, np.linspace(0, 2 * np.pi, 121)
    points = radius * np.column_stack([np.sin(angles), 1 - np.cos(angles)])
    path = Path.through(points, start_direction=(1.0, 0.0), end_direction=(1.0, 0.0))
    robot = ROBOTS["rear_cog"]
    result = time_scale(
        path, [limit("slip", friction=friction, sides=64, rule="load")], robot=robot, engine=engine
    )
    middle = slice(len(result.s) // 3, 2 * len(result.s) // 3)
    # Steady turn about the centre: the centre of gravity, 0.132 m behind, needs wz^2 (0.132, R).
    x, load = 0.132, (0.35 - 0.132) / 0.35
    wz2 = result.sd[middle] ** 2 / radius**2
    forward_transfer = -robot.body.cog[2] * x * wz2 / 0.35
    left = wz2 * np.hypot(x, radius)
    right = friction * (load * STANDARD_GRAVITY + forward_transfer)
    assert np.median(left / right) == pytest.approx(1.0, abs=3e-3)
    assert result.active[0].limit == "slip"


@pytest.mark.parametrize("engine", [*ENGINES, "linear"])
@pytest.mark.parametrize("shape", PATHS)
@pytest.mark.parametrize("name", LIMITS)
def test_every_limit_on_every_path_keeps_its_margin(name, shape, engine):
    robot = robot_for(name, shape)
    limits = [limit(name)]
    if name not in ("speed", "speed_zones", "speed_profile"):
        limits.append(limit("speed", name="cap", largest=3.0))
    if name in (
        "speed",
        "speed_zones",
        "speed_profile",
        "wheel_speed",
        "yaw_rate",
        "steering_rate",
    ):
        limits.append(limit("acceleration", name="push"))
    if name == "speed_zones":
        limits.append(limit("speed", name="cap", largest=3.0))
    if engine in ("linear", "toppra") and not is_linear(limits[0]):
        with pytest.raises(ArgumentError, match=name):
            time_scale(PATHS[shape], limits, robot=robot, gridpoints=60, engine=engine)
        return
    result = time_scale(PATHS[shape], limits, robot=robot, gridpoints=60, engine=engine)
    margins = result.margins()
    assert set(margins) == {one.name for one in limits}
    assert min(margins.values()) >= KEPT
    assert 1.0 <= result.slowdown <= 1.001
    assert result.s[0] == 0
    assert result.s[-1] == pytest.approx(PATHS[shape].length, rel=1e-12)
    assert np.isin(np.round(PATHS[shape].knot_parameters, 9), np.round(result.s, 9)).all()
    if engine != "linear":
        assert any(stretch.limit for stretch in result.active)


def test_registry_names_are_the_limits_names():
    assert set(ARGUMENTS) == set(LIMITS)
    for name in LIMITS:
        assert limit(name).name == name


@settings(max_examples=25, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6))
def test_random_motions_keep_limits_and_beat_linear(seed):
    rng = np.random.default_rng(seed)
    path = random_path(rng, free_heading=True, knots=int(rng.integers(3, 6)))
    limits, robot = random_limits(rng), ROBOTS["loc8"]
    linear = time_scale(path, limits, robot=robot, gridpoints=150, engine="linear")
    fast = time_scale(
        path,
        limits,
        robot=robot,
        gridpoints=150,
        start_speed=float(linear.sd[0]),
        end_speed=float(linear.sd[-1]),
    )
    assert min(fast.margins().values()) >= KEPT
    assert min(linear.margins().values()) >= KEPT
    assert fast.duration <= linear.duration * (1 + 1e-9)
    looser = [limit("speed", largest=limits[0].largest * 1.3), *limits[1:]]
    freer = time_scale(
        path,
        looser,
        robot=robot,
        gridpoints=150,
        start_speed=float(linear.sd[0]),
        end_speed=float(linear.sd[-1]),
    )
    assert freer.duration <= fast.duration * (1 + 2e-5)


@pytest.mark.parametrize("engine", ENGINES)
class TestInfeasible:
    straight = PATHS["straight"]

    def expect(self, name: str, place: float, *args, **kwargs) -> InfeasibleError:
        with pytest.raises(InfeasibleError) as caught:
            time_scale(*args, **kwargs)
        assert caught.value.limit == name
        assert caught.value.place == pytest.approx(place, abs=0.05)
        return caught.value

    def test_start_speed_too_high_to_brake(self, engine):
        limits = [limit("speed", largest=9.0), limit("acceleration", braking=0.5)]
        error = self.expect(
            "acceleration", 0.0, self.straight, limits, start_speed=2.0, engine=engine
        )
        assert "1.41421" in str(error)

    def test_start_speed_above_the_speed_limit(self, engine):
        limits = [limit("speed", largest=1.0), limit("acceleration")]
        self.expect("speed", 0.0, self.straight, limits, start_speed=1.5, engine=engine)

    def test_end_speed_above_the_speed_limit(self, engine):
        limits = [limit("speed", largest=1.0), limit("acceleration")]
        self.expect("speed", 2.0, self.straight, limits, end_speed=1.5, engine=engine)

    def test_end_speed_out_of_reach(self, engine):
        limits = [limit("speed", largest=9.0), limit("acceleration", forward=0.5)]
        self.expect("acceleration", 0.0, self.straight, limits, end_speed=2.0, engine=engine)

    def test_friction_too_low_for_the_ramp(self, engine):
        path = Path.through(
            [[0, 0, 0], [1, 0, 0], [2, 0, 0.3], [3, 0, 0.6], [4, 0, 0.6], [5, 0, 0.6]]
        )
        limits = [limit("speed"), limit("slip", friction=0.1)]
        # Momentum could carry it up the last metre; before 2.51 m that needs more than the speed
        # limit.
        error = self.expect("slip", 2.51, path, limits, robot=ROBOTS["rear_cog"], engine=engine)
        assert "standing still" in str(error)

    def test_zone_of_speed_zero(self, engine):
        limits = [
            limit("speed"),
            limit("acceleration"),
            limit("speed_zones", zones=((0.5, 0.7, 0.0),)),
        ]
        self.expect("speed_zones", 0.5, self.straight, limits, engine=engine)

    def test_profile_that_falls_to_zero_inside(self, engine):
        limits = [
            limit("speed"),
            limit("acceleration"),
            limit("speed_profile", places=(0.0, 1.0, 2.0), speeds=(1.0, 0.0, 1.0)),
        ]
        self.expect("speed_profile", 1.0, self.straight, limits, engine=engine)

    def test_turn_on_the_spot_that_nothing_bounds(self, engine):
        spot = Path.through([[0, 0], [1, 0], [1.0000001, 0], [2, 0]], heading=[0, 0, 2, 2])
        with pytest.raises(InfeasibleError):
            time_scale(spot, [limit("acceleration")], robot=ROBOTS["loc8"], engine=engine)

    def test_sideways_motion_of_a_differential_drive(self, engine):
        with pytest.raises(InfeasibleError, match="cannot roll"):
            time_scale(PATHS["sideways"], [limit("speed")], robot=ROBOTS["rear_cog"], engine=engine)


def test_path_that_doubles_back_names_the_place():
    with pytest.raises(InfeasibleError) as caught:
        time_scale(Path.through([[0, 0], [1, 0], [0, 0]]), [limit("speed"), limit("acceleration")])
    assert caught.value.limit == "path"
    assert caught.value.place == pytest.approx(caught.value.place)


@pytest.mark.parametrize(
    "change",
    [
        {"start_speed": -1.0},
        {"end_speed": float("nan")},
        {"gridpoints": 1},
        {"gridpoints": [0.0, 5.0]},
        {"engine": "magic"},
        {"engine": "linear", "start_speed": 1.0},
        {"limits": []},
        {"limits": [limit("speed"), limit("speed")]},
        {"limits": [limit("wheel_speed")]},
    ],
)
def test_bad_arguments_are_named(change):
    arguments = {"limits": [limit("speed"), limit("acceleration")], **change}
    with pytest.raises(ArgumentError):
        time_scale(PATHS["straight"], **arguments)
