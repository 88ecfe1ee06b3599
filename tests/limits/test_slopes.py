"""Printed check values of robots on slopes, and inputs that once passed as on level ground."""

from __future__ import annotations

import numpy as np
import pytest
from limits.slopes import GENTLE, UP, G, rest_on
from scipy.optimize import brentq
from world.shapes import HILLS, TILTED, plane_map

from trajopt.errors import InfeasibleError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.forces import contact_points
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.tip import Tip
from trajopt.paths.path import Path
from trajopt.robots.robot import robot
from trajopt.timing.scaling import time_scale
from trajopt.timing.track import track
from trajopt.world.plane import Plane
from trajopt.world.ramp import Ramp, Ramps


def test_along_the_contour_of_8_5_degrees():
    samples = rest_on(robot("powerbot"), np.radians(8.5), 0.0)
    rows = Slip(0.332, sides=720, rule="load").rows(samples, robot("powerbot"))
    up, down = rows.a[0] > 1e-9, rows.a[0] < -1e-9
    assert np.min(rows.c[0, up] / rows.a[0, up]) == pytest.approx(1.05, abs=0.005)
    assert np.max(rows.c[0, down] / rows.a[0, down]) == pytest.approx(-1.91, abs=0.005)


def trailing(radius: float) -> np.ndarray:
    """Contacts of PowerBot's castors on a circle to the left: trailing along a smaller circle."""
    found = []
    for y in (0.22, -0.22):
        out = np.array([-0.31, y - radius])  # from the centre of the circle to the pivot
        far, trail = np.hypot(*out), 0.04
        lean = np.arcsin(trail / far)
        ahead = np.array([-out[1], out[0]]) / far
        t = np.cos(lean) * ahead + np.sin(lean) * out / far
        found.append([-0.31, y] - trail * t)
    return np.array(found)


def test_a_circle_of_two_metres_on_8_5_degrees():
    """At its lowest point the circle leans outward downhill: 1.06 m/s braking there, 1.047 m/s at
    steady speed; at its highest 2.6 m/s at steady speed."""
    slope, angle = np.radians(8.5), np.linspace(0, 3 * np.pi, 1081)
    plan = 2 * np.column_stack([np.sin(angle), -np.cos(angle) * np.cos(slope)])
    path = Path.through(plan, start_direction=(1, 0), end_direction=(-1, 0))
    one, plane = robot("powerbot"), Plane(slope, UP)
    on = track(path, one, plane)
    lap = 4 * np.pi
    assert on.path.length == pytest.approx(1.5 * lap, rel=1e-5)
    arms = np.vstack([[[0, 0.268], [0, -0.268]], trailing(2.0)]) - [-0.132, 0.0]
    balance = np.vstack([np.ones(4), arms.T])

    def over(v: float, side: float) -> float:
        """Force of the drive wheels at steady speed over their friction, per unit mass."""
        force = np.array([v**2 * 0.132 / 4, v**2 / 2 + side * G * np.sin(slope)])
        loads = np.linalg.pinv(balance) @ [G * np.cos(slope), *(-0.215 * force)]
        return float(np.hypot(*force) - 0.332 * loads[:2].sum())

    for share, side, low, expected in ((1.0, 1.0, 0.1, 1.047), (0.5, -1.0, 2.0, 2.606)):
        s = np.array([share * lap])
        samples = on.samples(s, on.path.locate(s))
        np.testing.assert_allclose(contact_points(samples, one)[0, 2:], trailing(2.0), atol=1e-5)
        steady = brentq(over, low, 2.8, args=(side,))
        assert steady == pytest.approx(expected, abs=0.005)
        needed = Slip(0.332, rule="load").needed(samples, one, np.zeros(1), np.array([steady**2]))
        assert needed[0] == pytest.approx(1.0, abs=6e-4)  # a spline through points on the circle
    few = Path.through(plan[::4], start_direction=(1, 0), end_direction=(-1, 0))
    lapped = time_scale(few, [Slip(0.332, sides=256, rule="load"), Tip()], robot=one, ground=plane)
    assert np.interp(lap, lapped.s, lapped.sd) == pytest.approx(1.06, abs=0.005)


@pytest.mark.parametrize(
    ("heading", "tangent"), [(-np.pi / 2, 0.132 / 0.7), (0.0, 0.250 / 0.7), (np.pi, 0.250 / 0.7)]
)
def test_slope_at_which_a_high_robot_tips(heading, tangent):
    """10.7 deg facing straight downhill, over the drive axle, and 19.7 deg across."""
    high = robot("powerbot", {"body.cog": [-0.132, 0.0, 0.7]})
    critical = np.arctan(tangent)
    for slope, stands in ((critical - 1e-3, True), (critical + 1e-3, False)):
        rows = Tip().rows(rest_on(high, slope, heading), high)
        assert bool(rows.c.min() >= 0) == stands


def test_slopes_that_slide_at_rest():
    """Across, the drive wheels alone hold PowerBot up to 11.6 deg, as far as force goes; four wheels
    that hold, 18.4."""
    drive, four = robot("powerbot"), robot("swerve")
    for one, tangent in ((drive, 0.332 * 0.218 / 0.35), (four, 0.332)):
        slope, still = np.arctan(tangent), np.zeros(1)
        samples = rest_on(one, slope, 0.0)
        slip = Slip(0.332, rule="load")
        assert slip.needed(samples, one, still, still)[0] == pytest.approx(1.0, rel=1e-9)
    assert np.degrees(np.arctan(0.332 * 0.218 / 0.35)) == pytest.approx(11.6, abs=0.1)
    for degrees, times in ((15, 1.30), (30, 2.8)):
        samples = rest_on(drive, np.radians(degrees), 0.0)
        needed = Slip(0.33, rule="load").needed(samples, drive, still, still)[0]
        assert needed == pytest.approx(times, abs=0.02)
        with pytest.raises(InfeasibleError, match="slip"):
            time_scale(
                Path.through([[0, 0], [5, 0]]),
                [Speed(1.0), Acceleration(0.5, 0.5), Slip(0.33, rule="load"), Tip()],
                robot=drive,
                ground=Plane(np.radians(degrees), UP),
            )


