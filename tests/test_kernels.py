"""Compiling is told once, counts in no budget, and needs no cache that can be written."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from trajopt import kernels
from trajopt.optimize.base import Budget
from trajopt.optimize.search import minimize

ROOT = Path(__file__).parents[1]
TOLD = "compiling numerical kernels"
SCRIPT = """
import logging, sys
logging.basicConfig(level=logging.INFO, format="%(message)s")
from trajopt.kernels import compiling
from trajopt.paths import find
import numpy as np
find.longer(np.ones(2)), find.longer_indices(np.ones(2, dtype=np.intp))
print(compiling("wall") > 0.0, compiling("cpu") > 0.0)
"""


def run(cache: Path) -> tuple[str, int]:
    """What a process prints that needs two kernels, and how often it says that it compiles."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env={**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(cache)},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip(), done.stderr.count(TOLD)


def test_an_empty_cache_is_told_once_and_kept(tmp_path: Path) -> None:
    pytest.importorskip("numba")
    assert run(tmp_path) == ("True True", 1)
    assert run(tmp_path) == ("False False", 0)


def test_a_cache_that_refuses_ends_no_call(monkeypatch: pytest.MonkeyPatch) -> None:
    caching = pytest.importorskip("numba.core.caching")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(caching.IndexDataCacheFile, "save", full)
    monkeypatch.setattr(caching.IndexDataCacheFile, "load", full)

    def double(x: float) -> float:
        return 2.0 * x

    assert kernels.kernel()(double)(1.5) == 3.0


@pytest.mark.parametrize("clock", ["wall", "cpu"])
def test_compiling_counts_in_no_budget(clock: str, monkeypatch: pytest.MonkeyPatch) -> None:
    spent = {"wall": 0.0, "cpu": 0.0}
    monkeypatch.setattr(kernels, "_spent", spent)
    now = time.perf_counter if clock == "wall" else time.process_time

    def slow_at_first(x: np.ndarray) -> float:
        if spent[clock] == 0.0:
            began = now()
            while now() < began + 0.5:
                pass
            spent[clock] = now() - began
        return float(np.sum(x**2))

    budget = Budget(seconds=0.3, clock=clock)
    found = minimize(slow_at_first, [(-1.0, 1.0)] * 2, optimizer="pso", seed=0, budget=budget)
    assert found.nfev > 40
    assert found.seconds < 0.45
