"""Every script in docs/examples runs as it stands, in an empty folder, and tells something."""

from __future__ import annotations

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted((ROOT / "docs" / "examples").glob("*.py"))
PAGE = (ROOT / "docs" / "examples.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_it_runs(
    script: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    text = script.read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    if "executor=" in text:  # its workers import it: a process of its own
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        done = subprocess.run(
            [sys.executable, script], env=environment, capture_output=True, text=True, timeout=200
        )
        assert done.returncode == 0, done.stderr
        told = done.stdout
    else:
        runpy.run_path(str(script), run_name="__main__")
        told = capsys.readouterr().out
    assert told.strip()
    assert "nan" not in told


def test_scripts_are_short_and_on_the_page() -> None:
    assert len(SCRIPTS) >= 12
    for script in SCRIPTS:
        assert len(script.read_text(encoding="utf-8").splitlines()) <= 40, script
    assert set(re.findall(r"examples/(\w+\.py)", PAGE)) == {script.name for script in SCRIPTS}
