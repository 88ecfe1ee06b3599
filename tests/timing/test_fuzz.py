"""Whatever comes in, time scaling gives a motion that holds or an error that names limit and
place."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scaling_cases import ROBOTS, limit

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.limit import Limit
from trajopt.paths.path import Path
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory

ODD = (0.0, -1.0, np.nan, np.inf, 1e-9, 1e9)


def random_points(rng: np.random.Generator) -> np.ndarray:
    """Anything from a fair path to one that doubles back, climbs a wall or stands still."""
    n = int(rng.integers(2, 6))
    points = rng.normal(0, rng.choice([0.01, 1.0, 100.0]), (n, int(rng.choice([2, 3]))))
    if rng.random() < 0.5:
        points[:, 0] = np.sort(points[:, 0])
    if points.shape[1] == 3:
        points[:, 2] *= rng.choice([0.0, 0.05, 0.3, 3.0])
    if rng.random() < 0.1:  # on one line: it doubles back, or not
        points = rng.normal(0, 1, (n, 1)) * points[:1]
    if rng.random() < 0.05:
        points[:] = points[0]  # of length zero
    if rng.random() < 0.1:
        points[-1] = points[-2]
    if rng.random() < 0.1:
        points[-1] = points[0]
    if rng.random() < 0.05:
        points[0, 0] = rng.choice([np.nan, np.inf])
    return points


def random_set(rng: np.random.Generator) -> list[Limit]:
    size = 10.0 ** rng.uniform(-3, 2, 8)
    choices = [
        lambda: limit("speed", largest=size[0]),
        lambda: limit("yaw_rate", largest=size[1]),
        lambda: limit("acceleration", forward=size[2], braking=size[3]),
        lambda: limit("wheel_speed", largest=10 * size[4]),
        lambda: limit("wheel_acceleration", largest=10 * size[5]),
        lambda: limit(
            "slip",
            friction=min(size[6], 3.0),
            rule="capacity" if rng.random() < 0.3 else "least_norm",
        ),
        lambda: limit("tip"),
        lambda: limit("speed_zones", zones=((0.1, 0.4, size[7]),)),
        lambda: limit(
            "speed_profile", places=(0.0, 0.5, 1.0), speeds=tuple(rng.choice([0, 0.5, 2], 3))
        ),
    ]
    return [choices[k]() for k in rng.choice(len(choices), int(rng.integers(1, 6)), replace=False)]


def attempt(rng: np.random.Generator, extra: dict) -> Trajectory | ArgumentError | InfeasibleError:
    """One random path with random limits; any other error is a failure of the test."""
    try:
        points = random_points(rng)
        free = points.shape[1] == 2 and rng.random() < 0.4
        path = Path.through(
            points, heading=rng.normal(0, 1, len(points)) if free else None, turning_length=0.49
        )
        if rng.random() < 0.2:
            extra["stops"] = [rng.uniform(0, 1.2) * path.length]
        return time_scale(
            path, random_set(rng), robot=ROBOTS["loc8" if free else "rear_cog"], **extra
        )
    except (ArgumentError, InfeasibleError) as error:
        return error


@settings(max_examples=150, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_motion_that_holds_or_an_error_with_limit_and_place(seed):
    rng = np.random.default_rng(seed)
    extra: dict[str, object] = {
        "gridpoints": 40,
        "engine": rng.choice(["auto", "compiled", "linear", "segments"]),
    }
    if rng.random() < 0.4:
        extra["start_speed"] = float(rng.choice([0.3, 3.0, *ODD]))
    if rng.random() < 0.3:
        extra["too_fast"] = "brake"
    if rng.random() < 0.4:
        extra["end_speed"] = float(rng.choice([0.3, 3.0, *ODD]))
    outcome = attempt(rng, extra)
    if isinstance(outcome, ArgumentError):
        assert outcome.argument
        return
    if isinstance(outcome, InfeasibleError):
        assert outcome.limit
        assert outcome.reason
        assert outcome.place >= -1e-9
        return
    result = outcome
    assert np.isfinite(result.duration)
    assert result.duration > 0
    assert min(result.margins().values()) >= -1e-9
    d = result.path.position(np.linspace(result.path.start, result.path.end, 2001), 1)
    d = d[:, :2] / np.hypot(d[:, 0], d[:, 1])[:, None]
    if (
        result.path.heading is None
    ):  # nowhere does the direction of travel turn round between neighbours
        assert np.sum(d[1:] * d[:-1], axis=1).min() > -0.9999
    state = result.at(np.linspace(0, result.duration, 7))
    for values in (state.pose, state.twist, state.wheel_angles, state.wheel_speeds):
        assert np.all(np.isfinite(values))
    if result.engine != "linear":
        asked = [extra.get("start_speed", 0.0), extra.get("end_speed", 0.0)]
        np.testing.assert_allclose(
            result.sd[[0, -1]] * result.slowdown, asked, rtol=1e-6, atol=1e-9
        )
