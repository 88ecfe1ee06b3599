"""Sweep files: what to vary, over what problem or function, as TOML (the package's text says how
functions and problems are found)."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.errors import ArgumentError, ProblemError
from trajopt.sweeps.axes import combined, with_derived
from trajopt.sweeps.cases import CaseTable
from trajopt.sweeps.runfunction import RunFunction, function_named
from trajopt.sweeps.sweeps import TIME_LIMIT, tabled

RUN_CASE = "trajopt.case:run_case"  # runs the cases of a problem where a file names no other
WITH_PROBLEM = "trajopt.case:with_problem"

_KEYS = (
    "title",
    "problem",
    "run",
    "code",
    "time_limit",
    "memory_limit",
    "solve",
    "axes",
    "sample",
    "derived",
    "exclude",
)


@dataclass(frozen=True)
class SweepPlan:
    """A sweep file, read: cases ready to run. ``text`` is the file as given."""

    title: str
    run: RunFunction
    table: CaseTable
    time_limit: float
    memory_limit: int | None
    code: str | None
    text: str


def load_sweep(path: str | Path) -> SweepPlan:
    """Read a sweep file. Raises ProblemError for what it does not know or cannot use."""
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8")
        data = tomllib.loads(text)
    except FileNotFoundError:
        raise ProblemError(
            str(path), "file", "missing", "an existing sweep file (*.toml)"
        ) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, IsADirectoryError) as error:
        raise ProblemError(str(path), "file", str(error), "valid TOML in UTF-8") from None
    for key in data:
        if key not in _KEYS:
            raise ProblemError(str(path), key, data[key], "one of " + ", ".join(_KEYS))
    try:
        return _plan(data, file, text)
    except ArgumentError as error:
        raise ProblemError(str(path), error.argument, error.value, error.expected) from None


def _plan(data: Mapping[str, Any], file: Path, text: str) -> SweepPlan:
    run = _run_function(data, file.parent)
    axes = combined(_axes(data), data.get("sample"))
    derived, exclude = data.get("derived", {}), data.get("exclude", [])
    rules = [exclude] if isinstance(exclude, str) else exclude
    columns = with_derived(axes, derived, rules)
    if not columns or not len(next(iter(columns.values()))):
        raise ArgumentError("axes", dict(data.get("axes", {})), "axes that leave at least one case")
    table = tabled(columns, run, getattr(run, "content", None))
    if "problem" in data:
        formulas = " ".join(map(str, [*derived.values(), *rules]))
        spare = [
            n for n in axes if "." not in n and not re.search(rf"\b{re.escape(n)}\b", formulas)
        ]
        run.check(table.take(np.array([0])).rows()[0], spare)
    return SweepPlan(
        str(data.get("title", file.stem)),
        run,
        table,
        float(data.get("time_limit", TIME_LIMIT)),
        _bytes(data.get("memory_limit")),
        data.get("code"),
        text,
    )


def _axes(data: Mapping[str, Any]) -> dict[str, Any]:
    """Axes of the file; ``[solve]`` is short for axes ``run.*`` of one value each."""
    axes = {f"run.{name}": {"values": [value]} for name, value in data.get("solve", {}).items()}
    twice = axes.keys() & data.get("axes", {}).keys()
    if twice:
        raise ArgumentError("solve", sorted(twice), "each name once, in axes or in solve")
    return {**axes, **data.get("axes", {})}


def _run_function(data: Mapping[str, Any], folder: Path) -> Any:
    """The run function of the file, bound to its problem where it names one."""
    name = data.get("run", RUN_CASE)
    if "problem" in data:
        bind = function_named("problem", WITH_PROBLEM)
        return bind(function_named("run", str(name)), folder / str(data["problem"]))
    if name == RUN_CASE:
        raise ArgumentError("problem", None, "problem = 'file.toml', or run = 'module:function'")
    if "solve" in data:
        raise ArgumentError("solve", data["solve"], f"no such table where {RUN_CASE} does not run")
    return function_named("run", str(name))


def _bytes(value: Any) -> int | None:
    """Bytes of a memory limit: a number, or a text with kB, MB, GB."""
    if value is None or (isinstance(value, int) and not isinstance(value, bool) and value >= 0):
        return value
    match = (
        re.fullmatch(r"\s*([0-9.]+)\s*(k|M|G)i?B?\s*", value) if isinstance(value, str) else None
    )
    if match is None:
        raise ArgumentError("memory_limit", value, "bytes, or a text such as '2 GB'")
    return int(float(match[1]) * {"k": 1e3, "M": 1e6, "G": 1e9}[match[2]])
