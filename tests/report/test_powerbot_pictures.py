"""Pictures of time scaling and replanning, and the exponent beside them."""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np
import pytest
from matplotlib.image import imread

from benchmarks.peers.timing_picture import draw_growth, growth_exponent
from benchmarks.theses.powerbot_figures import draw_path, draw_profiles, draw_safe_speed
from trajopt.control.encounter import Obstacle, course
from trajopt.control.encounter_run import run_encounter
from trajopt.control.replan import Sensor
from trajopt.errors import ArgumentError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.speed import Speed
from trajopt.paths.path import Path
from trajopt.robots.robot import robot as shipped
from trajopt.systems.powerbot.pictures import draw_replan
from trajopt.timing.scaling import time_scale

POINTS = (100, 1000, 10_000)


def shows_something(file: FilePath) -> bool:
    pixels = np.asarray(imread(file))[..., :3]
    return min(pixels.shape[:2]) > 300 and float(pixels.std()) > 0.04


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_exponent_of_a_power(power: float) -> None:
    assert growth_exponent(POINTS, [3e-6 * n**power for n in POINTS]) == pytest.approx(power)


@pytest.mark.parametrize(("points", "seconds"), [((1,), (1,)), ((1, 2), (1,)), ((1, 2), (0, 1))])
def test_exponent_needs_pairs_of_positive_numbers(
    points: tuple[float, ...], seconds: tuple[float, ...]
) -> None:
    with pytest.raises(ArgumentError):
        growth_exponent(points, seconds)


def test_pictures_show_something(tmp_path: FilePath) -> None:
    robot = shipped("powerbot")
    path = Path.through([[0, 0], [2, 0.3], [4, 0]], start_direction=[1, 0], end_direction=[1, 0])
    plan = time_scale(path, [Speed(0.8), Acceleration(0.5, 1.0)], robot=robot)
    where, sensor = course(plan, robot), Sensor(2.0, 0.1, 0.1)
    free = run_encounter(where, sensor, lambda *_: [], longest=20.0)
    block = Obstacle((2.0, 0.3), 0.2)
    run = run_encounter(where, sensor, lambda t, _: [block] if t < 5 else [], longest=20.0)
    files = [
        draw_growth(
            {"ours": (POINTS, [1e-3, 1e-2, 1e-1]), "theirs": (POINTS[:2], [1e-2, 1e-1])},
            tmp_path / "growth.png",
        ),
        draw_path(plan, tmp_path / "path.png", knots=[[0, 0], [2, 0.3], [4, 0]]),
        draw_profiles(
            [
                ("slow", time_scale(path, [Speed(0.4)], robot=robot, engine="linear")),
                ("fast", plan),
            ],
            tmp_path / "profiles.png",
        ),
        draw_safe_speed(tmp_path / "safe.png", braking=1.5, robot_speed=2.1),
        draw_replan(run, where, tmp_path / "replan.png", free=free),
    ]
    assert all(shows_something(file) for file in files)
