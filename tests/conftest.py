"""Fixtures that every room's tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

from trajopt.problem import Problem, load_problem, problem_kind

ROOT = Path(__file__).parent.parent
SMDW = sorted(path.stem for path in (ROOT / "problems/smdw").glob("*.toml") if problem_kind(path) == "search")


def smdw_problem(name: str) -> Problem:
    """A problem of thesis 000 by file name."""
    return load_problem(ROOT / f"problems/smdw/{name}.toml")


@pytest.fixture(params=SMDW)
def problem(request: pytest.FixtureRequest) -> Problem:
    """Each of the eight problems in turn."""
    return smdw_problem(request.param)


@pytest.fixture
def scenario() -> Problem:
    """Scenario 1, forward35: the demo's problem."""
    return smdw_problem("scenario_1_forward35")
