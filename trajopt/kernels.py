"""Loops that numba compiles where it is installed, and runs as they are where it is not.

Numba takes a second to load: import modules of kernels where they are first used.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


def kernel(**options: Any) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorator: ``numba.njit`` with ``options`` and division as NumPy has it, kept on disk for the
    next process; where no place for that can be written (numba looks beside the source, in
    NUMBA_CACHE_DIR and in the user's cache), compiled anew in every process."""

    def compiled(function: Callable[P, R]) -> Callable[P, R]:
        try:
            from numba import njit
        except ImportError:
            return function
        options.setdefault("error_model", "numpy")
        try:
            found: Callable[P, R] = njit(cache=True, **options)(function)
        except RuntimeError:  # "no locator available"
            found = njit(**options)(function)
        return found

    return compiled
