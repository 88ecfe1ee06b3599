"""An optimizer in one file that fits on a page is known everywhere by its name, and the package is
not touched."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from trajopt.errors import ArgumentError
from trajopt.optimize.base import Budget, Status
from trajopt.optimize.search import minimize, optimizer_named, optimizer_names

ROOT = Path(__file__).parents[2]
FILE = ROOT / "tests" / "data" / "plugins" / "evolution.py"
NAME = "evolution-strategy"
LOOPS = (
    "tests/optimize/test_contract.py",
    "tests/report/test_run_folder.py",
    "tests/systems/asoc/test_design.py",
)
SCENARIO = "problems/smdw/scenario_1_lateral.toml"


def run(*arguments: str, plugins: str = str(FILE)) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={**os.environ, "TRAJOPT_PLUGINS": plugins},
    )


def test_the_file_fits_on_a_page() -> None:
    assert len(FILE.read_text(encoding="utf-8").splitlines()) <= 45


def test_it_is_listed_and_made_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    assert NAME not in optimizer_names()
    monkeypatch.setenv("TRAJOPT_PLUGINS", str(FILE))
    assert NAME in optimizer_names()
    assert optimizer_named(NAME).name == NAME
    found = minimize(
        lambda x: float(((x - 0.3) ** 2).sum()),
        [[-1.0, 2.0]] * 3,
        optimizer=NAME,
        budget=Budget(3000),
    )
    assert found.fun < 1e-6
    monkeypatch.setenv("TRAJOPT_PLUGINS", f"{FILE}{os.pathsep}no/such/file.py")
    with pytest.raises(ArgumentError, match=r"no/such/file\.py"):
        optimizer_names()


@pytest.mark.slow
def test_all_tests_that_loop_over_optimizers_run_it_and_it_passes() -> None:
    """13 of the contract at least, one of run folders, one of the design problem; nothing without
    the variable."""
    done = run("-m", "pytest", "-p", "no:cacheprovider", "-rA", "-k", NAME, *LOOPS)
    assert done.returncode == 0, done.stdout[-3000:]
    passed = [
        line for line in done.stdout.splitlines() if line.startswith("PASSED") and NAME in line
    ]
    for file, least in zip(LOOPS, (13, 1, 1), strict=True):
        assert sum(file in line for line in passed) >= least
    without = run(
        "-m", "pytest", "-p", "no:cacheprovider", "--collect-only", "-k", NAME, *LOOPS, plugins=""
    )
    assert f"[{NAME}" not in without.stdout


def test_commands_know_it_by_the_variable_and_by_the_option() -> None:
    command = "from trajopt.cli import main; main()"
    for extra, plugins in (((), str(FILE)), (("--plugin", str(FILE)), "")):
        done = run(
            "-c",
            command,
            "solve",
            SCENARIO,
            "--optimizer",
            NAME,
            "--evaluations",
            "3000",
            *extra,
            plugins=plugins,
        )
        assert done.returncode in (0, 1), (
            done.stderr
        )  # found; whether it holds is the search's luck
        assert "error" not in done.stderr
    unknown = run("-c", command, "solve", SCENARIO, "--optimizer", NAME, plugins="")
    assert unknown.returncode == 2
    assert "one of auto, pso" in unknown.stderr


@pytest.mark.slow
def test_benchmarks_take_it_by_the_variable_and_by_the_option(tmp_path: Path) -> None:
    file = tmp_path / "b.toml"
    command = "from trajopt.cli import main; main()"
    for optimizers, extra, plugins in (
        ("'pso'", ("--plugin", str(FILE)), ""),
        (f"'pso', '{NAME}'", (), str(FILE)),
    ):
        file.write_text(
            f"seeds = 1\nevaluations = 300\nproblems = ['smdw/scenario_1_lateral/p2']\n"
            f"optimizers = [{optimizers}]\n"
        )
        store = str(tmp_path / f"rows{len(extra)}")
        done = run("-c", command, "bench", str(file), "--store", store, *extra, plugins=plugins)
        assert done.returncode == 0, done.stderr
        assert "2 done" in done.stdout
        page = tmp_path / f"page{len(extra)}"
        done = run("-c", command, "bench", "report", store, "--out", str(page), plugins=plugins)
        assert done.returncode == 0, done.stderr
        assert NAME in (page / "index.md").read_text(encoding="utf-8")


class Stuck:
    """Asks for the same candidate for ever."""

    name = "stuck"
    needs = frozenset()
    stochastic = False

    def search(self, run, start, rng):  # noqa: ARG002
        while True:
            run.cost(run.bounds[:, 0])


def test_a_method_that_asks_for_the_same_candidate_for_ever_is_ended():
    found = minimize(lambda x: float(x[0]), [[0, 1]], optimizer=Stuck())
    assert found.nfev == 1
    assert found.status is Status.STALLED
