"""What docs/ground.md shows runs, and its pictures are there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from trajopt import load_problem, solve
from trajopt.problem import Problem
from trajopt.schema import known_keys

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "ground.md").read_text(encoding="utf-8")


def test_the_hill_is_the_shipped_problem(tmp_path: Path) -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)
    file = tmp_path / "hill.toml"
    file.write_text(text, encoding="utf-8")
    shipped = load_problem(ROOT / "problems" / "car" / "hill.toml")
    assert load_problem(file) == shipped
    solution = solve(shipped)
    assert solution.holds
    assert solution.trajectory is not None
    assert "contact" in {part.limit for part in solution.trajectory.active}


def test_the_python_example_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    exec(compile(code, "ground.md", "exec"), {})
    told = capsys.readouterr().out
    across, level = (float(found) for found in re.findall(r"([\d.]+) s", told))
    assert across > level


def test_keys_in_the_tables_are_keys_of_the_file() -> None:
    for key in re.findall(r"`\[?\[?(ground\.\w+|limits\.\w+)\]?\]?`", TEXT):
        section, name = key.split(".")
        assert name in known_keys([section], Problem), key


def test_pictures_and_files_are_there() -> None:
    for picture in re.findall(r"\]\((pictures/\S+)\)", TEXT):
        assert (ROOT / "docs" / picture).stat().st_size > 10_000
    for file in re.findall(r"problems/\S+\.toml", TEXT):
        assert (ROOT / file).is_file()
