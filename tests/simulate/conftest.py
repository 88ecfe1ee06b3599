"""The LOC8 on Mecanum wheels, built once."""

from __future__ import annotations

import pytest

from trajopt.robots.robot import robot
from trajopt.simulate.engine import SimRobot
from trajopt.systems.smdw.loc8_model import roller_robot


@pytest.fixture(scope="session")
def mecanum_robot() -> SimRobot:
    return roller_robot(robot("loc8"))
