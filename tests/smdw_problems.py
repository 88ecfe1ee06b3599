"""The thesis's problems by name, for tests of every room."""

from __future__ import annotations

from pathlib import Path

from trajopt.problem.search import Problem, load_problem, problem_kind

ROOT = Path(__file__).parent.parent
SMDW = sorted(
    path.stem for path in (ROOT / "problems/smdw").glob("*.toml") if problem_kind(path) == "search"
)


def smdw_problem(name: str) -> Problem:
    """A problem of thesis 000 by file name."""
    return load_problem(ROOT / f"problems/smdw/{name}.toml")
