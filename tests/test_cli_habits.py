"""What users of command lines try first."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import trajopt


def run(*arguments: str) -> str:
    told = subprocess.run(
        [sys.executable, "-m", "trajopt", *arguments],
        capture_output=True,
        text=True,
        check=True,
        # The shell is named, and not that of whatever runs the tests.
        env={**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"},
    )
    return told.stdout


def test_it_says_its_version() -> None:
    assert run("--version") == f"trajopt {trajopt.__version__}\n"


def test_short_help_is_help() -> None:
    assert run("-h") == run("--help")
    assert "Usage: trajopt solve" in run("solve", "-h")


def test_shells_can_complete() -> None:
    assert "TRAJOPT_COMPLETE" in run("--show-completion", "bash")


def test_results_are_told_as_json_alone() -> None:
    found = json.loads(run("explain", "problems/powerbot/experiment_4.toml", "--json"))
    assert found["gap"] <= 1e-3
    assert {part["limit"] for part in found["stretches"]} <= {
        one["limit"] for one in found["limits"]
    }
    solved = json.loads(run("solve", "problems/smdw/table_5_3.toml", "--json"))
    assert solved["holds"]


def test_quiet_commands_print_nothing() -> None:
    assert run("explain", "problems/powerbot/experiment_4.toml", "--quiet") == ""


def test_verbose_commands_say_where_an_error_comes_from() -> None:
    command = [sys.executable, "-m", "trajopt", "explain", "nowhere.toml"]
    for more, expected in ((["-v"], True), ([], False)):
        told = subprocess.run([*command, *more], capture_output=True, text=True).stderr
        assert ("Traceback" in told) == expected
        assert "error: nowhere.toml" in told


@pytest.mark.parametrize(
    "command",
    [
        ("export", "problems/powerbot/experiment_1.toml", "--out"),
        ("robot", "car", "--out"),
        ("schema", "robot", "--out"),
    ],
)
def test_files_are_not_written_over_unless_asked(tmp_path: Path, command: tuple[str, ...]) -> None:
    file = tmp_path / {"robot": "car.toml"}.get(command[0], "file.json")
    file.write_text("mine")
    words = [sys.executable, "-m", "trajopt", *command, str(file)]
    refused = subprocess.run(words, capture_output=True, text=True)
    assert refused.returncode == 2
    assert "--force" in refused.stderr
    assert file.read_text() == "mine"
    subprocess.run([*words, "--force"], check=True, capture_output=True)
    assert file.read_text() != "mine"


def test_examples_are_listed_and_copied(tmp_path: Path) -> None:
    assert "docs/examples/own_limit.py" in run("examples")
    run("examples", "--out", str(tmp_path))
    assert (tmp_path / "problems" / "car" / "hill.toml").is_file()
    told = subprocess.run(
        [sys.executable, "-m", "trajopt", "examples", "--out", str(tmp_path)],
        capture_output=True,
        text=True,
    )
    assert told.returncode == 2
    run("examples", "--out", str(tmp_path), "--force")
