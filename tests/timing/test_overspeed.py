"""A bound below the current speed: refused with a place, or braked into as fast as the other limits
allow."""

from __future__ import annotations

import numpy as np
import pytest
from scaling_cases import PATHS, ROBOTS, limit, random_limits, random_path

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path
from trajopt.timing.scaling import time_scale

LINE = Path.through([[0, 0], [4, 0]])
BRAKING = 0.8


def limits(zone: tuple[float, float, float]) -> list:
    return [
        limit("speed", largest=2.0),
        limit("acceleration", forward=0.5, braking=BRAKING),
        limit("speed_zones", zones=(zone,)),
    ]


@pytest.mark.parametrize("engine", ["compiled", "toppra"])
@pytest.mark.parametrize("zone", [(0.0, 3.0, 0.4), (0.3, 3.0, 0.4)])
def test_a_zone_that_appears_is_braked_into(engine, zone):
    start = 1.5
    with pytest.raises(InfeasibleError) as caught:
        time_scale(LINE, limits(zone), start_speed=start, engine=engine)
    assert caught.value.place == pytest.approx(0.0)
    motion = time_scale(LINE, limits(zone), start_speed=start, engine=engine, too_fast="brake")
    enters = (start**2 - 0.4**2) / (2 * BRAKING)  # m, from where the zone can be kept
    braking = motion.s < enters - 0.02
    # The closed form; 0.1 % of the braking is kept back, which is 2.1e-3 m^2/s^2 at the end of it.
    expected = start**2 - 2 * BRAKING * motion.s[braking]
    assert motion.sd[braking] ** 2 == pytest.approx(expected, abs=2.5e-3)
    inside = (motion.s > enters + 0.02) & (motion.s < 2.9)
    assert motion.sd[inside] == pytest.approx(0.4, rel=3e-3)
    assert min(motion.margins().values()) >= -1e-9
    assert {part.limit for part in motion.active} >= {"speed_zones"}


def test_speed_itself_above_its_limit():
    motion = time_scale(
        LINE,
        [limit("speed", largest=1.0), limit("acceleration", forward=0.5, braking=0.8)],
        start_speed=1.4,
        too_fast="brake",
    )
    assert motion.sd[0] * motion.slowdown == pytest.approx(1.4, rel=1e-6)
    assert motion.sd[motion.s > 0.7].max() <= 1.0 + 1e-9


def test_nothing_changes_where_braking_is_not_needed():
    plain = time_scale(LINE, limits((1.5, 3.0, 0.4)), start_speed=0.5)
    brake = time_scale(LINE, limits((1.5, 3.0, 0.4)), start_speed=0.5, too_fast="brake")
    assert brake.limits == plain.limits
    np.testing.assert_array_equal(brake.sd, plain.sd)


def test_what_braking_cannot_reach_stays_infeasible():
    short = Path.through([[0, 0], [0.5, 0]])
    with pytest.raises(InfeasibleError, match="acceleration"):  # 1.5 m/s needs 1.4 m to stop
        time_scale(short, limits((0.0, 0.4, 0.4)), start_speed=1.5, too_fast="brake")
    with pytest.raises(InfeasibleError) as caught:  # a bend that slips at this speed
        time_scale(
            PATHS["hairpin"],
            [limit("speed", largest=1.0), limit("slip", friction=0.3)],
            robot=ROBOTS["rear_cog"],
            start_speed=6.0,
            too_fast="brake",
        )
    assert caught.value.limit == "slip"
    with pytest.raises(ArgumentError, match="too_fast"):
        time_scale(LINE, limits((0.0, 1.0, 0.4)), too_fast="hope")


@pytest.mark.parametrize("seed", range(20))
def test_random_zones_in_front_of_random_motions(seed):
    """From a state of a valid motion a zone appears: braking into it exists, holds, and is never
    faster."""
    rng = np.random.default_rng(seed)
    path = random_path(rng, free_heading=False, knots=5)
    used = [*random_limits(rng), limit("acceleration", name="push", forward=1.0, braking=1.0)]
    start = float(np.median(time_scale(path, used, robot=ROBOTS["rear_cog"]).sd))
    try:
        plain = time_scale(path, used, robot=ROBOTS["rear_cog"], start_speed=start)
    except InfeasibleError:
        return  # too fast for the path's own limits, whatever appears
    zone = limit(
        "speed_zones",
        zones=((0.0, rng.uniform(0.2, 0.9) * path.length, rng.uniform(0.1, 0.8) * start),),
    )
    braked = time_scale(
        path, [*used, zone], robot=ROBOTS["rear_cog"], start_speed=start, too_fast="brake"
    )
    assert min(braked.margins().values()) >= -1e-9
    arrival = np.interp(braked.s, plain.s, plain.times)
    assert np.all(braked.times >= arrival - 1e-3 * plain.duration)
    assert braked.duration > plain.duration
    fresh = braked.sd[0] * braked.slowdown
    assert fresh == pytest.approx(start, rel=1e-6)
