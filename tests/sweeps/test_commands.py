"""The commands ``trajopt sweep ...`` on a finished store."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from tests.sweeps.crashes import ROOT, cases
from tests.sweeps.run_functions import mixed
from trajopt.cli import app as trajopt
from trajopt.cli.sweep import app
from trajopt.errors import ArgumentError
from trajopt.sweeps.store import Store
from trajopt.sweeps.sweepfile import load_sweep
from trajopt.sweeps.sweeps import sweep


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    return sweep(cases(100), mixed, executor=1, store=tmp_path_factory.mktemp("sweep") / "store")


def told(*arguments: str) -> str:
    result = CliRunner().invoke(app, list(arguments), catch_exceptions=False)
    assert result.exit_code == 0
    return result.output


def test_status_and_compact(store: Store) -> None:
    text = told("status", str(store.path))
    assert "99" in text
    assert "ValueError" in text
    assert "1 after" in told("compact", str(store.path))


def test_show_prints_the_traceback(store: Store) -> None:
    frame = store.frame()
    text = told("show", str(store.path), frame[frame["status"] == "error"]["case"].iloc[0])
    assert "bad number" in text
    assert "run_functions.py" in text


@pytest.mark.parametrize("name", ["rows.csv", "rows.parquet", "rows.jsonl"])
def test_export(store: Store, tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    told("export", str(store.path), str(file))
    read = {
        "csv": pd.read_csv,
        "parquet": pd.read_parquet,
        "jsonl": lambda f: pd.read_json(f, lines=True),
    }
    assert len(read[file.suffix[1:]](file)) == 100


SWEEP = """
problem = "{problem}"
[axes."run.optimizer"]
values = ["lattice"]
[axes."ground.friction"]
values = [0.4, 0.6]
"""


def reported(*arguments: str) -> str:
    result = CliRunner().invoke(trajopt, ["report", *arguments], catch_exceptions=False)
    assert result.exit_code == 0
    return result.output


def test_report_draws_a_case_of_a_problem_as_solve_does(tmp_path: Path) -> None:
    file = tmp_path / "goals.toml"
    file.write_text(SWEEP.format(problem=ROOT / "problems" / "smdw" / "table_5_3.toml"))
    plan = load_sweep(file)
    store = sweep(plan.table, plan.run, executor=1, store=tmp_path / "store")
    row = store.frame().iloc[0]
    out = tmp_path / "report"
    reported(str(file), row["case"][:10], "--store", str(store.path), "--out", str(out))
    assert {
        "case.json",
        "summary.json",
        "path.png",
        "profile.png",
        "convergence.png",
        "control_points.csv",
        "arrays.png",
    } <= {p.name for p in out.iterdir()}
    assert json.loads((out / "summary.json").read_text())["cost"] == pytest.approx(
        row["cost"], rel=1e-12
    )
    assert json.loads((out / "case.json").read_text())["ground.friction"] == row["ground.friction"]
    reported(str(out), "--out", str(tmp_path / "again"))
    assert (tmp_path / "again" / "path.png").stat().st_size > 5_000
    file.write_text(file.read_text().replace("0.4, 0.6", "0.5"))
    with pytest.raises(ArgumentError, match="a case of this sweep file"):
        reported(str(file), row["case"][:10], "--store", str(store.path), "--out", str(out))


def test_report_shows_what_a_function_returned(store: Store, tmp_path: Path) -> None:
    case = store.frame(["square"]).query("status == 'done'")["case"].iloc[0]
    reported(str(store.path), case, "--out", str(tmp_path))
    assert (tmp_path / "arrays.png").stat().st_size > 5_000
    assert np.loadtxt(tmp_path / "track.csv", delimiter=",").shape == (3, 2)
    failed = store.frame().query("status == 'error'")["case"].iloc[0]
    assert "case.json" in reported(str(store.path), failed, "--out", str(tmp_path / "failed"))
    assert (
        "bad number" in json.loads((tmp_path / "failed" / "case.json").read_text())["error_message"]
    )
