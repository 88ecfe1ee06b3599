"""Edges of support, wheels that lift, and friction that is not the same everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from limits.slopes import CURVE, along_of
from scipy.optimize import brentq

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.contact import Contact
from trajopt.limits.friction import FrictionAlong, FrictionMap
from trajopt.limits.loads import contact_loads
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.tip import Tip, moving_edges, support_edges
from trajopt.paths.path import Path
from trajopt.robots.robot import robot
from trajopt.timing.scaling import time_scale
from trajopt.world.plane import Plane


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
