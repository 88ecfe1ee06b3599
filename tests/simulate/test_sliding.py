"""Which way wheels slide: that of their centres where they are locked."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from trajopt.simulate.engine import ENGINES, Command
from trajopt.simulate.stepping import drive
from trajopt.world.plane import Plane
from trajopt.world.scene import Scene


@pytest.mark.parametrize("engine", ENGINES)
def test_locked_wheels_slide_as_their_centres_move(engine: str) -> None:
    """Down a slope steeper than friction holds, the robot at an angle to it."""
    robot = trajopt.robot("car")
    command = Command(
        np.array([0.0, 1.0]),
        np.zeros((2, len(robot.wheel_names))),
        start_pose=(0.0, 0.0, 0.7),
    )
    run = drive(robot, Scene(0.2, Plane(0.3, 0.3)), command, engine=engine)
    rates = np.gradient(run.pose, run.times, axis=0)
    yaw = run.pose[:, 2]
    ahead = (np.cos(yaw) * rates[:, 0] + np.sin(yaw) * rates[:, 1])[:, None]
    left = (np.cos(yaw) * rates[:, 1] - np.sin(yaw) * rates[:, 0])[:, None]
    x, y = np.array([wheel.position for wheel in robot.description.wheels])[:, :2].T
    wanted = np.stack([ahead - rates[:, 2:] * y, left + rates[:, 2:] * x], axis=2)
    every = [wheel.name for wheel in robot.description.wheels]
    for name in robot.driven:
        k = every.index(name)
        late = (run.times > 0.4) & (run.loads[:, k] > 1.0)  # it chatters
        found, speed = run.sliding[late, k], run.slip[late, k]
        assert np.median(speed) > 0.2
        np.testing.assert_allclose(np.linalg.norm(found, axis=1), speed, rtol=0.05)
        off = np.linalg.norm(found - wanted[late, k], axis=1)
        assert np.median(off / speed) < 0.12
