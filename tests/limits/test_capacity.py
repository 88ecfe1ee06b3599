"""What all wheels hold together, against linear programmes and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from limits.slopes import along_of, rest_on
from limits.space_check import instant_of
from limits.space_statics import capacity_used, statics
from limits.test_rows_in_space import driven

from trajopt.errors import ArgumentError
from trajopt.limits.capacity import _net
from trajopt.limits.gradeability import grade_by_friction
from trajopt.limits.slip import Slip
from trajopt.paths.path import Path
from trajopt.robots.robot import STANDARD_GRAVITY, robot, robot_names
from trajopt.world.plane import Plane

G = STANDARD_GRAVITY
# by rows; more where pivots turn freely
PIVOTS = ("asoc-3", "asoc-4", "castor-drive powerbot")
KINDS = [*robot_names(), "rear-drive car", "two-drive swerve", "castor-drive powerbot"]


@pytest.mark.parametrize("name", KINDS)
def test_wheels_together_hold_what_a_linear_programme_finds(name):
    """At random states on a slope the friction needed agrees, and rows leave out what they say and
    no less."""
    on, rng = driven(name, "plane"), np.random.default_rng(len(name))
    one = on.robot
    assert one is not None
    checked = 0
    for s in rng.uniform(0.4, 2.6, 40):
        sdd, sd2 = rng.uniform(-2.5, 2.5), rng.uniform(0.1, 1.5)
        if np.abs(on.path.knot_parameters - s).min() < 0.01:
            continue
        now = instant_of(on, s, sdd, sd2)
        there = statics(one, now)
        if there.loads.min() < 0.1 * G / len(there.loads):
            continue
        checked += 1
        samples = on.samples(np.array([s]), on.path.locate([s]))
        state = samples, one, np.array([sdd]), np.array([sd2])
        exact = capacity_used(one, now, there, Slip(1.0))
        needed = Slip(1.0, rule="capacity").needed(*state)[0]
        assert exact == pytest.approx(needed, rel=2e-3)
        assert needed <= Slip(1.0, rule="least_norm").needed(*state)[0] * (1 + 1e-9)
        for friction, holds in (
            (0.998 * needed, False),
            (needed / (1 - (0.07 if name in PIVOTS else 0.026)), True),
        ):
            rows = Slip(float(friction), rule="capacity").rows(samples, one)
            over = (rows.a[0] * sdd + rows.b[0] * sd2 - rows.c[0]).max()
            assert (over <= 1e-9) == holds, (friction / needed, over)
        if checked == 6:
            break
    assert checked > 2


@pytest.mark.parametrize("name", ["swerve", "car"])
def test_wheels_that_all_hold_any_way_hold_friction_times_the_weight(name):
    """[closed form] At rest on a slope of atan(friction), whichever way it falls: forces as the
    loads are have no yaw moment. The least-norm shares hold less, as the lighter ones slip first."""
    one, still = robot(name), np.zeros(1)
    slope = np.arctan(0.5)
    for heading in (0.0, 0.7, np.pi / 2):
        samples = rest_on(one, slope, heading)
        needed = Slip(0.5, rule="capacity").needed(samples, one, still, still)[0]
        assert needed == pytest.approx(1.0, abs=1e-3)
        assert Slip(0.5, rule="least_norm").needed(samples, one, still, still)[0] > 1.03
    assert grade_by_friction(one, 0.5) == pytest.approx(slope, abs=1e-3)


def test_mecanum_wheels_hold_ahead_by_their_rollers_axes():
    """[closed form] Rollers at 45 deg hold friction cos 45 times the weight straight ahead, though
    the rear axle carries more of it uphill: two wheels of an axle pull alike, axles need not."""
    one, still = robot("loc8"), np.zeros(1)
    slope = np.arctan(0.6 * np.sqrt(0.5))
    samples = rest_on(one, slope, np.pi / 2)
    assert Slip(0.6, rule="capacity").needed(samples, one, still, still)[0] == pytest.approx(1.0)
    rows = Slip(0.6, rule="capacity").rows(samples, one)
    assert rows.c.min() == pytest.approx(0.0, abs=1e-9)
    assert Slip(0.6, rule="least_norm").needed(samples, one, still, still)[0] > 1.05


def test_a_robot_on_one_axle_slips_earlier_than_its_force_alone_says():
    """[statics] PowerBot across a slope: its weight behind the axle turns it downhill, which the two
    drive wheels hold by a difference of their forces along. Loads 5/8 W in all at rest, each wheel
    |(d, f/2)| with d b = 0.132 f."""
    one, still = robot("powerbot"), np.zeros(1)
    samples = rest_on(one, np.radians(6.0), 0.0)
    by_load, needed = (
        Slip(0.4, rule=rule).needed(samples, one, still, still)[0] for rule in ("load", "capacity")
    )
    assert needed > 1.05 * by_load
    assert Slip(0.4, rule="least_norm").needed(samples, one, still, still)[0] >= needed * (1 - 1e-9)


def test_rules_are_named_and_fit_the_robot():
    with pytest.raises(ArgumentError, match=r"slip\.rule"):
        Slip(0.5, rule="per_wheel")  # type: ignore[arg-type]
    line = Path.through([[0, 0], [1, 0]])
    for name in ("loc8", "asoc-4", "tricycle"):
        one = robot(name)
        with pytest.raises(ArgumentError, match="least_norm or capacity"):
            Slip(0.5, rule="load").rows(along_of(one, Plane(0.0, 0.0), line, np.array([0.5])), one)


@pytest.mark.parametrize("sides", [4, 8, 16, 32, 64])
def test_no_direction_is_further_from_the_net_than_it_says(sides):
    """Rows along the net are tightened by that cosine: a hole in it would let force through."""
    net, cosine = _net(sides)
    np.testing.assert_allclose(np.linalg.norm(net, axis=1), 1.0, atol=1e-12)
    rng = np.random.default_rng(0)
    anywhere = rng.standard_normal((200_000, 3))
    poles = rng.standard_normal((20_000, 3)) * [1.0, 0.1, 0.1]  # where a spiral begins
    for sample in (anywhere, poles):
        sample = sample / np.linalg.norm(sample, axis=1)[:, None]
        nearest = np.abs(sample @ net.T).max(axis=1)
        assert nearest.min() >= cosine
