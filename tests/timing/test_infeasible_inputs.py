"""Every input that has no motion ends in a message with limit and place, or in the right motion:
one test a kind."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scaling_cases import PATHS, ROBOTS, limit

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path
from trajopt.timing.scaling import time_scale
from trajopt.world.ramp import Ramp, Ramps, lay_over

DRIVE = [limit("speed"), limit("acceleration")]
ENGINES = ("compiled", "toppra", "auto")
SLIPPERY = Path.through(
    [[0, 0, 0], [2, 0, 0], [2.5, 0, 0.04], [3, 0, 0.08], [5, 0, 0.08]]
)  # too steep to stand on


@pytest.mark.parametrize("engine", ENGINES)
def test_speed_bound_below_what_a_slope_needs_to_be_held(engine):
    """With a run-up the slope is passed; a zone that forbids the speed for it makes the slope
    impossible."""
    limits = [limit("speed", largest=3.0), limit("slip", friction=0.12)]
    free = time_scale(SLIPPERY, limits, robot=ROBOTS["rear_cog"], engine=engine)
    needed = float(np.interp(2.4, free.s, free.sd))
    with pytest.raises(InfeasibleError) as caught:
        time_scale(
            SLIPPERY,
            [*limits, limit("speed_zones", zones=((1.5, 2.4, 0.1),))],
            robot=ROBOTS["rear_cog"],
            engine=engine,
        )
    assert needed > 0.1
    assert caught.value.limit in ("slip", "speed_zones")
    assert 1.5 <= caught.value.place <= 3.1


@pytest.mark.parametrize("engine", ENGINES)
def test_friction_too_low_for_the_ramp(engine):
    path = lay_over(Path.through([[0, 0], [8, 0]]), [Ramp((2.0, 0.0), 0.0, 4.0, 0.6, 0.35)])
    with pytest.raises(InfeasibleError, match="standing still") as caught:
        time_scale(
            path,
            [limit("speed"), limit("slip", friction=0.1)],
            robot=ROBOTS["rear_cog"],
            engine=engine,
        )
    assert caught.value.limit == "slip"
    assert 2.0 <= caught.value.place <= 6.2


@pytest.mark.parametrize("engine", ENGINES)
def test_start_speed_too_high_to_brake(engine):
    with pytest.raises(InfeasibleError, match="start speed") as caught:
        time_scale(
            PATHS["straight"],
            [limit("speed", largest=9.0), limit("acceleration", braking=0.5)],
            start_speed=2.0,
            engine=engine,
        )
    assert (caught.value.limit, caught.value.place) == ("acceleration", 0.0)


@pytest.mark.parametrize(
    "points", [[[1.0, 2.0], [1.0, 2.0]], [[0.0, 0.0]] * 4, [[0, 0, 0], [0, 0, 0]]]
)
def test_zero_length(points):
    with pytest.raises((ArgumentError, InfeasibleError), match=r"points|path"):
        time_scale(Path.through(points), DRIVE)


@pytest.mark.parametrize(
    "points",
    [
        [[0, 0], [1, 0], [0, 0]],
        [[0, 0], [2, 0], [1, 0], [3, 0]],
        [[0, 0], [2, 1], [1.37, 0.685], [3, 1.5]],
        [[0, 0], [1.6, 0], [1.5, 0], [3, 0]],
    ],
)
def test_doubling_back(points):
    """The direction of travel turns round on the spot, where no twist is defined; also between
    gridpoints."""
    with pytest.raises(InfeasibleError) as caught:
        time_scale(Path.through(points), DRIVE)
    assert caught.value.limit == "path"
    assert 0 < caught.value.place < 3.5


def test_two_equal_knots():
    with pytest.raises(ArgumentError, match="points"):
        Path.through([[0, 0], [1, 0], [1, 0], [2, 0]])


@pytest.mark.parametrize(
    "where", ["point", "start_speed", "end_speed", "stop", "gridpoint", "limit", "zone"]
)
def test_nan(where):
    nan = float("nan")
    points = [[0, 0], [1, nan], [2, 0]] if where == "point" else [[0, 0], [1, 0.2], [2, 0]]
    extra = {
        "start_speed": {"start_speed": nan},
        "end_speed": {"end_speed": nan},
        "stop": {"stops": [nan]},
        "gridpoint": {"gridpoints": [0.0, nan]},
    }.get(where, {})

    def attempt() -> None:
        zones = [limit("speed_zones", zones=((0.2, nan, 0.5),))] if where == "zone" else []
        speed = limit("speed", largest=nan if where == "limit" else 1.0)
        time_scale(Path.through(points), [speed, limit("acceleration"), *zones], **extra)

    with pytest.raises(ArgumentError):
        attempt()


@pytest.mark.parametrize("engine", ENGINES)
def test_a_stop_inside_the_path(engine):
    """Asked for as a stop it is the right motion; as a speed bound of zero it is refused with its
    place."""
    stopped = time_scale(PATHS["straight"], DRIVE, stops=[0.8], engine=engine)
    at = int(np.argmin(np.abs(stopped.s - 0.8)))
    assert stopped.sd[at] == pytest.approx(0.0, abs=1e-6)
    assert min(stopped.margins().values()) >= -1e-9
    with pytest.raises(InfeasibleError) as caught:
        time_scale(
            PATHS["straight"],
            [*DRIVE, limit("speed_profile", places=(0.0, 0.8, 2.0), speeds=(1, 0, 1))],
            engine=engine,
        )
    assert caught.value.limit == "speed_profile"
    assert caught.value.place == pytest.approx(0.8, abs=0.05)


def test_slope_beyond_the_robots_grade():
    ramp = Ramp((2.0, 0.0), 0.0, 4.0, 0.9, 0.35)
    path = lay_over(Path.through([[0, 0], [8, 0]]), [ramp])
    with pytest.raises(InfeasibleError, match="grade") as caught:
        time_scale(path, DRIVE, ground=Ramps((ramp,), math.radians(8.53)))
    assert 1.8 <= caught.value.place <= 6.3
    time_scale(path, DRIVE, ground=Ramps((ramp,), math.radians(15.0)))
