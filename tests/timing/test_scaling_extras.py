"""Stops, start speeds, segments, linear factors, sensitivities, momentum."""

from __future__ import annotations

import numpy as np
import pytest
from scaling_cases import PATHS, ROBOTS, limit

from benchmarks.theses.powerbot_study import linear_factor
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path
from trajopt.timing.scaling import rough_duration, time_scale
from trajopt.timing.segments import segment_factors
from trajopt.timing.sensitivity import sensitivities
from trajopt.timing.steps import steps
from trajopt.timing.track import track

DRIVE = [limit("speed", largest=1.0), limit("acceleration", forward=0.5, braking=1.0)]


@pytest.mark.parametrize("engine", ["compiled", "toppra"])
def test_a_stop_on_the_way_costs_braking_and_starting(engine):
    through = time_scale(PATHS["straight"], DRIVE, engine=engine)
    stopped = time_scale(PATHS["straight"], DRIVE, engine=engine, stops=[0.8])
    at = int(np.argmin(np.abs(stopped.s - 0.8)))
    assert stopped.s[at] == pytest.approx(0.8, abs=1e-9)
    assert stopped.sd[at] == pytest.approx(0.0, abs=1e-6)

    # Two rest-to-rest motions; on 0.8 and 1.2 m neither reaches the speed limit but the second.
    def alone(length: float) -> float:
        peak = min(1.0, np.sqrt(2 * length / (1 / 0.5 + 1 / 1.0)))
        ramps = peak**2 / 2 * (1 / 0.5 + 1 / 1.0)
        return peak / 0.5 + peak / 1.0 + (length - ramps) / peak

    assert stopped.duration == pytest.approx(alone(0.8) + alone(1.2), rel=1e-4)
    assert stopped.duration > through.duration + 0.3
    assert min(stopped.margins().values()) >= -1e-9


@pytest.mark.parametrize("stops", [[0.0], [2.0], [5.0], [float("nan")]])
def test_stops_off_the_path_are_refused(stops):
    with pytest.raises(ArgumentError):
        time_scale(PATHS["straight"], DRIVE, stops=stops)


def test_a_rough_duration_is_near_the_exact_one():
    limits = [
        limit("speed", largest=1.5),
        limit("wheel_acceleration", largest=20.0),
        limit("slip", friction=0.4),
    ]
    for shape in ("straight", "slalom", "hairpin"):
        exact = time_scale(PATHS[shape], limits, robot=ROBOTS["rear_cog"]).duration
        rough = rough_duration(PATHS[shape], limits, robot=ROBOTS["rear_cog"], gridpoints=40)
        assert rough == pytest.approx(exact, rel=0.03)
        fine = rough_duration(PATHS[shape], limits, robot=ROBOTS["rear_cog"], gridpoints=800)
        assert fine == pytest.approx(exact, rel=1e-3)
    # A straight line under bounds alone: both grids hold the bang-bang time.
    assert rough_duration(PATHS["straight"], DRIVE) == pytest.approx(
        time_scale(PATHS["straight"], DRIVE).duration
    )


def test_segments_lie_between_linear_and_the_optimum():
    limits = [
        limit("speed", largest=1.0),
        limit("wheel_acceleration", largest=20.0),
        limit("slip", friction=0.4),
    ]
    for shape in ("slalom", "hairpin"):
        path, robot = PATHS[shape], ROBOTS["rear_cog"]
        segments = time_scale(path, limits, robot=robot, engine="segments")
        best = time_scale(path, limits, robot=robot)
        assert segments.engine == "segments"
        assert min(segments.margins().values()) >= -1e-9
        assert segments.duration >= best.duration * (1 - 1e-6)
        factors = segment_factors(steps(track(path, robot), segments.u, limits))
        knots = np.searchsorted(segments.u, path.basis.knots)
        for k, factor in enumerate(factors):
            inside = slice(knots[k] + 1, knots[k + 1])
            assert np.all(
                segments.sd[inside] <= path.rate(segments.u[inside]) / factor * (1 + 1e-9)
            )


