"""Loops that numba compiles where it is installed, and runs as they are where it is not.

Numba takes a second to load: import modules of kernels where they are first used.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from functools import lru_cache
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

            _without_blas()
        except ImportError:
            return function
        options.setdefault("error_model", "numpy")
        try:
            found: Callable[P, R] = njit(cache=True, **options)(function)
        except RuntimeError:  # "no locator available"
            found = njit(**options)(function)
        return found

    return compiled


@lru_cache(maxsize=1)
def _without_blas() -> None:
    """Load what numba needs to compile without scipy.linalg, which takes as long as all the rest.
    Numba only asks whether BLAS is there (for convolutions; without it they are plain loops) and
    loads it itself where a function calls for it."""
    blas = "scipy.linalg.cython_blas"
    if blas in sys.modules or "numba.np.arraymath" in sys.modules:
        return
    sys.modules[blas] = None  # type: ignore[assignment]
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        del sys.modules[blas]
