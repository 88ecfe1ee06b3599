"""No file is longer than can be read in one go, but for those that say why."""

from __future__ import annotations

import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[1]
MOST = 320  # lines
# File -> why it is longer. What is no longer that long is taken out of the list (tested).
LONGER = {
    "tests/problem/test_every_key.py": "one row a key of the schema",
    "tests/problem/test_ground.py": "one case a wrong key of [ground] and [start]",
    "tests/report/test_run_folder.py": "one folder written once, read by every test",
    "tests/robots/test_platforms.py": "one table of textbook robots for all wheel equations",
    "tests/sweeps/test_sweeps.py": "one runner with its helpers, from first row to resume",
    "trajopt/cli/sweep.py": "one command and its subcommands, which share options and messages",
    "trajopt/optimize/swarm.py": "one compiled kernel and its readable twin, side by side",
    "trajopt/robots/robot.py": "a robot, and all that follows from its file alone",
    "trajopt/simulate/pybullet.py": "the one file that calls pybullet to build and step",
    "trajopt/timing/reach.py": "passes, check and times, kernels of one kind of cell",
    "trajopt/timing/fastest.py": "the core, from rows on a grid to a motion and its bound",
    "trajopt/report/run_folder.py": "writing and reading a run folder, kept in step",
}


def lengths() -> dict[str, int]:
    listed = subprocess.run(
        ["git", "ls-files", "*.py"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    files = [name for name in listed.stdout.splitlines() if (ROOT / name).exists()]
    return {name: (ROOT / name).read_text(encoding="utf-8").count("\n") for name in files}


def test_no_file_is_too_long_without_a_reason() -> None:
    found = {name: count for name, count in lengths().items() if count > MOST}
    assert set(found) - set(LONGER) == set(), "split these files, or list them with a reason"
    assert set(LONGER) - set(found) == set(), "no longer that long: take them out of the list"
