"""A record names the commit of this package's own repository, never that of a stranger's."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from trajopt import provenance

ROOT = Path(provenance.__file__).parents[1]
OURS = '[project]\nname = "wheeled-trajopt"\n'
THEIRS = '[project]\nname = "stranger"\n'


def git(folder: Path, *arguments: str) -> str:
    who = ("-c", "user.name=A", "-c", "user.email=a@b.c")
    clean = {k: v for k, v in os.environ.items() if not k.startswith("GIT_")}
    done = subprocess.run(
        ["git", "-C", str(folder), *who, *arguments],
        check=True,
        capture_output=True,
        text=True,
        env=clean,
    )
    return done.stdout.strip()


def repository(folder: Path) -> str:
    """Makes one of all files in ``folder``; its commit."""
    git(folder, "init", "-q")
    git(folder, "add", "-A")
    git(folder, "commit", "-q", "--allow-empty", "-m", "all")
    return git(folder, "rev-parse", "HEAD")


def package(folder: Path, project: str | None) -> Path:
    """The files that matter of the package in ``folder``, beside a pyproject.toml."""
    (folder / "trajopt").mkdir(parents=True)
    for name in ("__init__.py", "provenance.py"):
        shutil.copy(ROOT / "trajopt" / name, folder / "trajopt" / name)
    if project is not None:
        (folder / "pyproject.toml").write_text(project, encoding="utf-8")
    return folder


def told(folder: Path, cwd: Path, **variables: str) -> str:
    """What the package in ``folder`` gives as its commit when it runs in ``cwd``."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", "from trajopt.provenance import commit; print(commit())"],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": str(folder), **variables},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


def test_own_repository_is_named_with_its_changes(tmp_path):
    own = package(tmp_path / "own", OURS)
    head = repository(own)
    assert told(own, tmp_path) == head
    (own / "notes.txt").write_text("not the package")
    assert told(own, tmp_path) == head
    with (own / "trajopt" / "__init__.py").open("a") as file:
        file.write("# changed\n")
    assert told(own, tmp_path) == head + "+changes"


@pytest.mark.parametrize("project", [None, OURS, THEIRS])
@pytest.mark.parametrize("kept", [True, False])
@pytest.mark.parametrize("place", ["venv/lib/python3.11/site-packages", "vendor/trajopt", "."])
def test_a_strangers_repository_is_not_named(tmp_path, place, kept, project):
    """Wherever the package lies in it, whether kept in it or not; a root that is this project with
    the package kept would be a fork, thus own."""
    stranger = tmp_path / "stranger"
    stranger.mkdir()
    (stranger / ".gitignore").write_text("" if kept else "trajopt/\n")
    if place == "." and kept and project == OURS:
        pytest.skip("a fork")
    copy = package(stranger / place, project)
    repository(stranger)
    assert told(copy, stranger) == "None"


def test_neither_folder_nor_variables_lead_elsewhere(tmp_path):
    stranger, own = package(tmp_path / "stranger", OURS), package(tmp_path / "own", OURS)
    repository(stranger)
    hook = {"GIT_DIR": str(stranger / ".git"), "GIT_WORK_TREE": str(stranger)}
    assert told(own, stranger, **hook) == "None"
    (own / "other.txt").write_text("another commit")
    head = repository(own)
    assert told(own, stranger, **hook) == head


def test_versions_name_what_is_installed():
    found = provenance.versions(("numpy", "no-such-package"))
    assert list(found) == ["python", "trajopt", "numpy"]
    assert set(provenance.run_facts()) == {"written", "host", "system", "processor"}


def test_nothing_else_asks_git_or_the_processor():
    asks = re.compile(r"rev-parse|git.*describe|/proc/cpuinfo")
    found = [
        str(file.relative_to(ROOT))
        for folder in ("trajopt", "benchmarks")
        for file in (ROOT / folder).rglob("*.py")
        if asks.search(file.read_text(encoding="utf-8"))
    ]
    assert found == ["trajopt/provenance.py"]
