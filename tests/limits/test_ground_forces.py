"""Forces and loads on slopes: closed forms on planes for every robot, printed check values,
invariances."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from world.shapes import plane_map

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.contact import Contact
from trajopt.limits.forces import contact_loads, contact_points, ground_moment, specific_force
from trajopt.limits.friction import FrictionAlong, FrictionMap
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.tip import Tip, moving_edges, support_edges
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import STANDARD_GRAVITY, Robot, robot, robot_names
from trajopt.timing.scaling import time_scale
from trajopt.timing.track import track
from trajopt.world.height_map import HeightMap
from trajopt.world.plane import Plane
from trajopt.world.ramp import Ramp, Ramps

G, UP = STANDARD_GRAVITY, np.pi / 2  # planes here rise along y
CURVE = [[0, 0], [1, 0.4], [2, -0.2], [3, 0.5]]
GENTLE = [[0, 0], [1.5, 0.2], [3, -0.1], [4.5, 0.3]]


def along_of(
    one: Robot, ground: Plane | HeightMap | Ramps, path: Path, s: np.ndarray
) -> PathSamples:
    found = track(path, one, ground)
    return found.samples(s, found.path.locate(s))


def rest_on(one: Robot, slope: float, heading: float) -> PathSamples:
    """One sample of a straight path in a direction (rad, x across the slope)."""
    line = Path.through([[0, 0], [5 * np.cos(heading), 5 * np.sin(heading)]])
    return along_of(one, Plane(slope, UP), line, np.array([2.0]))


def geometry(path: Path, u: np.ndarray, plane: Plane) -> tuple[np.ndarray, ...]:
    """Tangent, lateral axis, normal (3, N), curvature and its derivative along the path, written
    out for a path in space on a plane."""
    d1, d2, d3 = (path.position(u, k).T for k in (1, 2, 3))
    n = np.array([-plane.gradient[0], -plane.gradient[1], 1.0])
    n = (n / np.linalg.norm(n))[:, None] * np.ones(len(u))
    g = np.linalg.norm(d1, axis=0)
    t = d1 / g
    turn = np.sum(n * np.cross(d1.T, d2.T).T, axis=0)
    turn1 = np.sum(n * np.cross(d1.T, d3.T).T, axis=0)
    kappa = turn / g**3
    kappa1 = turn1 / g**4 - 3 * turn * np.sum(d1 * d2, axis=0) / g**6
    return t, np.cross(n.T, t.T).T, n, kappa, kappa1


@pytest.mark.parametrize("degrees", [0.0, 7.0, 18.0, 30.0])
@pytest.mark.parametrize("name", robot_names())
def test_driving_on_a_plane_in_closed_form(name, degrees):
    """f = (s'' + g.t, kappa s'^2 + g.l, g.n) plus what the centre of gravity off the origin adds;
    loads are affine in place and balance force and moments."""
    one, rng = robot(name), np.random.default_rng(int(degrees) + len(name))
    x, y, h = one.body.cog
    for points in ([[0, 0], [4, 0]], GENTLE):
        turn = rng.uniform(-np.pi, np.pi)
        cos, sin = np.cos(turn), np.sin(turn)
        path = Path.through(np.array(points) @ np.array([[cos, sin], [-sin, cos]]))
        plane = Plane(np.radians(degrees), rng.uniform(-np.pi, np.pi))
        on = track(path, one, plane)
        s = np.linspace(0.1, on.path.length - 0.1, 23)
        u = on.path.locate(s)
        samples = on.samples(s, u)
        t, left, n, k, k1 = geometry(on.path, u, plane)
        zero, one_ = 0 * k, 0 * k + 1
        expected = {
            "a": [one_ - k * y, k * x, zero],
            "b": [-k1 * y - k**2 * x, k + k1 * x - k**2 * y, zero],
            "c": [G * t[2], G * left[2], G * n[2]],
        }
        force, moment = specific_force(samples, one.body), ground_moment(samples, one.body)
        loads, arms = contact_loads(samples, one), contact_points(samples, one) - [x, y]
        arms = np.broadcast_to(arms, (len(s), *arms.shape[-2:]))
        for part in "abc":
            f = getattr(force, part)
            np.testing.assert_allclose(f, np.column_stack(expected[part]), atol=1e-9)
            wanted = one.body.yaw_inertia / one.body.mass * {"a": k, "b": k1, "c": zero}[part]
            m = getattr(moment, part)
            np.testing.assert_allclose(m, np.column_stack([zero, zero, wanted]), atol=1e-9)
            load = getattr(loads, part)
            np.testing.assert_allclose(load.sum(axis=1), f[:, 2], atol=1e-9)
            for axis in (0, 1):
                lever = np.sum(load * arms[..., axis], axis=1)
                np.testing.assert_allclose(lever, -h * f[:, axis], atol=1e-9)
            for i in range(0, len(s), 5):  # equal stiffness everywhere: one plane of loads
                basis = np.column_stack([np.ones(len(arms[i])), arms[i]])
                fit = basis @ np.linalg.lstsq(basis, load[i])[0]
                np.testing.assert_allclose(load[i], fit, atol=1e-9)


@pytest.mark.parametrize("name", ["loc8", "omni-3", "asoc-4", "swerve"])
def test_a_heading_of_its_own_on_a_plane_in_closed_form(name):
    """Any heading, any direction of travel: gravity has all three components in the body."""
    one, rng = robot(name), np.random.default_rng(5)
    for _ in range(6):
        a, heading = rng.uniform(-np.pi, np.pi, 2)
        plane = Plane(rng.uniform(0, np.radians(30)), rng.uniform(-np.pi, np.pi))
        path = Path.through(
            [[0, 0], [3 * np.cos(a), 3 * np.sin(a)]], heading=[heading] * 2, turning_length=0.5
        )
        samples = along_of(one, plane, path, np.array([1.0, 2.0]))
        n = np.array([-plane.gradient[0], -plane.gradient[1], 1.0])
        n /= np.linalg.norm(n)
        ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
        ahead[2] = ahead[:2] @ plane.gradient
        ahead /= np.linalg.norm(ahead)
        left = np.cross(n, ahead)
        travel = np.array([np.cos(a), np.sin(a), 0.0])
        travel[2] = travel[:2] @ plane.gradient
        travel /= np.linalg.norm(travel)
        force = specific_force(samples, one.body)
        axes = np.array([ahead, left, n])
        np.testing.assert_allclose(force.a, np.tile(axes @ travel, (2, 1)), atol=1e-9)
        np.testing.assert_allclose(force.b, 0.0, atol=1e-9)
        np.testing.assert_allclose(force.c, np.tile(G * axes[:, 2], (2, 1)), atol=1e-9)


def test_over_a_crest_the_load_falls_and_pitching_takes_a_moment():
    """On a cylinder z = -c x^2 / 2, at its top: f_z = g - c s'^2 lifted by the height of the centre
    of gravity, pitch acceleration c s''."""
    c, one = 0.2, robot("powerbot")
    x = np.arange(-40, 41) * 0.1
    crest = HeightMap(np.tile(-c * x**2 / 2, (81, 1)), 0.1, (-4.0, -4.0))
    wheels = np.array([w.position[0] for w in one.description.wheels])
    path = Path.through([[-2, 0], [0, 0], [2, 0]])
    on = track(path, None, crest)  # tangent plane
    u = np.array([1e-9 + path.basis.knots[1]])
    samples = on.samples(on.path.parameter(u), u)
    force, moment = specific_force(samples, one.body), ground_moment(samples, one.body)
    px, _, h = one.body.cog
    np.testing.assert_allclose(samples.turning[0], [0, c, 0], atol=1e-8)
    np.testing.assert_allclose(force.a[0], [1 + c * h, 0, -c * px], atol=1e-8)
    np.testing.assert_allclose(force.b[0], [-(c**2) * px, 0, -c - c**2 * h], atol=1e-7)
    inertia = one.body.pitch_inertia / one.body.mass
    np.testing.assert_allclose(moment.a[0], [0, inertia * c, 0], atol=1e-8)
    loads = contact_loads(samples, one)
    # nose down means the front carries more by the moment over the wheelbase
    lever = loads.a[0] @ (wheels - 0.04 * (wheels < 0) - px)
    assert lever == pytest.approx(-h * (1 + c * h) - inertia * c, abs=1e-8)


def test_inertias_of_roll_and_pitch_follow_from_masses():
    body = robot("loc8", {"body.cog": [0.0, 0.0, 0.1], "body.clearance": 0.05}).body
    d = robot("loc8").description
    rest = d.body.mass - 4 * d.wheels[0].mass
    length, width, height = d.body.chassis
    lift = rest * (0.05 + height / 2 - 0.1) ** 2
    wheels = 4 * d.wheels[0].mass
    (x, y), r = d.wheels[0].position, d.wheels[0].radius
    roll = rest * (width**2 + height**2) / 12 + lift + wheels * (y**2 + (r - 0.1) ** 2)
    pitch = rest * (length**2 + height**2) / 12 + lift + wheels * (x**2 + (r - 0.1) ** 2)
    assert body.roll_inertia == pytest.approx(roll)
    assert body.pitch_inertia == pytest.approx(pitch)


# -- printed check values --------------------------------------------------------------------------


def test_along_the_contour_of_8_5_degrees():
    samples = rest_on(robot("powerbot"), np.radians(8.5), 0.0)
    rows = Slip(0.332, sides=720).rows(samples, robot("powerbot"))
    up, down = rows.a[0] > 1e-9, rows.a[0] < -1e-9
    assert np.min(rows.c[0, up] / rows.a[0, up]) == pytest.approx(1.05, abs=0.005)
    assert np.max(rows.c[0, down] / rows.a[0, down]) == pytest.approx(-1.91, abs=0.005)


def test_a_circle_of_two_metres_on_8_5_degrees():
    """At its lowest point the circle leans outward downhill: 1.06 m/s, at its highest 1.9 m/s."""
    slope, angle = np.radians(8.5), np.linspace(0, 2 * np.pi, 181)
    plan = 2 * np.column_stack([np.sin(angle), -np.cos(angle) * np.cos(slope)])
    path = Path.through(plan, start_direction=(1, 0), end_direction=(1, 0))
    one = robot("powerbot")
    on = track(path, one, Plane(slope, UP))
    assert on.path.length == pytest.approx(4 * np.pi, rel=1e-5)
    for share, expected in ((1.0, 1.06), (0.5, 1.82)):
        s = np.array([share * on.path.length])
        samples = on.samples(s, on.path.locate(s) - (1e-6 if share == 1 else 0))
        slip = Slip(0.332, sides=720)
        speeds = np.linspace(0.5, 2.5, 2001)
        kept = [slip.needed(samples, one, np.zeros(1), np.array([v**2]))[0] <= 1 for v in speeds]
        assert speeds[int(np.argmin(kept))] == pytest.approx(expected, abs=0.01)


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
    """Across, the drive wheels alone hold PowerBot up to 11.6 deg; four wheels that hold, 18.4."""
    drive, four = robot("powerbot"), robot("swerve")
    for one, tangent in ((drive, 0.332 * 0.218 / 0.35), (four, 0.332)):
        slope, still = np.arctan(tangent), np.zeros(1)
        samples = rest_on(one, slope, 0.0)
        assert Slip(0.332).needed(samples, one, still, still)[0] == pytest.approx(1.0, rel=1e-9)
    assert np.degrees(np.arctan(0.332 * 0.218 / 0.35)) == pytest.approx(11.6, abs=0.1)
    for degrees, times in ((15, 1.30), (30, 2.8)):
        samples = rest_on(drive, np.radians(degrees), 0.0)
        needed = Slip(0.33).needed(samples, drive, still, still)[0]
        assert needed == pytest.approx(times, abs=0.02)
        with pytest.raises(InfeasibleError, match="slip"):
            time_scale(
                Path.through([[0, 0], [5, 0]]),
                [Speed(1.0), Acceleration(0.5, 0.5), Slip(0.33), Tip()],
                robot=drive,
                ground=Plane(np.radians(degrees), UP),
            )


def test_slopes_that_were_accepted_are_refused():
    line = Path.through([[0, 0], [3, 0]])
    drive = [Speed(1.0), Acceleration(0.3, 0.3)]
    high = robot("powerbot", {"body.cog": [-0.132, 0.0, 0.7]})
    with pytest.raises(InfeasibleError, match="tip"):
        time_scale(line, [*drive, Tip()], robot=high, ground=Plane(np.radians(25), UP))
    steep = plane_map(Plane(np.radians(30), 0.0))
    with pytest.raises(InfeasibleError, match="slip"):
        time_scale(line, [*drive, Slip(0.332)], robot=robot("powerbot"), ground=steep)
    loc8 = robot("loc8")
    slide = Path.through([[0, 0], [3, 0]], heading=[0, 0], turning_length=0.5)
    with pytest.raises(InfeasibleError, match="slip"):
        ground = plane_map(Plane(np.radians(20), 0.3))
        time_scale(slide, [*drive, Slip(0.2)], robot=loc8, ground=ground)


def test_a_plane_path_over_a_ramp_is_the_path_laid_over_it():
    ramp = Ramp((2.0, 0.0), 0.0, 4.0, 0.5, 0.35)
    limits = [Speed(2.0), Acceleration(1.0, 1.0), Slip(0.332), Tip()]
    one, path = robot("powerbot"), Path.through([[0, 0], [8, 0]])
    flat, over = (
        time_scale(path, limits, robot=one, ground=ground) for ground in (None, Ramps((ramp,), 0.3))
    )
    assert over.duration > flat.duration + 0.05
    climb = Path.through(over.path.position(np.linspace(over.path.start, over.path.end, 400)))
    by_hand = time_scale(climb, limits, robot=one)
    assert by_hand.duration == pytest.approx(over.duration, rel=2e-3)


# -- invariances -----------------------------------------------------------------------------------

LIMITS = [Speed(1.2), WheelSpeed(14.0), WheelAcceleration(20.0), Slip(0.7), Tip()]


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array(points) @ np.array([[c, s], [-s, c]])


@pytest.mark.parametrize("name", ["powerbot", "loc8", "asoc-4", "swerve", "car"])
def test_times_do_not_change_when_the_scene_turns_or_is_mirrored(name):
    one = robot(name)
    free = one.drivable.shape[1] == 3
    points = np.array(CURVE if free else GENTLE)
    heading = np.array([0.2, 1.0, 0.1, -0.7]) if free else None

    def duration(angle: float, side: float, ramp: bool) -> float:
        moved = turned(points * [1, side], angle)
        yaw = None if heading is None else side * heading + angle
        path = Path.through(moved, heading=yaw, turning_length=0.5)
        place = tuple(turned(np.array([0.6, 0.0]), angle))
        ground = Plane(0.15, side * 0.7 + angle)
        if ramp:
            smooth = Ramp(place, side * 0.3 + angle, 1.5, 0.25, 0.6, "smooth")
            ground = Ramps((smooth,), 1.0)
        return time_scale(path, LIMITS, robot=one, ground=ground, gridpoints=100).duration

    for ramp in (False, True):
        first = duration(0.0, 1.0, ramp)
        assert duration(1.1, 1.0, ramp) == pytest.approx(first, rel=1e-9)
        if name != "asoc-4" or not ramp:
            assert duration(0.0, -1.0, ramp) == pytest.approx(first, rel=1e-9)


@pytest.mark.parametrize("name", ["powerbot", "loc8", "asoc-4"])
def test_a_plane_height_map_is_the_plane(name):
    one = robot(name)
    heading = [0.2, 1.0, 0.1, -0.7] if one.holonomic else None
    path = Path.through(CURVE, heading=heading, turning_length=0.5)
    plane = Plane(0.15, 0.7)
    times = [
        time_scale(path, LIMITS, robot=one, ground=ground, gridpoints=100).duration
        for ground in (plane, plane_map(plane))
    ]
    assert times[0] == pytest.approx(times[1], rel=1e-6)


def test_on_a_plane_mass_does_not_matter():
    one = robot("loc8")
    heavy = one.replace(
        {"body.mass": 60.0, "body.yaw_inertia": one.yaw_inertia * 60 / one.body.mass}
    )
    path = Path.through(CURVE, heading=[0.2, 1.0, 0.1, -0.7], turning_length=0.5)
    times = [
        time_scale(path, LIMITS, robot=r, ground=Plane(0.15, 0.7), gridpoints=100).duration
        for r in (one, heavy)
    ]
    assert times[0] == pytest.approx(times[1], rel=1e-12)


# -- contacts, friction ----------------------------------------------------------------------------


def test_edges_of_moving_contacts_are_those_of_each_place():
    rng = np.random.default_rng(2)
    for _ in range(20):
        places = rng.normal(size=(6, 5, 2))
        normals, distances = moving_edges(places)
        assert normals.shape == (6, 5, 2)
        for i in range(6):
            expected = sorted(zip(*support_edges(places[i])[::-1], strict=True), key=lambda e: e[0])
            found = [
                (d, n) for d, n in zip(distances[i], normals[i], strict=True) if np.hypot(*n) > 0.5
            ]
            assert len(found) == len(expected)
            for (d, n), (d1, n1) in zip(sorted(found, key=lambda e: e[0]), expected, strict=True):
                assert d == pytest.approx(d1, abs=1e-12)
                np.testing.assert_allclose(n, n1, atol=1e-12)


def test_a_wheel_lifts_before_the_robot_tips():
    """Four springs under a load over one corner: at rest on a slope along a diagonal the uphill
    wheel lifts at half the distance to the corner."""
    one = robot("loc8", {"body.cog": [0.0, 0.0, 0.3]})
    (x, y) = one.body.contacts[0]
    line = Path.through([[0, 0], [3, 0]], heading=[0, 0], turning_length=0.5)

    def slack(limit: Tip | Contact, slope: float, direction: float) -> float:
        samples = along_of(one, Plane(slope, direction), line, np.array([1.0]))
        return float(limit.rows(samples, one).c.min())

    direction = 0.8

    def uphill_load(slope: float) -> float:
        """Of the front left wheel, per quarter of the weight: f_z - h (f_x / x + f_y / y)."""
        n = np.array([-np.cos(direction), -np.sin(direction), 1 / np.tan(slope)])
        ahead = np.array([1.0, 0.0, np.tan(slope) * np.cos(direction)])
        up = ahead[2] / np.linalg.norm(ahead), 0.0, n[2] / np.linalg.norm(n)
        left = np.cross(n / np.linalg.norm(n), ahead / np.linalg.norm(ahead))[2]
        return float(up[2] - 0.3 * (up[0] / x + left / y))

    lifts = float(brentq(uphill_load, 0.1, 1.2))
    assert slack(Contact(), lifts - 1e-6, direction) > 0 > slack(Contact(), lifts + 1e-6, direction)
    assert slack(Tip(), lifts + 1e-6, direction) > 0
    third = float(brentq(lambda a: uphill_load(a) - 0.3, 0.01, lifts))
    assert abs(slack(Contact(0.3), third, direction)) < 1e-9
    for share in (-0.1, 1.0):
        with pytest.raises(ArgumentError, match="share"):
            Contact(share)


def test_friction_one_a_wheel_along_the_path_and_over_a_map():
    one = robot("loc8")
    line = Path.through([[0, 0], [3, 0]], heading=[0, 0], turning_length=0.5)
    plane, s = Plane(0.1, 0.4), np.array([0.5, 1.5, 2.5])
    samples = along_of(one, plane, line, s)
    zero = np.zeros(3)
    even = Slip(0.5).needed(samples, one, zero, zero)
    np.testing.assert_allclose(Slip((0.5,) * 4).needed(samples, one, zero, zero), even)
    alone = [Slip(tuple(mu)).needed(samples, one, zero, zero) for mu in 100 * np.eye(4) + 0.5]
    assert max(np.abs(even - m).max() for m in alone) > 0.01
    assert all(np.all(m <= even + 1e-12) for m in alone)
    along = Slip(FrictionAlong((1.0, 2.0), (0.25, 0.5)))
    np.testing.assert_allclose(
        along.needed(samples, one, zero, zero), even * 0.5 / np.array([0.25, 0.375, 0.5])
    )
    assert along.rows(samples, one).edges == (1.0, 2.0)
    # a map with friction falling along x: the least under the front wheels
    x = np.linspace(-1, 4, 51)
    grid = FrictionMap(np.tile(0.6 - 0.1 * x, (31, 1)), 0.1, (-1.0, -1.5))
    loads = contact_loads(samples, one).c
    turn = samples.rotation[:, :2, :2]
    places = (
        samples.position[:, None, 0] + (np.array(one.body.contacts) @ turn.swapaxes(1, 2))[..., 0]
    )
    mu = 0.6 - 0.1 * places
    needed = Slip(grid).needed(samples, one, zero, zero)
    single = [Slip(1.0).needed(samples, one, zero, zero)[i] for i in range(3)]
    assert np.all(needed * mu.max(axis=1) >= np.array(single) - 1e-9)
    assert np.all(needed * mu.min(axis=1) <= np.array(single) + 1e-9)
    assert loads.min() > 0
    with pytest.raises(InfeasibleError, match="leaves the friction map"):
        Slip(FrictionMap(np.full((3, 3), 0.5), 0.1, (0.0, 0.0))).rows(samples, one)
    for wrong in ((0.5, 0.5), -1.0, (0.5, 0.0, 0.5, 0.5)):
        with pytest.raises(ArgumentError, match="friction"):
            Slip(wrong).rows(samples, one)
    for build in (
        lambda: FrictionAlong((1.0, 1.0), (0.5, 0.5)),
        lambda: FrictionAlong((1.0,), (0.5, 0.5)),
        lambda: FrictionMap(np.ones((1, 3)), 0.1, (0.0, 0.0)),
        lambda: FrictionMap(np.zeros((3, 3)), 0.1, (0.0, 0.0)),
    ):
        with pytest.raises(ArgumentError, match="friction"):
            build()


def test_a_slippery_patch_slows_the_robot_where_it_lies():
    one, path = robot("powerbot"), Path.through(CURVE)
    patch = FrictionAlong((1.0, 1.3, 1.7, 2.0), (0.8, 0.15, 0.15, 0.8))
    limits = [Speed(1.5), Acceleration(1.0, 1.0)]
    good = time_scale(path, [*limits, Slip(0.8)], robot=one)
    slow = time_scale(path, [*limits, Slip(patch)], robot=one)
    assert slow.duration > good.duration * 1.02
    assert min(slow.margins().values()) >= -1e-9
    assert any(stretch.limit == "slip" for stretch in slow.active)