def test_segment_factors_follow_a_given_profile():
    """[waheed2006], eq. 2.40: the factor is the largest ratio of actual and specified speed in the
    segment."""
    path = Path.through([[0, 0], [2, 0], [3, 0], [6, 0]], knots=[0.0, 1.0, 2.0, 3.0])
    profile = limit("speed_profile", places=(0.0, 6.0), speeds=(0.5, 2.0))
    u = np.linspace(0, 3, 301)
    factors = segment_factors(steps(track(path), u, [profile]))
    dense = np.linspace(0, 3, 3001)
    ratio = path.rate(dense) / np.interp(path.parameter(dense), [0, 6], [0.5, 2.0])
    expected = [ratio[i * 1000 : (i + 1) * 1000 + 1].max() for i in range(3)]
    np.testing.assert_allclose(factors, expected, rtol=1e-4)


def test_linear_factor_reproduces_the_printed_durations():
    """[waheed2006], eqs. 2.34 to 2.39: T = segments * factor; the largest of the three ratios
    decides."""
    assert (
        linear_factor(2.0, 1.0, 1.0, speed_limit=1.0, acceleration_limit=1.0, braking_limit=1.0)
        == 2.0
    )
    assert (
        linear_factor(0.5, 9.0, 1.0, speed_limit=1.0, acceleration_limit=1.0, braking_limit=1.0)
        == 3.0
    )
    assert (
        linear_factor(0.5, 0.1, 0.1, speed_limit=1.0, acceleration_limit=1.0, braking_limit=1.0)
        == 1.0
    )


def test_linear_touches_a_limit_once():
    result = time_scale(PATHS["slalom"], [limit("speed", largest=0.7)], engine="linear")
    assert result.margins()["speed"] == pytest.approx(0.0, abs=1e-9)
    rate = np.gradient(result.u, result.times)[5:-5]
    np.testing.assert_allclose(rate, rate.mean(), rtol=1e-3)  # the spline parameter runs uniformly


def test_sensitivities_are_differences_of_durations():
    limits = [*DRIVE, limit("slip", friction=0.9)]
    result = time_scale(PATHS["straight"], limits, robot=ROBOTS["rear_cog"])
    saved = sensitivities(result)
    # T = L/V + V/(2 F) + V/(2 B): 1 % of V saves 0.01 (L/V - V/2F - V/2B), of F and B 0.01 (V/2F +
    # V/2B).
    assert saved["speed"] == pytest.approx(0.01 * (2 - 1 - 0.5), rel=0.05)
    assert saved["acceleration"] == pytest.approx(0.01 * 1.5, rel=0.05)
    assert saved["slip"] == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(ArgumentError):
        sensitivities(
            time_scale(PATHS["straight"], limits, robot=ROBOTS["rear_cog"], engine="linear")
        )
    with pytest.raises(ArgumentError):
        sensitivities(result, change=0.0)


def test_momentum_carries_over_a_patch_where_rest_breaks_a_limit():
    """A short ramp too slippery to stand on is passed with a run-up; standing on it is
    infeasible."""
    path = Path.through([[0, 0, 0], [2, 0, 0], [2.5, 0, 0.04], [3, 0, 0.08], [5, 0, 0.08]])
    limits = [limit("speed", largest=3.0), limit("slip", friction=0.12)]
    result = time_scale(path, limits, robot=ROBOTS["rear_cog"], start_speed=0.0)
    assert min(result.margins().values()) >= -1e-9
    steep = float(path.parameter([path.basis.knots[2]])[0])
    assert np.interp(steep, result.s, result.sd) > 0.1
    with pytest.raises(InfeasibleError) as caught:
        time_scale(path, limits, robot=ROBOTS["rear_cog"], stops=[steep])
    assert caught.value.limit == "slip"
