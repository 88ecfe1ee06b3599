"""The thesis's problems by name, for tests of every room."""

from __future__ import annotations

from pathlib import Path

from trajopt.problem import Problem, load_problem
from trajopt.systems.smdw.thesis import DURATIONS

ROOT = Path(__file__).parent.parent
SMDW = sorted(DURATIONS)


def smdw_problem(name: str) -> Problem:
    """A problem of [guzman2015] by file name, with drives that follow."""
    changes = {"actuator": None, "infeasible": None}
    return load_problem(ROOT / f"problems/smdw/{name}.toml", changes)
