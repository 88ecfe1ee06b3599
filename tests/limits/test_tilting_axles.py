"""Axles that tilt: what their wheels bear, and where the robot tips, by statics written out here."""

from __future__ import annotations

import numpy as np
import pytest
from limits.slopes import along_of

from trajopt.errors import ProblemError
from trajopt.limits.contact import Contact
from trajopt.limits.forces import contact_points
from trajopt.limits.limit import Limit
from trajopt.limits.loads import contact_loads, supports
from trajopt.limits.tip import Tip
from trajopt.paths.path import Path
from trajopt.robots.robot import STANDARD_GRAVITY, Robot, robot
from trajopt.world.plane import Plane

HEIGHT, RADIUS, MIDDLE = 0.9, 0.1, 0.4  # of the centre of gravity, of wheels, of the front axle, m


def tall(tilt: str = "passive") -> Robot:
    return robot("asoc-4", {"body.cog": [0.0, 0.0, HEIGHT], "pivots.all.tilt": tilt})


def at_rest(one: Robot, slope: float, falls: float):
    """On a plane that falls along ``falls`` in the body, modules as drawn: straight ahead."""
    line = Path.through([[0, 0], [1, 0]], heading=[0, 0], turning_length=0.5)
    return along_of(one, Plane(slope, falls + np.pi), line, np.array([1e-9]))


def slack(limit: Limit, one: Robot, slope: float, falls: float) -> float:
    return float(limit.rows(at_rest(one, slope, falls), one).c.min())


@pytest.mark.parametrize(("falls", "height"), [(0.0, HEIGHT), (np.pi / 2, HEIGHT - RADIUS)])
def test_it_tips_about_the_middles_of_its_axles(falls, height):
    """[closed form] All modules point ahead, axles 0.1 m behind their pivots: the corner at (0.4, 0)
    carries the robot downhill, and the edge from there to (-0.1, 0.5) across. What acts across does
    so at the height of the axles."""
    slope = np.arctan(MIDDLE / height)
    assert slack(Tip(), tall(), slope - 1e-6, falls) > 0 > slack(Tip(), tall(), slope + 1e-6, falls)
    # on rigid axles wheels hold it: the edge from (0.4, 0.1) to (-0.1, 0.6)
    rigid = np.arctan((0.5 if falls else MIDDLE) / HEIGHT)
    assert abs(slack(Tip(), tall("rigid"), rigid, falls)) < 1e-9


def test_the_two_wheels_of_an_axle_bear_the_same_unless_they_hold_across():
    """[statics] l (N_left - N_right) + r F = 0 about the axle; modules share what acts across
    evenly, since all trail alike."""
    one = tall()
    for slope, falls in ((0.2, 0.0), (0.15, np.pi / 2), (0.15, -np.pi / 2)):
        loads = contact_loads(at_rest(one, slope, falls), one).c[0].reshape(4, 2)  # right, left
        across = -STANDARD_GRAVITY * np.sin(slope) * np.sin(falls) / 4
        np.testing.assert_allclose(0.1 * (loads[:, 1] - loads[:, 0]), -RADIUS * across, atol=1e-9)


@pytest.mark.parametrize("name", ["asoc-3", "asoc-4"])
def test_a_moving_module_is_in_balance(name):
    """[statics] Anywhere on a slope and turning, what holds the body up, with the height at which it
    does, gives force and moments of the motion: loads of modules at their axles' middles, the rest
    of the moment from forces across at the axles' height."""
    one = robot(name)
    bend = Path.through([[0, 0], [1, 0.4], [2, 0.1]], heading=[0, 0.9, -0.4], turning_length=0.5)
    samples = along_of(one, Plane(0.2, 0.7), bend, np.array([0.4, 1.1, 1.7]))
    places, wanted = supports(samples, one)
    loads = contact_loads(samples, one)
    for part in "abc":
        borne = getattr(loads, part).reshape(3, -1, 2).sum(axis=2)
        sums = getattr(wanted, part)
        np.testing.assert_allclose(borne.sum(axis=1), sums[:, 0], atol=1e-9)
        for axis in (0, 1):
            lever = np.sum(borne * places[..., axis], axis=1)
            np.testing.assert_allclose(lever, sums[:, 1 + axis], atol=1e-9)
    points = contact_points(samples, one) - np.array(one.body.cog[:2])
    np.testing.assert_allclose(points.reshape(3, -1, 2, 2).mean(axis=2), places, atol=1e-12)


def test_contact_counts_wheels_not_axles():
    """Across a slope the upper wheel of an axle lifts where r F = l M, with all of M on the lower:
    before the robot tips."""
    one, falls = tall(), np.pi / 2

    def lightest(slope: float) -> float:
        return float(contact_loads(at_rest(one, slope, falls), one).c.min())

    even = STANDARD_GRAVITY / 8
    for slope in (0.05, 0.1, 0.2):
        expected = lightest(slope)
        assert slack(Contact(), one, slope, falls) == pytest.approx(expected, abs=1e-12)
        assert slack(Contact(0.3), one, slope, falls) == pytest.approx(expected - 0.3 * even)


def test_an_axle_tilts_between_its_wheels():
    changes = {f"wheels.module-1-{side}.lateral": 0.1 for side in ("left", "right")}
    with pytest.raises(ProblemError, match="tilt"):
        robot("asoc-4", changes)
