"""The commands ``trajopt sweep ...`` on a finished store."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from tests.study.crashes import cases
from tests.study.run_functions import mixed
from trajopt.cli.sweep import app
from trajopt.study.store import Store
from trajopt.study.sweeps import sweep


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
    read = {"csv": pd.read_csv, "parquet": pd.read_parquet, "jsonl": lambda f: pd.read_json(f, lines=True)}
    assert len(read[file.suffix[1:]](file)) == 100
