"""What README shows runs as it stands."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from test_robots_page import written

from trajopt import load_problem, solve

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_problem_is_solved_and_its_door_acts(tmp_path: Path) -> None:
    written(tmp_path)[0].rename(tmp_path / "my_robot.toml")
    (text,) = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    file = tmp_path / "door.toml"
    file.write_text(text, encoding="utf-8")
    solution = solve(load_problem(file))
    assert solution.holds
    assert solution.clearance is not None
    assert solution.clearance.distance >= 0.05 - 1e-6
    shut = load_problem(file, {"obstacles.door.start": [2.5, -2.0]})
    assert solve(shut).trajectory is None


def test_the_python_example_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    before = Path.cwd()
    os.chdir(ROOT)
    try:
        exec(compile(code, "README.md", "exec"), {})
    finally:
        os.chdir(before)
    assert len(capsys.readouterr().out.splitlines()) == 5


def test_mypy_accepts_the_python_example(tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    file = tmp_path / "example.py"
    file.write_text(code, encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", str(file)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
