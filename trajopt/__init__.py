"""trajopt plans, times and checks motions of wheeled ground robots as optimisation problems.

Everything public is reachable from here and is loaded when first used, so importing the package is cheap.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trajopt.errors import (
        ArgumentError,
        InfeasibleError,
        MissingDependencyError,
        ProblemError,
        SimulationError,
        TrajoptError,
    )
    from trajopt.paths.path import Path

__version__ = "0.1.0"

_HOME = {
    "ArgumentError": "trajopt.errors",
    "InfeasibleError": "trajopt.errors",
    "MissingDependencyError": "trajopt.errors",
    "ProblemError": "trajopt.errors",
    "SimulationError": "trajopt.errors",
    "TrajoptError": "trajopt.errors",
    "Path": "trajopt.paths.path",
}

__all__ = sorted(_HOME)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'trajopt' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return [*_HOME, "__version__"]
