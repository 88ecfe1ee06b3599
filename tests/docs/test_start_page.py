"""What docs/start.md tells a new user to type works, in an empty folder."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "start.md"


def test_the_page_runs_as_it_stands(tmp_path: Path) -> None:
    text = PAGE.read_text(encoding="utf-8")
    for kind, block in re.findall(r"```(text|toml)\n(.*?)```", text, re.DOTALL):
        name = "waypoints.csv" if kind == "text" else block.split()[1]
        (tmp_path / name).write_text(block, encoding="utf-8")
    commands = [
        line.split("  #")[0]
        for block in re.findall(r"```sh\n(.*?)```", text, re.DOTALL)
        for line in block.splitlines()
    ]
    assert len(commands) > 10
    for command in commands:
        program, *arguments = shlex.split(command)
        assert program == "trajopt"
        done = subprocess.run(
            [sys.executable, "-m", "trajopt", *arguments],
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": str(PAGE.parents[1])},
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == 0, f"{command}: {done.stdout[-2000:]}{done.stderr}"
    for made in ("run/view.html", "commands.csv", "comparison", "speeds.png", "by_walk"):
        assert (tmp_path / made).exists(), made
