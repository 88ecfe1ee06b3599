"""What a search changes in its process while it runs: linear algebra on one thread, and SIGTERM.

OpenBLAS adds in another order with other numbers of threads, so that SLSQP, say, gave other bits in
a worker than in the main process. The matrices of a search are too small for threads to help.
"""

from __future__ import annotations

import ctypes
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

# Module that brings OpenBLAS, the library beside it that holds the functions (the module itself
# where empty), and their names there.
_LIBRARIES = (
    ("numpy._core._multiarray_umath", "", "scipy_openblas_{}_num_threads64_"),
    ("scipy.linalg._fblas", "", "scipy_openblas_{}_num_threads"),
    ("casadi", "libcasadi-tp-openblas.so.0", "openblas_{}_num_threads"),
)


@contextmanager
def one_thread() -> Iterator[None]:
    """OpenBLAS, as the wheels of NumPy, SciPy and CasADi bring it, on one thread inside; other
    builds of them are left as they are. Packages count where they have been loaded."""
    switches = [found for library in _LIBRARIES if (found := _switch(*library))]
    before = [number() for number, _ in switches]
    for _, put in switches:
        put(1)
    try:
        yield
    finally:
        for (_, put), number in zip(switches, before, strict=True):
            put(number)


def _switch(
    module: str, file: str, name: str
) -> tuple[Callable[[], int], Callable[[int], Any]] | None:
    loaded = sys.modules.get(module)
    if loaded is None or loaded.__file__ is None:
        return None
    try:
        library = ctypes.CDLL(str(Path(loaded.__file__).parent / file) if file else loaded.__file__)
        return getattr(library, name.format("get")), getattr(library, name.format("set"))
    except (OSError, AttributeError):
        return None


_interrupts: list[int] = []  # signals since the search began that raised KeyboardInterrupt


def interrupted() -> bool:
    """Whether Ctrl-C or SIGTERM has come, though compiled code may have swallowed what it raised
    (CasADi does)."""
    return bool(_interrupts)


@contextmanager
def terminable() -> Iterator[None]:
    """SIGTERM ends a search as Ctrl-C does, unless the program has a use of its own for it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _interrupts.clear()
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def noted(number: int, frame: Any) -> None:
        own = before[signal.Signals(number)]
        try:
            (own if callable(own) else signal.default_int_handler)(number, frame)
        except KeyboardInterrupt:
            _interrupts.append(number)
            raise

    for number, own in before.items():
        if callable(own) or own is signal.SIG_DFL:
            signal.signal(number, noted)
    try:
        yield
    finally:
        _interrupts.clear()
        for number, own in before.items():
            if callable(own) or own is signal.SIG_DFL:
                signal.signal(number, own)
