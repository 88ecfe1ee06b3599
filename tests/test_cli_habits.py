"""What users of command lines try first."""

from __future__ import annotations

import os
import subprocess
import sys

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
