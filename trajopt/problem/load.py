"""Reading problem files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any

from trajopt.problem.model import Problem, change_key
from trajopt.schema import changes_of, json_schema, read_tables, validated


def load_problem(file: str | FilePath, overrides: Mapping[str, Any] | None = None) -> Problem:
    """Problem of a TOML file; ``overrides`` maps dotted keys to values, None takes a key out.

    Raises ProblemError, in one line: file, key, value, and what would be right.
    """
    data = read_tables(file)
    for key, value in changes_of(overrides, str(file)):
        change_key(data, key, value, str(file))
    return validated(Problem, data, str(file))


def problem_schema() -> str:
    """JSON schema of problem files, for editors."""
    return json_schema(Problem)
