"""Functions compiled by numba."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """``function`` compiled when it is first called, and kept on disk where numba finds a folder it
    can write to. Without numba the function itself: right, but slow.

    numba takes some 0.3 s to load: import a module that uses this where it is first needed.
    """
    try:
        from numba import njit
    except ImportError:
        return function
    options: dict[str, Any] = {"error_model": "numpy", "nogil": True}
    try:
        made: Callable[P, R] = njit(cache=True, **options)(function)
    except RuntimeError:  # no folder for the cache can be written to
        made = njit(**options)(function)
    return made
