"""What code made a row: edits of the run function and of what it imports are noticed."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from tests.sweeps.crashes import ROOT, cases
from tests.sweeps.run_functions import cheap
from trajopt.cli.sweep import app
from trajopt.errors import ArgumentError
from trajopt.sweeps.source import code_of
from trajopt.sweeps.sweeps import OldCodeError, sweep


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with a run function that imports a helper, inside a function, relatively."""
    package = tmp_path / "mine"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "helper.py").write_text("FACTOR = 1.0\n")
    (package / "other.py").write_text("UNUSED = 1\n")
    (package / "study.py").write_text(
        "import numpy\ndef run(case):\n    from .helper import FACTOR\n    return FACTOR * case['x']\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    yield package
    for name in [n for n in sys.modules if n.split(".")[0] == "mine"]:
        del sys.modules[name]


def run_of(_: Path) -> Any:
    for name in [n for n in sys.modules if n.split(".")[0] == "mine"]:
        del sys.modules[name]
    importlib.invalidate_caches()
    return importlib.import_module("mine.study").run


def test_source_counts_what_is_imported_and_nothing_else(project: Path) -> None:
    code = code_of(run_of(project))
    assert set(code.parts) == {"mine", "mine.helper", "mine.study"}
    (project / "other.py").write_text("UNUSED = 2\n")
    assert code_of(run_of(project)) == code
    (project / "helper.py").write_text("FACTOR = 100.0\n")
    assert code_of(run_of(project)).changed(code.parts) == ["mine.helper"]
    assert code_of(run_of(project), "v1") == code_of(cheap, "v1") != code_of(cheap, "v2")


def test_what_a_run_function_carries_counts() -> None:
    k = 3
    carried = [partial(cheap, k=3), partial(cheap, k=4), lambda _: k]
    codes = [code_of(run).digest for run in carried]
    k = 4
    codes.append(code_of(carried[-1]).digest)
    assert len(set(codes)) == 4
    assert code_of(partial(cheap, k=3)) == code_of(partial(cheap, k=3))
    with pytest.raises(ArgumentError, match="code"):
        code_of(partial(cheap, k=sys.stdout))


def test_trajopt_counts_as_a_whole_where_it_is_imported(project: Path) -> None:
    study = project / "study.py"
    study.write_text("from trajopt.sweeps.cases import Case\ndef run(case): return 1.0\n")
    assert "trajopt" not in code_of(run_of(project)).parts
    study.write_text("import trajopt\ndef run(case): return 1.0\n")
    assert "trajopt" in code_of(run_of(project)).parts


def test_rows_of_other_code_are_kept_or_run_again(project: Path, tmp_path: Path) -> None:
    store = sweep(cases(20), run_of(project), executor=1, store=tmp_path / "store")
    seeds = dict(zip(store.frame()["case"], store.frame()["case_seed"], strict=True))
    (project / "helper.py").write_text("FACTOR = 100.0\n")
    with pytest.raises(OldCodeError, match=r"20 cases have rows of other code.*mine\.helper"):
        sweep(cases(21), run_of(project), executor=1, store=store)
    assert len(store.frame()) == 20
    sweep(cases(21), run_of(project), executor=1, store=store, old="keep")
    frame = store.frame().set_index("x")
    assert frame["value"][[1, 19, 20]].tolist() == [1.0, 19.0, 2000.0]
    assert frame["case_code"].nunique() == 2
    sweep(cases(21), run_of(project), executor=1, store=store, old="rerun")
    frame = store.frame().set_index("x")
    assert (frame["value"] == 100.0 * frame.index).all()
    assert frame["case_code"].nunique() == 1
    assert all(seeds.get(c, s) == s for c, s in zip(frame["case"], frame["case_seed"], strict=True))
    sweep(cases(21), run_of(project), executor=1, store=store)
    store.compact()
    assert (store.frame()["value"] == 100.0 * store.frame()["x"]).all()


def test_a_failed_rerun_does_not_bring_old_rows_back(project: Path, tmp_path: Path) -> None:
    store = sweep(cases(5), run_of(project), executor=1, store=tmp_path / "store")
    (project / "helper.py").write_text("FACTOR = None\n")
    sweep(cases(5), run_of(project), executor=1, store=store, old="rerun")
    assert store.counts() == {"error": 5}
    store.compact()
    assert store.counts() == {"error": 5}


def test_the_command_asks_or_is_told(project: Path, tmp_path: Path) -> None:
    file, store = tmp_path / "s.toml", str(tmp_path / "store")
    file.write_text('run = "mine.study:run"\n[axes.x]\nvalues = [1, 2]\n')

    def run(*options: str) -> Any:
        run_of(project)
        return CliRunner().invoke(app, ["run", str(file), "--store", store, *options])

    assert run("--workers", "1").exit_code == 0
    (project / "helper.py").write_text("FACTOR = 2.0\n")
    assert isinstance(run().exception, OldCodeError)
    assert "0 to run" in run("--keep-old").output
    assert "2 to run" in run("--rerun", "--workers", "1").output
    assert "0 to run" in run().output
    assert isinstance(run("--rerun", "--keep-old").exception, ArgumentError)


def test_a_script_counts_itself(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    text = (
        "from trajopt.sweeps.sweeps import sweep\ndef run(case): return FACTOR * case['x']\n"
        f"if __name__ == '__main__':\n    sweep([{{'x': 1}}], run, executor=1, store={str(tmp_path / 's')!r})\n"
    )
    for number, code in ((1, 0), (1, 0), (2, 1)):
        script.write_text(f"FACTOR = {number}\n" + text)
        done = subprocess.run(
            [sys.executable, str(script)],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == code, done.stderr
    assert "changed since: __main__" in done.stderr
