"""Saved searches: what a population method needs to go on bit by bit, in one file (*.npz).

A method hands its run something with ``pack`` (a mapping of names to arrays and plain values) and
``unpack``; the run writes it now and then and when the search ends, however that is.
"""

from __future__ import annotations

import json
import time
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol
from zipfile import BadZipFile

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.files import whole_file

_EVERY = 10.0  # s between saves, chosen


class Packable(Protocol):
    """State that can be taken out and put back."""

    def pack(self) -> dict[str, Any]: ...

    def unpack(self, kept: Mapping[str, Any]) -> None: ...


def write_state(path: str | Path, values: Mapping[str, Any]) -> None:
    """Write ``values`` (arrays, and what JSON holds) to ``path``, under a temporary name first."""
    arrays = {name: v for name, v in values.items() if isinstance(v, np.ndarray)}
    rest = {name: v for name, v in values.items() if name not in arrays}
    with whole_file(Path(path)) as part, part.open("wb") as file:
        np.savez(
            file, allow_pickle=False, state=np.array(json.dumps(rest, default=_plain)), **arrays
        )


def read_state(path: str | Path, what: str) -> dict[str, Any]:
    """What ``write_state`` wrote. Raises ArgumentError for a file that is missing or no ``what``."""
    try:
        with np.load(path, allow_pickle=False) as data:
            found = _restored(json.loads(str(data["state"])))
            assert isinstance(found, dict)
            return {**found, **{name: data[name] for name in data.files if name != "state"}}
    except (OSError, ValueError, KeyError, TypeError, EOFError, BadZipFile, zlib.error) as error:
        raise ArgumentError("path", str(path), f"a file written by {what} ({error})") from None


def identity(objective: Any, bounds: Array) -> str:
    """What tells an objective from others: the name and code of a user's functions, which may be
    slow; of others the class and the cost in the middle of the bounds."""
    function = getattr(objective, "function", None)
    if function is None:
        try:
            cost = float(objective.evaluate(bounds.mean(axis=1)[None]).cost[0])
        except Exception as error:  # whatever an objective raises
            return f"{type(objective).__name__}, {type(error).__name__} in the middle"
        return f"{type(objective).__name__}, {cost:.6g} in the middle"
    functions = [function, *(c.function for c in objective.constraints)]
    return ", ".join(_named(one) for one in functions)


def _named(function: Any) -> str:
    name = getattr(function, "__qualname__", type(function).__qualname__)
    code = getattr(function, "__code__", None)
    if code is None:
        return str(name)
    plain = [value for value in code.co_consts if not hasattr(value, "co_code")]
    return f"{name} ({zlib.crc32(code.co_code + repr((code.co_names, plain)).encode()):08x})"


class StateFile:
    """The file of one search: read when it exists, written by ``save``."""

    def __init__(self, path: str | Path, optimizer: Any, objective: Any, bounds: Array) -> None:
        self.path, self._last = Path(path), time.monotonic()
        self.item: Packable | None = None
        self.about: dict[str, Any] = {
            "optimizer": repr(optimizer),
            "bounds": np.asarray(bounds),
            "objective": identity(objective, bounds),
        }
        self.loaded: dict[str, Any] | None = None
        if self.path.exists():
            self.loaded = read_state(self.path, "a search with state=")
            for name, value in self.about.items():
                told = self.loaded.get(name)
                if told is None or not np.array_equal(told, value):
                    expected = f"a search saved with the {name} of this one, {value}"
                    raise ArgumentError("state", str(path), f"{expected}; it has {told}")
        elif not self.path.parent.is_dir():
            raise ArgumentError("state", str(path), "a file in a folder that exists")

    def keep(self, item: Packable) -> None:
        """From now on the search is ``item``; what was loaded goes into it."""
        self.item = item
        if self.loaded is not None:
            try:
                item.unpack(self.loaded)
            except (KeyError, ValueError, TypeError) as error:
                expected = f"a file written by a search with state= ({error})"
                raise ArgumentError("state", str(self.path), expected) from None
            self.loaded = None

    def save(self, best: Mapping[str, Any], *, now: bool = True) -> None:
        """Write the search and its best candidate; ``now`` False: only if the last time is a while
        ago."""
        if self.item is None or (not now and time.monotonic() - self._last < _EVERY):
            return
        write_state(self.path, {**self.item.pack(), **best, **self.about})
        self._last = time.monotonic()


def _plain(value: object) -> object:
    """NumPy values of a random generator's state as JSON."""
    if isinstance(value, np.ndarray):
        return {"dtype": str(value.dtype), "values": value.tolist()}
    if isinstance(value, (np.integer, np.floating, np.bool_)):
        return value.item()
    raise TypeError(f"{type(value).__name__} in a saved search")


def _restored(value: object) -> object:
    if isinstance(value, dict):
        if set(value) == {"dtype", "values"}:
            return np.array(value["values"], dtype=value["dtype"])
        return {key: _restored(entry) for key, entry in value.items()}
    return value
