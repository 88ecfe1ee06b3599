"""Sweep files: what to vary, over what problem or function, as TOML."""

from __future__ import annotations

import importlib
import re
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.errors import ArgumentError, ProblemError, TrajoptError
from trajopt.problem.search import Problem, load_problem
from trajopt.sweeps.axes import combined, with_derived
from trajopt.sweeps.cases import CaseTable
from trajopt.sweeps.problem_run import RUN_NAMES, ProblemRun, SolveOptions, WithProblem, changes
from trajopt.sweeps.runfunction import RunFunction, name_of
from trajopt.sweeps.sweeps import TIME_LIMIT, tabled
from trajopt.systems.smdw.problem import ManeuverProblem, load_maneuver

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
    problem = _problem(file, str(data["problem"])) if "problem" in data else None
    axes = combined(data.get("axes", {}), data.get("sample"))
    derived, exclude = data.get("derived", {}), data.get("exclude", [])
    columns = with_derived(axes, derived, [exclude] if isinstance(exclude, str) else exclude)
    if not columns or not len(next(iter(columns.values()))):
        raise ArgumentError("axes", dict(data.get("axes", {})), "axes that leave at least one case")
    run, content = _run_function(data, problem)
    table = tabled(columns, run, data.get("code"), content)
    first = table.take(np.array([0])).rows()[0].values
    if problem is not None:
        _check_names(
            first, problem, derived, exclude, uses_problem_only=isinstance(run, ProblemRun)
        )
    return SweepPlan(
        str(data.get("title", file.stem)),
        run,
        table,
        float(data.get("time_limit", TIME_LIMIT)),
        _bytes(data.get("memory_limit")),
        text,
    )


def _problem(file: Path, name: str) -> Problem | ManeuverProblem:
    """A problem with a goal, or one with an obstacle, by what its file holds."""
    place = file.parent / name
    try:
        tables = tomllib.loads(place.read_text(encoding="utf-8"))
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError):
        tables = {}  # load_problem says what is wrong
    found = (
        load_maneuver(place)
        if "obstacle" in tables and "goal" not in tables
        else load_problem(place)
    )
    if not isinstance(found, (Problem, ManeuverProblem)):
        raise ArgumentError(
            "problem",
            name,
            "a problem with a goal or an obstacle; for others use run = 'module:function' alone",
        )
    return found


def _run_function(
    data: Mapping[str, Any], problem: Problem | ManeuverProblem | None
) -> tuple[RunFunction, Any]:
    """The run function, and what a case's identity holds besides its values."""
    content = None if problem is None else problem.model_dump(mode="json", exclude_none=True)
    if "run" in data:
        function = _imported(str(data["run"]))
        if "solve" in data:
            raise ArgumentError("solve", data["solve"], "no such table beside run")
        if problem is None:
            return function, None
        return WithProblem(function, problem), [name_of(function), content]
    if problem is None:
        raise ArgumentError("problem", None, "problem = 'file.toml', or run = 'module:function'")
    if not isinstance(problem, Problem):
        raise ArgumentError(
            "run", None, "run = 'module:function' beside a problem with an obstacle"
        )
    known = set(SolveOptions.__dataclass_fields__)
    given = data.get("solve", {})
    if set(given) - known:
        raise ArgumentError("solve", given, "only " + ", ".join(sorted(known)))
    options = SolveOptions(**given)
    return ProblemRun(problem, options), [content, asdict(options)]


def _check_names(
    first: Mapping[str, Any],
    problem: Problem | ManeuverProblem,
    derived: Mapping[str, str],
    exclude: Any,
    *,
    uses_problem_only: bool,
) -> None:
    """Find wrong names now and not in a million rows."""
    unknown = [n for n in first if n.startswith("run.") and n not in RUN_NAMES]
    if unknown:
        raise ArgumentError(
            f"axes.{unknown[0]}", first[unknown[0]], "one of " + ", ".join(RUN_NAMES)
        )
    problem.replace(changes(first))
    if not uses_problem_only:
        return
    used = " ".join(
        [*map(str, derived.values()), *([exclude] if isinstance(exclude, str) else exclude)]
    )
    for name in first:
        if "." not in name and name != "repeat" and not re.search(rf"\b{re.escape(name)}\b", used):
            raise ArgumentError(
                f"axes.{name}",
                first[name],
                "a dotted key of the problem, such as scene.friction, "
                "repeat, or a name that derived or exclude use",
            )


def _imported(name: str) -> Any:
    module, sign, attribute = name.partition(":")
    if not sign:
        raise ArgumentError("run", name, "'module:function'")
    try:
        found = getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        if isinstance(error, TrajoptError):
            raise
        raise ArgumentError("run", name, f"a function that can be imported ({error})") from None
    if not callable(found):
        raise ArgumentError("run", name, "a function")
    return found


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
