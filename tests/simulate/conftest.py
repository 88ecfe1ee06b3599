"""The LOC8 on Mecanum wheels, built once."""

from __future__ import annotations

import pytest

from trajopt.simulate.engine import SimRobot
from trajopt.systems.smdw.loc8_model import loc8_mecanum


@pytest.fixture(scope="session")
def mecanum_robot() -> SimRobot:
    return loc8_mecanum()