DRIVE = [Speed(1.0), Acceleration(0.3, 0.3)]


@pytest.mark.parametrize("shape", ["plane", "map"])
@pytest.mark.parametrize(
    ("name", "degrees", "direction", "limit"),
    [
        ("powerbot", 30, UP, Slip(0.33)),  # along a contour
        ("powerbot", 30, 0.0, Slip(0.332)),  # straight up
        ("small-differential", 25, UP, Slip(0.332)),
        ("car", 20, UP, Slip(0.3)),
        ("car", 20, 0.0, Slip(0.3)),
        ("tricycle", 15, -0.8, Slip(0.2)),
        ("loc8", 20, 0.3, Slip(0.2)),
        ("omni-3", 15, 2.0, Slip(0.2)),
        ("asoc-4", 15, 0.5, Slip(0.2)),
        ("swerve", 15, 0.5, Slip(0.2)),
        ("high powerbot", 25, UP, Tip()),  # 19.7 deg across
        ("high powerbot", 12, np.pi, Tip()),  # 10.7 deg downhill
        ("high loc8", 28, UP, Tip()),
    ],
)
def test_slopes_that_no_robot_can_hold_on_are_refused(name, degrees, direction, limit, shape):
    """They were driven as on level ground once: gravity across the path did not count."""
    kind = name.split()[-1]
    one = robot(kind)
    if name.startswith("high"):
        one = one.replace({"body.cog": [one.body.cog[0], 0.0, 0.7]})
    free = kind in ("loc8", "omni-3", "asoc-4", "swerve")
    heading = {"heading": [0, 0], "turning_length": 0.5} if free else {}
    line, plane = Path.through([[0, 0], [3, 0]], **heading), Plane(np.radians(degrees), direction)
    ground = plane if shape == "plane" else plane_map(plane)
    with pytest.raises(InfeasibleError, match=limit.name):
        time_scale(line, [*DRIVE, limit], robot=one, ground=ground)
    gentle = Plane(np.radians(3), direction)
    time_scale(line, [*DRIVE, limit], robot=one, ground=gentle)


GROUNDS = {
    "plane": TILTED,
    "map": plane_map(TILTED),
    "hills": HILLS,
    "ramp": Ramps((Ramp((0.5, 0.0), 0.4, 2.0, 0.3, 0.6, "smooth"),), 1.0),
}


@pytest.mark.parametrize("name", ["powerbot", "car"])
@pytest.mark.parametrize("kind", GROUNDS)
def test_a_path_in_space_lies_on_the_ground_or_is_refused(kind, name):
    ground, one = GROUNDS[kind], robot(name)
    path = Path.through(GENTLE)
    plan = path.position(np.linspace(path.start, path.end, 400))
    height = ground.partial(plan[:, 0], plan[:, 1], 0, 0)
    on = Path.through(np.column_stack([plan[:, :2], height]))
    limits = [*DRIVE, Slip(0.9, rule="load"), Tip()]
    found = time_scale(on, limits, robot=one, ground=ground, gridpoints=400)
    laid = time_scale(path, limits, robot=one, ground=ground, gridpoints=400)
    assert found.duration == pytest.approx(laid.duration, rel=1e-3)
    for lift, word in ((0.002, "above"), (-0.002, "below")):
        off = Path.through(np.column_stack([plan[:, :2], height + lift * (plan[:, 0] > 2.0)]))
        with pytest.raises(InfeasibleError, match=f"{word} the ground"):
            time_scale(off, limits, robot=one, ground=ground)


@pytest.mark.parametrize("name", ["powerbot", "car", "tricycle", "small-differential"])
@pytest.mark.parametrize("edge", ["mean", "smooth"])
def test_a_plane_path_over_ramps_is_the_path_laid_over_them_by_hand(name, edge):
    """Speeding up on one ramp and braking down another. A mean edge bends at once, which a spline
    through points cannot: only the ground knows how the robot pitches there."""
    up = Ramp((0.5, 0.0), 0.0, 4.0, 0.35, 0.5, edge)
    ground = Ramps((up, Ramp((5.5, 0.0), 0.0, 2.0, -0.2, 0.5, edge)), 0.3)
    limits = [Speed(2.0), Acceleration(1.0, 1.0), Slip(0.332), Tip()]
    one, path = robot(name), Path.through([[0, 0], [8, 0]])

    def duration(path: Path, ground: Ramps | None) -> float:
        return time_scale(path, limits, robot=one, ground=ground, gridpoints=1600).duration

    over = duration(path, ground)
    assert over > duration(path, None) + (0.04 if name in ("powerbot", "tricycle") else 0.01)
    edges = [np.linspace(c - 0.3, c + 0.3, 61) for c in (0.5, 4.5, 5.5, 7.5)]
    x = np.unique(np.round(np.concatenate([np.linspace(0, 8, 81), *edges]), 9))
    by_hand = Path.through(np.column_stack([x, 0 * x, ground.height(x, 0 * x)]))
    assert duration(by_hand, ground) == pytest.approx(over, rel=1e-3)
    if edge == "smooth":
        assert duration(by_hand, None) == pytest.approx(over, rel=1e-3)
