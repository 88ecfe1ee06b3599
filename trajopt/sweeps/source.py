"""What code runs a case: a checksum over the run function's module and what it imports.

Counted are the file of the run function, every module that it imports, directly or by others, also
inside functions, as long as it is the user's own (neither standard library nor installed), values
that a callable object, a partial or a closure carries, and trajopt as a whole where it is
imported. Files are read, nothing is imported. Data files and modules found by a name in a text are
not seen: a ``code`` key says by hand what code it is, instead of all this.
"""

from __future__ import annotations

import ast
import importlib.machinery
import inspect
import json
import marshal
import pickle
import site
import sys
import sysconfig
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from types import FunctionType
from typing import Any

from trajopt.errors import ArgumentError
from trajopt.files import digest
from trajopt.provenance import versions
from trajopt.sweeps.runfunction import RunFunction, name_of

_OWN = "trajopt"
_PASSIVE = "trajopt.sweeps"  # runs cases, and changes nothing in them


@dataclass(frozen=True)
class Code:
    """Code of a run function: ``digest`` stands in every row, ``parts`` are the checksums by module
    (or the ``code`` key) that it is made of."""

    parts: Mapping[str, str]

    @property
    def digest(self) -> str:
        # Shorter than an identity, so that a damaged part's identities can be told from it.
        return digest(json.dumps(self.parts, sort_keys=True).encode())[:16]

    def changed(self, other: Mapping[str, str]) -> list[str]:
        """Names of the parts that differ from those of other code."""
        names = sorted({*self.parts, *other})
        return [n for n in names if self.parts.get(n) != other.get(n)]


def code_of(run: RunFunction, key: str | None = None) -> Code:
    """Code of a run function, or ``key`` where one is given. Raises ArgumentError where the source
    cannot be found."""
    if key is not None:
        return Code({"code": key})
    function = getattr(run, "func", run)
    parts = dict(_state(run))
    modules = [str(getattr(function, "__module__", None) or type(function).__module__)]
    if not isinstance(run, (FunctionType, partial)):
        modules.append(type(run).__module__)
    for module in modules:
        file = getattr(sys.modules.get(module), "__file__", None)
        if file is None:
            parts[f"{module} (typed in)"] = _typed(function)
        else:
            parts.update(_closure(module, Path(file)))
    return Code(parts)


def _state(run: Any) -> Iterator[tuple[str, str]]:
    """Checksums of what a run function carries beside its source."""
    try:
        if isinstance(run, FunctionType):
            for name, cell in zip(run.__code__.co_freevars, run.__closure__ or (), strict=True):
                value = cell.cell_contents
                if not isinstance(value, (FunctionType, type)):
                    yield f"closure {name}", digest(pickle.dumps(value))
        elif isinstance(run, partial):
            yield "partial", digest(pickle.dumps((run.args, run.keywords)))
        elif not hasattr(run, "content"):  # which is in the identities of cases
            yield "object", digest(pickle.dumps(getattr(run, "__dict__", None)))
    except (pickle.PicklingError, TypeError, AttributeError, ValueError) as error:
        raise ArgumentError("code", None, f"a text: {name_of(run)} carries {error}") from None


def _typed(function: Any) -> str:
    """Checksum of a function that no file holds."""
    try:
        return digest(inspect.getsource(function).encode())
    except (OSError, TypeError):
        pass
    try:
        return digest(marshal.dumps(function.__code__))
    except AttributeError:
        raise ArgumentError("code", None, f"a text: {function!r} has no source") from None


def _closure(module: str, file: Path) -> dict[str, str]:
    """Checksums of a module and of all that it imports, by name."""
    found: dict[str, str] = {}
    todo = [(module, file, file.name == "__init__.py")]
    while todo:
        name, file, package = todo.pop()
        if name == _OWN or name.startswith(f"{_OWN}."):
            if f"{name}.".startswith(f"{_PASSIVE}."):
                continue
            found[_OWN] = _own_digest()
        elif name not in found and file.suffix == ".py":
            data = file.read_bytes()
            found[name] = digest(data)
            for imported in _imports(data, name, package):
                todo += _files(imported)
    return found


def _imports(data: bytes, module: str, package: bool) -> Iterator[str]:
    """Names that may be modules in the import statements of a source."""
    for node in ast.walk(ast.parse(data)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = module.split(".")
            above = above[: len(above) - node.level + package] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            if base not in (_OWN, ""):
                yield base
            yield from (f"{base}.{alias.name}".removeprefix(".") for alias in node.names)


def _files(name: str) -> list[tuple[str, Path, bool]]:
    """The module called ``name`` and the packages above it, those that are the user's own or
    trajopt's."""
    parts, found = name.split("."), []
    if parts[0] == _OWN:
        return [(name, Path(), False)]
    if parts[0] in sys.stdlib_module_names:
        return []
    path: Any = None
    for i in range(len(parts)):
        whole = ".".join(parts[: i + 1])
        try:
            spec = importlib.machinery.PathFinder.find_spec(whole, path)
        except (ImportError, ValueError):
            break
        if spec is None:
            break
        path = spec.submodule_search_locations
        if spec.origin and spec.has_location and not _installed(Path(spec.origin)):
            found.append((whole, Path(spec.origin), path is not None))
        if path is None:
            break
    return found


def _installed(file: Path) -> bool:
    return any(file.is_relative_to(folder) for folder in _installed_folders())


@lru_cache(maxsize=1)
def _installed_folders() -> list[Path]:
    names = ("stdlib", "platstdlib", "purelib", "platlib")
    folders = [sysconfig.get_paths()[n] for n in names] + site.getsitepackages()
    return [Path(f) for f in [*folders, site.getusersitepackages()]]


@lru_cache(maxsize=1)
def _own_digest() -> str:
    """Version of trajopt and checksum of its sources and data."""
    root = Path(__file__).parents[1]
    files = sorted(f for f in root.rglob("*") if f.suffix in (".py", ".toml"))
    sums = "".join(f"{f.relative_to(root)} {digest(f.read_bytes())}\n" for f in files)
    return f"{versions(())['trajopt']} {digest(sums.encode())}"
