"""A run function: found by name, and in a form that any process can load: pickled, with the module
search path it needs."""

from __future__ import annotations

import hashlib
import importlib
import pickle
import runpy
import sys
import types
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from trajopt.errors import ArgumentError, TrajoptError

RunFunction = Callable[[Any], Any]  # Case -> mapping of names to results, a number, or None


def function_named(key: str, name: str) -> Any:
    """The function called "module:function". Raises ArgumentError, naming ``key``."""
    module, sign, attribute = name.partition(":")
    if not sign:
        raise ArgumentError(key, name, "'module:function'")
    try:
        found = getattr(importlib.import_module(module), attribute)
    except TrajoptError:
        raise
    except Exception as error:  # whatever the user's module raises
        told = f"a function that can be imported ({type(error).__name__}: {error})"
        raise ArgumentError(key, name, told) from None
    if not callable(found):
        raise ArgumentError(key, name, "a function")
    return found


@dataclass(frozen=True)
class Packed:
    """A run function as bytes. ``main`` is the script it comes from, ``path`` the module search
    path."""

    data: bytes
    path: tuple[str, ...]
    main: str | None

    @property
    def key(self) -> str:
        return hashlib.blake2b(
            self.data + repr((self.path, self.main)).encode(), digest_size=8
        ).hexdigest()


def packed(run: RunFunction) -> Packed:
    """Pickle a run function. Raises ArgumentError for one that other processes cannot load."""
    main = getattr(sys.modules.get("__main__"), "__file__", None)
    uses_main = _module_of(run) in ("__main__", "__mp_main__")
    try:
        if uses_main and main is None:
            raise pickle.PicklingError("it was typed into an interpreter")
        data = pickle.dumps(run)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        data = _by_value(run, error)
    return Packed(data, tuple(sys.path), str(main) if uses_main and main else None)


def unpacked(run: Packed) -> RunFunction:
    """The run function; a script it comes from is imported first, as multiprocessing does."""
    if run.main is not None:
        module = types.ModuleType("__mp_main__")
        module.__dict__.update(runpy.run_path(run.main, run_name="__mp_main__"))
        sys.modules["__main__"] = sys.modules["__mp_main__"] = module
    function = pickle.loads(run.data)
    if not callable(function):
        raise ArgumentError("run", function, "a callable")
    return function  # type: ignore[no-any-return]


def name_of(run: RunFunction) -> str:
    """Name that goes into identities: module and qualified name, of the class for a callable
    object, of ``func`` where it has one, as ``functools.partial`` and bound functions do."""
    function = getattr(run, "func", run)
    named = function if hasattr(function, "__qualname__") else type(function)
    module = _module_of(run)
    return f"{'__main__' if module == '__mp_main__' else module}:{named.__qualname__}"


def _module_of(run: RunFunction) -> str:
    function = getattr(run, "func", run)
    return str(getattr(function, "__module__", None) or type(function).__module__)


def _by_value(run: RunFunction, error: Exception) -> bytes:
    """Lambdas and functions of an interpreter, by value, where cloudpickle (a part of Dask) is
    installed."""
    try:
        import cloudpickle  # type: ignore[import-untyped,unused-ignore]
    except ImportError:
        raise ArgumentError(
            "run", run, f"a function of a module, which other processes can import ({error})"
        ) from None
    data: bytes = cloudpickle.dumps(run)
    return data
