"""What made a result: package versions, source commit, machine."""

from __future__ import annotations

import importlib.metadata
import platform
import subprocess
from datetime import UTC, datetime
from pathlib import Path as FilePath
from typing import Any

import trajopt

# Packages that can change a number in a result.
PACKAGES = ("numpy", "scipy", "casadi", "toppra", "numba", "pybullet", "mujoco")


def versions() -> dict[str, str]:
    """Versions of Python, this package and the packages it computes with, where installed."""
    found = {"python": platform.python_version(), "trajopt": trajopt.__version__}
    for name in PACKAGES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def commit() -> str | None:
    """Commit of the checkout that this package runs from, "+changes" behind it where files differ;
    else None."""
    package = FilePath(trajopt.__file__).parent
    head = _git(package, "rev-parse", "HEAD")
    # An installed copy may lie inside somebody else's checkout: ask whether git knows this very
    # file.
    if head is None or _git(package, "ls-files", "--error-unmatch", "__init__.py") is None:
        return None
    return head + (
        "+changes" if _git(package, "status", "--porcelain", "--untracked-files=no", ".") else ""
    )


def run_facts() -> dict[str, Any]:
    """Time and machine: what differs between equal runs."""
    return {
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "host": platform.node(),
        "system": platform.platform(),
        "processor": _processor(),
    }


def _processor() -> str:
    try:
        lines = FilePath("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _git(folder: FilePath, *arguments: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments],
            capture_output=True,
            text=True,
            timeout=10,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
