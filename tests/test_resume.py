"""``trajopt solve`` stopped and resumed: the best so far is written, with a status that says so."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from trajopt.cli import app
from trajopt.errors import ArgumentError
from trajopt.pipeline import solve
from trajopt.problem import load_problem

ROOT = Path(__file__).parents[1]
PROBLEM = ROOT / "problems" / "smdw" / "table_5_3_1s.toml"
# The command, saying when its search is on the way.
TELLING = """
import signal
signal.signal(2, signal.default_int_handler)  # ignored in what a shell runs behind itself
from trajopt.cli import main
from trajopt.optimize.run import Run
remember = Run.remember
def told(self, *seen):
    remember(self, *seen)
    if self.nfev >= 200 and not hasattr(Run, "said"):
        Run.said = print("searching", flush=True)
Run.remember = told
main()
"""
FREE = 'spline.free=["p1","p2","heading"]'


def begun(out: Path, *options: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [
            *(sys.executable, "-c", TELLING),
            *("solve", str(PROBLEM), "--set", FREE, "--out", str(out), "--no-pictures", *options),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )


def searched(out: Path) -> dict[str, object]:
    told: dict[str, object] = json.loads((out / "summary.json").read_text())["search"]
    return told


@pytest.mark.parametrize(
    ("name", "kind"), [("pso", signal.SIGINT), ("ipopt", signal.SIGTERM), ("auto", signal.SIGINT)]
)
def test_a_stopped_search_is_written(name: str, kind: signal.Signals, tmp_path: Path) -> None:
    out = tmp_path / "run"
    resumed = ["--resume"] if name != "ipopt" else []
    process = begun(out, "--optimizer", name, "--seconds", "200", *resumed)
    assert process.stdout is not None
    assert process.stdout.readline() == "searching\n", process.communicate()
    process.send_signal(kind)
    try:
        said, errors = process.communicate(timeout=100)
    finally:
        process.kill()
    assert process.returncode == 130, errors
    assert f"written to {out}" in said
    assert searched(out)["status"] == "INTERRUPTED"
    assert int(str(searched(out)["evaluations"])) > 0
    assert (out / "trajectory.csv").exists()


def test_a_search_goes_on_where_it_was_saved(tmp_path: Path) -> None:
    out = tmp_path / "run"
    line = ["solve", str(PROBLEM), "--set", FREE, "--out", str(out), "--no-pictures", "--resume"]
    line += ["--optimizer", "pso", "--evaluations", "1000"]
    costs = []
    for _ in range(3):
        assert CliRunner().invoke(app, line).exit_code == 1  # the goal is missed
        costs.append(json.loads((out / "summary.json").read_text())["cost"])
        assert searched(out)["status"] == "EVALUATIONS"
        assert searched(out)["evaluations"] == 1000
    assert costs[0] >= costs[1] >= costs[2]
    assert costs[2] < costs[0]
    refused = CliRunner().invoke(app, [*line[:4], "--resume"])
    assert isinstance(refused.exception, ArgumentError)
    assert "--out" in str(refused.exception)
    other = CliRunner().invoke(app, [*line, "--optimizer", "pso-gbest"])
    assert isinstance(other.exception, ArgumentError)
    assert "optimizer" in str(other.exception)


def test_what_cannot_be_is_told_before_the_search() -> None:
    line = ["solve", str(PROBLEM), "--set", "actuator.duration=0.9", "--optimizer", "pso"]
    told = CliRunner().invoke(app, [*line, "--evaluations", "100"]).stdout
    assert told.index("no motion reaches the goal pose in 0.9 s") < told.index("optimizer")


def test_callbacks_end_a_solve_and_paths_take_none() -> None:
    problem = load_problem(PROBLEM)
    found = solve(problem, optimizer="pso", callback=lambda *_: True)
    assert found.search is not None
    assert found.search.status.name == "CALLBACK"
    given = load_problem(ROOT / "problems" / "powerbot" / "experiment_1.toml")
    with pytest.raises(ArgumentError, match="callback"):
        solve(given, callback=lambda *_: True)
