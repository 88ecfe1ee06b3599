"""Path and timing together against a scan: the best of many two-stage plans."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from trajopt.limits.acceleration import Acceleration
from trajopt.limits.limit import Limit
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.limits.yaw_rate import YawRate
from trajopt.paths.path import Path
from trajopt.refine.path import _linearised, corridor, optimize_path
from trajopt.robots.robot import robot as shipped
from trajopt.timing.scaling import time_scale

CORNER = Path.through(
    [[0, 0], [1.5, 0.5], [2, 2]], start_direction=[1, 0], end_direction=[0, 1]
)  # the one inner knot may be moved sideways


@pytest.mark.parametrize(
    "limits",
    [
        (Speed(2.1), Acceleration(2.0, 2.0), Slip(0.2)),
        (WheelSpeed(8.0), WheelAcceleration(10.0)),
        (Speed(2.0), YawRate(0.8), Acceleration(1.0, 1.0)),
    ],
    ids=["slip", "wheels", "yaw rate"],
)
def test_one_knot_goes_where_a_scan_finds_the_least_time(limits: Sequence[Limit]) -> None:
    """The fastest bend is neither the given one nor the shortest: the program has to weigh the
    lengths against every limit's rows, as they change with the knot."""
    build, robot = corridor(CORNER), shipped("powerbot")
    places = np.linspace(-0.7, 0.7, 29)
    paths = [build(np.array([z])) for z in places]
    times = [time_scale(p, limits, robot=robot).duration for p in paths]
    shortest = int(np.argmin([p.length for p in paths]))
    assert min(times) < 0.99 * min(times[shortest], times[14])
    found = optimize_path(build, [(-0.7, 0.7)], limits, robot=robot)
    assert found.trajectory.duration <= min(times) * (1 + 2e-4)
    assert found.variables[0] == pytest.approx(places[np.argmin(times)], abs=0.05)
    assert min(found.trajectory.margins().values()) >= -1e-9


@pytest.mark.parametrize("part", ["lengths", "a", "b", "c", "cap"])
def test_what_the_program_is_made_of_changes_as_its_derivatives_say(part: str) -> None:
    """A small move of two knots of a path that also climbs changes lengths, rows and caps by
    derivative times move, to second order."""
    hill = Path.through([[0, 0, 0], [1.5, 0.5, 0.1], [3, 0.2, 0.25], [4, -0.5, 0.1]])
    limits = (Slip(0.3), Acceleration(1.0, 1.0), WheelSpeed(8.0), YawRate(0.8))
    u = np.linspace(hill.start + 0.01, hill.end - 0.01, 41)
    here, move = np.array([0.1, -0.2]), np.array([6e-4, -8e-4])

    def at(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        table = _linearised(corridor(hill), lambda _: limits, (shipped("powerbot"), None), z, u)
        value, slope = getattr(table, part)
        return value, slope

    (before, slope), (after, _) = at(here), at(here + move)
    change = np.linalg.norm(after - before)
    assert change > 1e-6
    assert np.linalg.norm(after - before - slope @ move) < 0.02 * change
