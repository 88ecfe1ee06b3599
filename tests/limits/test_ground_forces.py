"""Forces and loads on slopes: closed forms on planes for every robot, and over a crest."""

from __future__ import annotations

import numpy as np
import pytest
from limits.slopes import GENTLE, G, along_of

from trajopt.limits.forces import contact_points, ground_moment, specific_force
from trajopt.limits.grip import contact_forces, holds_of
from trajopt.limits.loads import contact_loads
from trajopt.paths.path import Path
from trajopt.robots.robot import robot, robot_names
from trajopt.timing.track import track
from trajopt.world.height_map import HeightMap
from trajopt.world.plane import Plane


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
                place, borne = arms[i], load[i]
                if name.startswith("asoc"):  # of the axles, whose two wheels level out
                    place = place.reshape(-1, 2, 2).mean(axis=1)
                    borne = borne.reshape(-1, 2).sum(axis=1)
                basis = np.column_stack([np.ones(len(place)), place])
                fit = basis @ np.linalg.lstsq(basis, borne)[0]
                np.testing.assert_allclose(borne, fit, atol=1e-9)


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


def cross(a: np.ndarray, b: np.ndarray) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


@pytest.mark.parametrize("name", robot_names())
def test_forces_of_wheels_are_the_least_that_give_force_and_yaw_moment(name):
    """On a tilted plane, at a random state: their sums are those of the motion, driven castors do
    not turn their pivots, and no other forces that do so are smaller."""
    one, rng = robot(name), np.random.default_rng(len(name))
    on = track(Path.through(GENTLE), one, Plane(0.3, 0.8))
    s = rng.uniform(0.2, 4.0, 6)
    samples = on.samples(s, on.path.locate(s))
    sdd, sd2 = rng.uniform(-1, 1, 6), rng.uniform(0, 1, 6)
    forces = contact_forces(samples, one).at(sdd, sd2)
    push = specific_force(samples, one.body).at(sdd, sd2)
    turn = ground_moment(samples, one.body).at(sdd, sd2)[:, 2]
    assert samples.wheels is not None
    holds, wheels = holds_of(one), one.description.wheels
    for i in range(len(s)):
        at, rows = samples.wheels.contacts[i], []
        for k, extra in zip(holds.wheel, holds.direction, strict=True):
            angle = wheels[k].angle + samples.wheels.steering[i, k] + extra
            way = np.array([np.cos(angle), np.sin(angle)])
            arm, lever = at[k] - one.body.cog[:2], at[k] - np.array(wheels[k].position)
            pivots = [cross(lever, way) * (k in group) for group in holds.free]
            rows.append([*way, cross(arm, way), *pivots])
        matrix = np.array(rows).T
        wanted = [push[i, 0], push[i, 1], turn[i], *[0.0] * len(holds.free)]
        np.testing.assert_allclose(matrix @ forces[i], wanted, atol=1e-9)
        np.testing.assert_allclose(np.linalg.pinv(matrix) @ wanted, forces[i], atol=1e-9)


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
