"""Damaged files of every kind: refused in one line or used, never another exception, hang, or NaN."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz.kinds import ROOT, all_kinds
from tests.fuzz.mutants import run


@pytest.mark.filterwarnings("ignore")
def test_mutants_are_refused_or_used(tmp_path: Path) -> None:
    found = run(all_kinds(tmp_path), 500, 1, tmp_path)
    assert not found.faults, str(found)
    assert {outcome for _, outcome in found.counts} >= {"refused", "read", "used", "used, holds"}


@pytest.mark.slow
def test_twenty_thousand_mutants() -> None:
    command = [sys.executable, "-m", "tests.fuzz.mutants", "--count", "20000", "--seed", "2"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
