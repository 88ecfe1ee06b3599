"""Turning or mirroring a scene, or making everything heavier, changes no time."""

from __future__ import annotations

import numpy as np
import pytest
from limits.slopes import CURVE, GENTLE
from world.shapes import plane_map

from trajopt.limits.contact import Contact
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.tip import Tip
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.paths.path import Path
from trajopt.robots.robot import Robot, robot, robot_names
from trajopt.timing.scaling import time_scale
from trajopt.world.ground import Ground
from trajopt.world.height_map import HeightMap
from trajopt.world.plane import Plane
from trajopt.world.ramp import Ramp, Ramps

AXIS = np.arange(-30, 31) * 0.2
HEIGHTS = 0.15 * np.sin(AXIS[None, :]) * np.cos(1.3 * AXIS[:, None] + 0.4) + 0.03 * AXIS[:, None]


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array(points) @ np.array([[c, s], [-s, c]])


def ground_of(kind: str, quarters: int, angle: float, side: float) -> Ground:
    """A ground that is turned by quarters of a turn, and ``angle``, and mirrored in y first."""
    if kind == "plane":
        return Plane(0.15, side * 0.7 + angle)
    if kind == "ramp":
        place = turned(np.array([0.6, side * 0.2]), angle)
        return Ramps((Ramp(tuple(place), side * 0.3 + angle, 1.5, 0.25, 0.6, "smooth"),), 1.0)
    heights = HEIGHTS if side > 0 else HEIGHTS[::-1]
    for _ in range(quarters):  # z'(x, y) = z(y, -x)
        heights = heights[::-1].T
    return HeightMap(np.ascontiguousarray(heights), 0.2, (float(AXIS[0]), float(AXIS[0])))


def duration(
    one: Robot, kind: str, quarters: int = 0, angle: float = 0.0, side: float = 1.0
) -> float:
    free = one.drivable.shape[1] == 3
    points = np.array(CURVE if free else GENTLE)
    heading = np.array([0.2, 1.0, 0.1, -0.7]) if free else None
    angle = angle + quarters * np.pi / 2
    yaw = None if heading is None else side * heading + angle
    path = Path.through(turned(points * [1, side], angle), heading=yaw, turning_length=0.5)
    radius = min(wheel.radius for wheel in one.description.wheels)
    limits = [
        Speed(1.2),
        WheelSpeed(1.4 / radius),
        WheelAcceleration(2.0 / radius),
        Slip(0.8, rule="capacity" if one.name in ("powerbot", "car", "swerve") else "least_norm"),
        Tip(),
        Contact(),
    ]
    ground = ground_of(kind, quarters, angle, side)
    return time_scale(path, limits, robot=one, ground=ground, gridpoints=60).duration


@pytest.mark.parametrize("name", robot_names())
def test_times_do_not_change_when_hills_turn_or_are_mirrored(name):
    one = robot(name)
    first = duration(one, "hills")
    assert duration(one, "hills", quarters=1) == pytest.approx(first, rel=1e-9)
    assert duration(one, "hills", quarters=2, side=-1.0) == pytest.approx(first, rel=1e-9)


@pytest.mark.parametrize("kind", ["plane", "ramp"])
@pytest.mark.parametrize("name", robot_names())
def test_times_do_not_change_when_slopes_turn_or_are_mirrored(name, kind):
    one = robot(name)
    first = duration(one, kind)
    assert duration(one, kind, angle=1.1) == pytest.approx(first, rel=1e-9)
    assert duration(one, kind, angle=-2.4, side=-1.0) == pytest.approx(first, rel=1e-9)


def test_a_robot_with_its_weight_on_one_side_is_mirrored_with_the_scene():
    times = []
    for side in (1.0, -1.0):
        one = robot("loc8", {"body.cog": [0.02, side * 0.1, 0.2]})
        times.append([duration(one, kind, side=side) for kind in ("plane", "ramp", "hills")])
    np.testing.assert_allclose(*times, rtol=1e-9)
    other = robot("loc8", {"body.cog": [0.02, 0.1, 0.2]})
    assert abs(duration(other, "plane", side=-1.0) / times[0][0] - 1) > 1e-6


@pytest.mark.parametrize("name", ["powerbot", "loc8", "asoc-4", "swerve", "car"])
def test_a_plane_height_map_is_the_plane(name):
    one, plane = robot(name), Plane(0.15, 0.7)
    free = one.drivable.shape[1] == 3
    path = Path.through(
        CURVE if free else [[0, 0], [1, 0.1], [2, -0.1], [3, 0.2]],
        heading=[0.2, 1.0, 0.1, -0.7] if free else None,
        turning_length=0.5,
    )
    limits = [Speed(1.2), WheelAcceleration(20.0), Slip(0.7), Tip()]
    ramp = Ramp((-4.0, -2.0), 0.7, 12.0, 12.0 * np.tan(0.15), 0.5)
    times = [
        time_scale(path, limits, robot=one, ground=ground, gridpoints=100).duration
        for ground in (plane, plane_map(plane), Ramps((ramp,), 1.0))
    ]
    assert times[1] == pytest.approx(times[0], rel=1e-6)
    assert times[2] == pytest.approx(times[0], rel=1e-6)


def heavier(one: Robot, by: float, parts: float) -> Robot:
    """Mass and yaw inertia times ``by``, masses of wheels, rollers and pivots times ``parts``."""
    found: dict = {"body.mass": one.body.mass * by, "body.yaw_inertia": one.yaw_inertia * by}
    for key in ("wheels", "pivots"):
        rows = [row.model_dump(exclude_none=True) for row in getattr(one.description, key)]
        if rows:
            found[key] = [{**row, "mass": row["mass"] * parts} for row in rows]
    return one.replace(found)


@pytest.mark.parametrize("name", robot_names())
def test_mass_does_not_matter(name):
    """On a plane only the yaw inertia counts; on hills that of pitch and roll too."""
    one = robot(name)
    assert duration(heavier(one, 3.0, 1.0), "plane") == pytest.approx(
        duration(one, "plane"), rel=1e-9
    )
    hills = duration(one, "hills")
    assert duration(heavier(one, 3.0, 3.0), "hills") == pytest.approx(hills, rel=1e-9)
