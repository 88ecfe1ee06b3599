"""Sweeps on a real Slurm: job arrays, Dask on Slurm, kills. ``. tests/slurm/start.sh`` starts one
on loopback."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from pathlib import Path

import pytest

from tests.sweeps.crashes import cases, digest, torment_slurm
from tests.sweeps.run_functions import paced, paced_mixed
from tests.sweeps.same_table import swept
from trajopt.sweeps.host import CaseLimits
from trajopt.sweeps.slurm import SlurmOptions, submit
from trajopt.sweeps.store import open_store
from trajopt.sweeps.sweeps import tabled

LIMITS = CaseLimits(60.0, 0)


def _slurm_answers() -> bool:
    if shutil.which("sinfo") is None:
        return False
    told = subprocess.run(
        ["sinfo", "--noheader", "--format=%T"], capture_output=True, text=True, check=False
    )
    return told.returncode == 0 and any(
        s in told.stdout for s in ("idle", "mixed", "alloc", "completing")
    )


@pytest.fixture(autouse=True)
def slurm() -> None:
    if not _slurm_answers():
        if os.environ.get("TRAJOPT_REQUIRE_SLURM") == "1":
            pytest.fail("TRAJOPT_REQUIRE_SLURM=1, but no Slurm answers: . tests/slurm/start.sh")
        pytest.skip("no Slurm answers here: . tests/slurm/start.sh starts one on loopback")


@pytest.fixture(scope="module")
def table_of_one_process(tmp_path_factory: pytest.TempPathFactory) -> str:
    return digest(swept("one", 2000, tmp_path_factory.mktemp("one")))


@pytest.mark.slow
def test_an_array_gives_the_same_table(tmp_path: Path, table_of_one_process: str) -> None:
    store = swept("slurm", 2000, tmp_path)
    assert digest(store) == table_of_one_process
    table = tabled(cases(2000), paced_mixed, None)
    again = submit(
        table, paced_mixed, store, limits=LIMITS, options=SlurmOptions(), case_seconds=0.05
    )
    assert (again.job, again.cases) == ("", 0)


@pytest.mark.slow
def test_dask_on_slurm_gives_the_same_table(tmp_path: Path, table_of_one_process: str) -> None:
    pytest.importorskip("dask_jobqueue", reason="dask-jobqueue is not installed")
    assert digest(swept("dask-slurm", 2000, tmp_path)) == table_of_one_process


@pytest.mark.slow
def test_a_requeued_element_goes_on(tmp_path: Path) -> None:
    store = open_store(tmp_path / "array")
    table = tabled(cases(2000), paced, None)
    done = submit(
        table,
        paced,
        store,
        limits=LIMITS,
        case_seconds=0.01,
        options=SlurmOptions(elements=1, memory="500M", extra=("--begin=now",)),
    )
    deadline = time.monotonic() + 60
    while len(store.finished()) < 300 and time.monotonic() < deadline:
        time.sleep(0.2)
    subprocess.run(["scontrol", "requeue", f"{done.job}_0"], check=True)
    subprocess.run(
        ["scontrol", "update", f"JobId={done.job}_0", "StartTime=now"],
        check=False,
        capture_output=True,
    )
    deadline = time.monotonic() + 240
    while len(store.finished()) < 2000 and time.monotonic() < deadline:
        time.sleep(0.5)
    assert store.counts() == {"done": 2000}
    subprocess.run(["scancel", done.job], check=False)


@pytest.mark.slow
def test_killed_elements_and_submitters(tmp_path: Path) -> None:
    """The short form of ``python -m tests.sweeps.crashes --engine slurm``."""
    assert torment_slurm(4, 300, 3, tmp_path).faults == []
