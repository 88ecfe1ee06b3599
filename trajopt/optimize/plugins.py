"""Optimizers from outside the package: by entry point, or from a Python file.

An entry point in the group ``trajopt.optimizers`` names a function or class that makes an optimizer
with default options. A file, given as ``path/to/file.py`` wherever an optimizer's name is asked,
has a module-level ``OPTIMIZERS``: a mapping of names to such functions or classes (``file.py:name``
picks one of several). Files named in the environment variable ``TRAJOPT_PLUGINS`` (separated as in
PATH) count as installed: their optimizers are known by name in commands, benchmarks and tests that
loop over all optimizers.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from trajopt.errors import ArgumentError

GROUP = "trajopt.optimizers"
FILES = "TRAJOPT_PLUGINS"  # environment variable

Factory = Callable[[], Any]


def installed_optimizers() -> dict[str, Factory]:
    """Names and factories of the optimizers of installed packages and of the files in
    TRAJOPT_PLUGINS.

    Raises ArgumentError for a file that cannot be used.
    """
    found: dict[str, Factory] = {point.name: _Loaded(point) for point in entry_points(group=GROUP)}
    for file in filter(None, os.environ.get(FILES, "").split(os.pathsep)):
        found.update(mapping_of_file(file, "OPTIMIZERS"))
    return found


def optimizers_of_file(path: str | Path) -> dict[str, Factory]:
    """The optimizers of a plugin file. Raises ArgumentError for a file without any."""
    return _mapping(plugin(path), "OPTIMIZERS", path)


def plugin(path: str | Path) -> ModuleType:
    """The module in a file, loaded once. Raises ArgumentError where that fails."""
    file = Path(path).resolve()
    name = f"trajopt_plugin_{file.stem}_{abs(hash(str(file))):x}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, file)
    if not file.is_file() or spec is None or spec.loader is None:
        raise ArgumentError("plugin", str(path), "an existing Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up while it is being loaded
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        raise ArgumentError(
            "plugin", str(path), f"a file that loads ({type(error).__name__}: {error})"
        ) from error
    return module


def mapping_of_file(path: str | Path, name: str) -> dict[str, Factory]:
    """The module-level mapping ``name`` of a plugin file; empty where it has none."""
    return _mapping(plugin(path), name, path) if hasattr(plugin(path), name) else {}


def _mapping(module: ModuleType, name: str, path: str | Path) -> dict[str, Factory]:
    found = getattr(module, name, None)
    if not isinstance(found, Mapping) or not found or not all(callable(v) for v in found.values()):
        raise ArgumentError(
            "plugin", str(path), f"a mapping {name} of names to functions or classes"
        )
    return dict(found)


class _Loaded:
    """An entry point that is imported when first called."""

    def __init__(self, point: Any) -> None:
        self._point = point

    def __call__(self) -> Any:
        return self._point.load()()
