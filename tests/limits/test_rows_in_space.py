"""Rows of every limit at random states on every kind of ground, against what finite differences of
poses in space need: tests/limits/space_check.py."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from limits.space_check import contact_slips, instant_of, used
from limits.space_statics import forces_and_holds, statics
from world.shapes import HILLS, TILTED, mesh_of

from trajopt.limits.acceleration import Acceleration
from trajopt.limits.contact import Contact
from trajopt.limits.friction import FrictionAlong, FrictionMap
from trajopt.limits.grip import holds_of
from trajopt.limits.limit import Limit, Rows
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.steering_acceleration import SteeringAcceleration
from trajopt.limits.steering_rate import SteeringRate
from trajopt.limits.tip import Tip
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.limits.yaw_rate import YawRate
from trajopt.paths.path import Path
from trajopt.robots.robot import STANDARD_GRAVITY, Robot, robot, robot_names
from trajopt.timing.track import Track, track
from trajopt.world.ramp import Ramp, Ramps

G, SIDES = STANDARD_GRAVITY, 720
SMOOTH = Ramps((Ramp((0.6, 0.0), 0.4, 2.0, 0.3, 0.8, "smooth"),), 1.0)
GROUNDS = {"plane": TILTED, "hills": HILLS, "mesh": mesh_of(HILLS), "ramp": SMOOTH}
POINTS = np.array([[0, 0], [1, 0.3], [2, 0.2], [3, -0.3]])


# motors that drive some of the wheels: free steered ones hold across, one castor of two pushes
DRIVES = {
    "rear-drive car": ("car", ["rear-left", "rear-right"]),
    "castor-drive powerbot": ("powerbot", ["left", "castor-left", "right"]),
    "two-drive swerve": ("swerve", ["front-left", "rear-right"]),
}


def robot_of(name: str) -> Robot:
    if name not in DRIVES:
        return robot(name)
    kind, wheels = DRIVES[name]
    return robot(
        kind, {"motors": [{"name": f"drive {w}", "wheels": [w], "torque": 9.0} for w in wheels]}
    )


@cache
def driven(name: str, ground: str) -> Track:
    """With a centre of gravity off the middle, and of its own heading where the robot can."""
    one = robot_of(name)
    x, y, z = one.body.cog
    one = one.replace({"body.cog": [x + 0.01, y + 0.02, z + 0.05]})
    free = one.drivable.shape[1] == 3
    path = Path.through(
        POINTS if free else POINTS * [1.2, 0.6],
        heading=[0.2, 1.0, 0.1, -0.7] if free else None,
        turning_length=0.5,
    )
    return track(path, one, GROUNDS[ground])


def limits_of(one: Robot, rng: np.random.Generator) -> list[Limit]:
    count, rolling = len(one.description.wheels), len(one.wheels)
    grid = FrictionMap(rng.uniform(0.3, 0.9, (60, 60)), 0.13, (-2.0, -3.5))
    frictions = (
        0.5,
        tuple(rng.uniform(0.3, 0.9, count)),
        FrictionAlong((0.5, 1.0, 2.5), (0.7, 0.2, 0.9)),
        grid,
    )
    found: list[Limit] = [
        Slip(mu, sides=SIDES, rule=rule, name=f"slip {i} {rule}")  # type: ignore[arg-type]
        for i, mu in enumerate(frictions)
        for rule in (("least_norm", "load") if holds_of(one).all_drive else ("least_norm",))
    ]
    found += [
        Speed(1.3),
        YawRate(0.7),
        Acceleration(0.6, 0.8),
        Tip(),
        Contact(),
        Contact(0.4, "share"),
    ]
    each = tuple(rng.uniform(3, 20, rolling))
    found += [WheelSpeed(7.0), WheelSpeed(each, "speed of each")]
    found += [WheelAcceleration(9.0), WheelAcceleration(each, "acceleration of each")]
    if one.name == "swerve":
        found += [SteeringRate(1.1), SteeringAcceleration(2.3)]
    return found


def share_of(rows: Rows, sdd: float, sd2: float) -> float:
    """How much of a limit a state uses, from its rows at one place."""
    if not rows.a.shape[1]:
        return float(np.sqrt(sd2 / rows.sd2_max[0]))
    value = rows.a[0] * sdd + rows.b[0] * sd2
    return float(1 + np.max((value - rows.c[0]) / rows.scale[0]))


@pytest.mark.parametrize("ground", GROUNDS)
@pytest.mark.parametrize("name", [*robot_names(), *DRIVES])
def test_rows_are_what_motions_in_space_need(name, ground):
    on, rng = driven(name, ground), np.random.default_rng(len(name))
    one = on.robot
    assert one is not None
    places = rng.uniform(0.4, 2.6, 20)
    apart = np.abs(places[:, None] - on.path.knot_parameters).min(axis=1)
    for s in places[apart > 0.01][:4]:
        sdd, sd2 = rng.uniform(-2, 2), rng.uniform(0.1, 1.2)
        now = instant_of(on, s, sdd, sd2)
        assert contact_slips(one, now).max() < 1e-6
        samples = on.samples(np.array([s]), on.path.locate([s]))
        there, limits = statics(one, now), limits_of(one, rng)
        expected = used(one, limits, now)
        for limit in limits:
            rows = limit.rows(samples, one)
            if not isinstance(limit, Slip):
                share = share_of(rows, sdd, sd2)
                if isinstance(limit, Contact):
                    share -= limit.share
                assert share == pytest.approx(expected[limit.name], abs=2e-5), limit
                continue
            needed = limit.needed(samples, one, np.array([sdd]), np.array([sd2]))[0]
            parts = forces_and_holds(one, now, there, limit)
            if all(hold > 1e-6 for _, hold in parts):
                assert needed == pytest.approx(expected[limit.name], abs=2e-5), limit
            else:
                assert needed == np.inf
            over = rows.a[0] * sdd + rows.b[0] * sd2 - rows.c[0]
            worst = max(force - hold for force, hold in parts)
            assert over.max() == pytest.approx(worst, abs=2e-4), limit
