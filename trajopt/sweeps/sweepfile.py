"""Sweep files: what to vary, over what problem or function, as TOML (the package's text says how
functions and problems are found)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import BeforeValidator, Field, JsonValue, ValidationError

from trajopt.errors import ArgumentError, ProblemError
from trajopt.schema import (
    Positive,
    Section,
    broken_rule,
    json_schema,
    read_text,
    tables_of,
    validated,
)
from trajopt.sweeps.axes import Axis, Sample, combined, with_derived
from trajopt.sweeps.cases import CaseTable
from trajopt.sweeps.expressions import parse
from trajopt.sweeps.runfunction import RunFunction, function_named
from trajopt.sweeps.sweeps import TIME_LIMIT, tabled

RUN_CASE = "trajopt.case:run_case"  # runs the cases of a problem where a file names no other
WITH_PROBLEM = "trajopt.case:with_problem"


def _bytes(value: Any) -> int:
    """Bytes of a memory limit: a number, or a text with kB, MB, GB."""
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**62:
        return value
    pattern = r"\s*(\d{1,6}(?:\.\d{1,6})?)\s*([kMG])i?B?\s*"
    match = re.fullmatch(pattern, value) if isinstance(value, str) else None
    if match is None:
        raise broken_rule("", value, "bytes, or a text such as '2 GB'")
    return int(float(match[1]) * {"k": 1e3, "M": 1e6, "G": 1e9}[match[2]])


def _list(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


class SweepFile(Section):
    """A sweep file. ``time_limit`` of a case, s; ``memory_limit`` of a case, bytes or a text such
    as "2 GB"; ``code`` says what code runs, instead of its source."""

    sizes: ClassVar[bool] = False  # values are of any size

    source: str = ""
    title: str | None = None
    problem: str | None = None
    run: str = RUN_CASE
    code: str | None = None
    time_limit: Positive = TIME_LIMIT
    memory_limit: Annotated[
        int | None,
        BeforeValidator(_bytes, json_schema_input_type=int | str),
    ] = None
    solve: dict[str, JsonValue] = Field(default={})
    axes: dict[str, Axis] = Field(default={})
    sample: Sample | None = None
    derived: dict[str, str] = Field(default={})
    exclude: Annotated[
        list[str],
        BeforeValidator(_list, json_schema_input_type=str | list[str]),
    ] = Field(default=[])


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


def sweep_schema() -> str:
    """JSON schema of sweep files, for editors."""
    return json_schema(SweepFile)


def load_sweep(path: str | Path) -> SweepPlan:
    """Read a sweep file. Raises ProblemError for what it does not know or cannot use."""
    text = read_text(path)
    tables = tables_of(text, str(path))
    for name, axis in tables["axes"].items() if isinstance(tables.get("axes"), dict) else ():
        for key, value in axis.items() if isinstance(axis, dict) else ():
            if key not in Axis.model_fields and isinstance(value, dict):
                quoted = f'a quoted name where it has dots: [axes."{name}.{key}"]'
                raise ProblemError(str(path), f"axes.{name}.{key}", value, quoted)
    file = validated(SweepFile, tables, str(path))
    try:
        return _plan(file, text)
    except ArgumentError as error:
        raise ProblemError(str(path), error.argument, error.value, error.expected) from None


def _plan(file: SweepFile, text: str) -> SweepPlan:
    run = _run_function(file)
    axes = combined(_axes(file), file.sample)
    columns = with_derived(axes, file.derived, file.exclude)
    if not columns or not len(next(iter(columns.values()))):
        raise ArgumentError("axes", list(file.axes), "axes that leave at least one case")
    table = tabled(columns, run, getattr(run, "content", None))
    if file.problem is not None:
        formulas = [parse("", formula) for formula in (*file.derived.values(), *file.exclude)]
        used = {name for formula in formulas for name in formula.names}
        spare = [name for name in axes if "." not in name and name not in used]
        run.check(table.take(np.array([0])).rows()[0], spare)
    return SweepPlan(
        file.title or Path(file.source).stem,
        run,
        table,
        file.time_limit,
        file.memory_limit,
        file.code,
        text,
    )


def _axes(file: SweepFile) -> dict[str, Axis]:
    """Axes of the file; ``[solve]`` is short for axes ``run.*`` of one value each."""
    try:
        axes = {f"run.{name}": Axis(values=(value,)) for name, value in file.solve.items()}
    except ValidationError:
        raise ArgumentError("solve", file.solve, "values that are finite") from None
    if twice := axes.keys() & file.axes.keys():
        raise ArgumentError("solve", sorted(twice), "each name once, in axes or in solve")
    return {**axes, **file.axes}


def _run_function(file: SweepFile) -> Any:
    """The run function of the file, bound to its problem where it names one."""
    if file.problem is not None:
        bind = function_named("problem", WITH_PROBLEM)
        return bind(function_named("run", file.run), Path(file.source).parent / file.problem)
    if file.run == RUN_CASE:
        raise ArgumentError("problem", None, "problem = 'file.toml', or run = 'module:function'")
    if file.solve:
        raise ArgumentError("solve", file.solve, f"no such table where {RUN_CASE} does not run")
    return function_named("run", file.run)
