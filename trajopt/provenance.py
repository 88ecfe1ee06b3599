"""What made a result: package versions, source commit, machine. Every record takes it from here."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
import tomllib
from collections.abc import Iterable
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import trajopt

# Packages that can change a number in a result.
PACKAGES = (
    "numpy",
    "scipy",
    "casadi",
    "toppra",
    "numba",
    "pybullet",
    "mujoco",
    "pyarrow",
    "distributed",
)


def versions(packages: Iterable[str] = PACKAGES) -> dict[str, str]:
    """Versions of Python, this package and those of ``packages`` that are installed."""
    found = {"python": platform.python_version(), "trajopt": trajopt.__version__}
    for name in packages:
        try:
            found.setdefault(name, importlib.metadata.version(name))
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def commit() -> str | None:
    """Commit of this package's own repository, "+changes" behind it where files differ.

    None where the package is installed without its repository, also inside a checkout of something
    else: a repository counts only if its root holds this very package and the pyproject.toml named
    wheeled-trajopt, and if git keeps the package's files.
    """
    package = Path(trajopt.__file__).resolve().parent
    root = package.parent
    top = _git(root, "rev-parse", "--show-toplevel")
    if top is None or Path(top).resolve() != root or not _is_project(root / "pyproject.toml"):
        return None
    head = _git(root, "rev-parse", "HEAD")
    if head is None or _git(root, "ls-files", "--error-unmatch", "trajopt/__init__.py") is None:
        return None
    changed = _git(root, "status", "--porcelain", "--untracked-files=no", "trajopt")
    return head + ("+changes" if changed else "")


def run_facts() -> dict[str, Any]:
    """Time and machine: what differs between equal runs."""
    return {
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "host": platform.node(),
        "system": platform.platform(),
        "processor": processor(),
    }


@lru_cache(maxsize=1)
def processor() -> str:
    """Model name of the processor, or its kind where the system does not tell."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def _is_project(file: Path) -> bool:
    try:
        described = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):  # absent, or no TOML
        return False
    return bool(described.get("project", {}).get("name") == "wheeled-trajopt")


def _git(folder: Path, *arguments: str) -> str | None:
    """What git says of ``folder``; None where it fails. Variables that a hook sets (GIT_DIR, ...)
    would name another repository and are left out."""
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments],
            capture_output=True,
            text=True,
            timeout=10,
            check=False,
            env={k: v for k, v in os.environ.items() if not k.startswith("GIT_")},
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
