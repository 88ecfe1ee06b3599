"""One thread for the linear algebra of NumPy and SciPy while a search runs.

OpenBLAS adds in another order with other numbers of threads, so that SLSQP, say, gave other bits in
a worker than in the main process. The matrices of a search are too small for threads to help.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

# module whose library holds the functions, and their suffix there
_LIBRARIES = (("numpy._core._multiarray_umath", "64_"), ("scipy.linalg._fblas", ""))


@contextmanager
def one_thread() -> Iterator[None]:
    """OpenBLAS, as NumPy's and SciPy's wheels bring it, on one thread inside; other builds of them
    are left as they are. SciPy counts where it has been loaded."""
    switches = [found for name, suffix in _LIBRARIES if (found := _switch(name, suffix))]
    before = [number() for number, _ in switches]
    for _, put in switches:
        put(1)
    try:
        yield
    finally:
        for (_, put), number in zip(switches, before, strict=True):
            put(number)


def _switch(module: str, suffix: str) -> tuple[Callable[[], int], Callable[[int], Any]] | None:
    loaded = sys.modules.get(module)
    if loaded is None or loaded.__file__ is None:
        return None
    library = ctypes.CDLL(loaded.__file__)
    try:
        return (
            getattr(library, f"scipy_openblas_get_num_threads{suffix}"),
            getattr(library, f"scipy_openblas_set_num_threads{suffix}"),
        )
    except AttributeError:
        return None
