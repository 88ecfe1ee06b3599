"""Loops that numba compiles where it is installed, and runs as they are where it is not.

Numba takes a second to load: import modules of kernels where they are first used. What it compiles
is kept on disk. That an empty cache is filled, which takes some twenty seconds, is told once a process
by the logger ``trajopt.kernels`` (INFO), which commands show on a terminal; the time counts in no
budget (``compiling``).
"""

from __future__ import annotations

import importlib
import logging
import sys
import time
from collections.abc import Callable
from functools import lru_cache
from typing import Any, ParamSpec, TypeVar, cast

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
            _watched()
        except ImportError:
            return function
        options.setdefault("error_model", "numpy")
        try:
            found = njit(cache=True, **options)(function)
        except RuntimeError:  # "no locator available"
            return cast("Callable[P, R]", njit(**options)(function))
        for name in ("load_overload", "save_overload"):
            setattr(found._cache, name, _lenient(getattr(found._cache, name)))
        return cast("Callable[P, R]", found)

    return compiled


def _lenient(of_cache: Callable[..., Any]) -> Callable[..., Any]:
    """Reading or writing the cache; where the disk refuses (full, read-only, gone), nothing."""

    def tried(*arguments: Any) -> Any:
        try:
            return of_cache(*arguments)
        except OSError:
            return None

    return tried


_spent = {"wall": 0.0, "cpu": 0.0}  # s, on compiling in this process


def compiling(clock: str) -> float:
    """Seconds of this process that went into compiling so far, of a ``clock``: wall or cpu."""
    return _spent[clock]


@lru_cache(maxsize=1)
def _watched() -> None:
    """Have numba tell when it compiles; what a function calls is compiled inside."""
    from numba.core import event

    class Watch(event.Listener):
        depth, told = 0, False
        began = 0.0, 0.0

        def on_start(self, event: Any) -> None:  # noqa: ARG002
            if not self.told:
                text = "compiling numerical kernels, once for this version: some twenty seconds"
                logging.getLogger(__name__).info(text)
                self.told = True
            if self.depth == 0:
                self.began = time.perf_counter(), time.process_time()
            self.depth += 1

        def on_end(self, event: Any) -> None:  # noqa: ARG002
            self.depth -= 1
            if self.depth == 0:
                _spent["wall"] += time.perf_counter() - self.began[0]
                _spent["cpu"] += time.process_time() - self.began[1]

    event.register("numba:compile", Watch())  # type: ignore[no-untyped-call]


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
