"""Fixtures that every room's tests share."""

from __future__ import annotations

import pytest
from smdw_problems import SMDW, smdw_problem

from trajopt.problem import Problem


@pytest.fixture(params=SMDW)
def problem(request: pytest.FixtureRequest) -> Problem:
    """Each of the eight problems in turn."""
    return smdw_problem(request.param)


@pytest.fixture
def scenario() -> Problem:
    """Scenario 1, forward35: the demo's problem."""
    return smdw_problem("scenario_1_forward35")
