"""Writing files so that a reader never meets half of one."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from trajopt.errors import ArgumentError
from trajopt.files import LARGEST_TABLE, content_of, seal, unseal, whole_file
from trajopt.robots.robot import Robot

FORMATS = ("png", "pdf", "svg")  # of pictures
FORMAT = 3  # of run folders; a reader of another number refuses


def write_text(file: FilePath, text: str) -> None:
    """As ``write_bytes``, in UTF-8."""
    write_bytes(file, text.encode("utf-8"))


def write_bytes(file: FilePath, content: bytes) -> None:
    """Write under a temporary name in the same folder, then rename."""
    with whole_file(file) as part:
        part.write_bytes(content)


def write_json(file: FilePath, content: dict[str, Any]) -> None:
    """Write JSON, indented; numbers that are not finite become null."""
    write_text(file, json_text(content))


def json_text(content: Mapping[str, Any]) -> str:
    """JSON, indented; numbers that are not finite become null."""
    return json.dumps(finite(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def write_sealed(file: FilePath, content: dict[str, Any]) -> None:
    """As ``write_json``, with a checksum as the last key."""
    write_text(file, seal(finite(content)))


def write_table(file: FilePath, columns: Mapping[str, Any]) -> None:
    """Write columns of equal length as CSV, every bit of their numbers; NaN is an empty field."""
    lists = [np.asarray(column).tolist() for column in columns.values()]
    fields = [["" if value != value or value is None else value for value in c] for c in lists]
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(columns)
    rows.writerows(zip(*fields, strict=True))
    write_text(file, text.getvalue())


def read_sealed(file: FilePath, version: int) -> dict[str, Any]:
    """What ``write_sealed`` wrote, with that ``format``. Raises ArgumentError for a file that is
    missing or holds something else, DamageError for one that was changed."""
    try:
        text = content_of(file, LARGEST_TABLE)
        content = json.loads(text)
    except (FileNotFoundError, NotADirectoryError):
        raise ArgumentError(
            "folder", str(file.parent), f"a folder with {file.name}, written by solve --out"
        ) from None
    except (OSError, ValueError, RecursionError) as error:
        raise ArgumentError(str(file), str(error), "valid JSON, as solve --out writes it") from None
    found = content.get("format") if isinstance(content, dict) else None
    if found != version:
        expected = f"format = {version}; solve the problem again for a folder of this version"
        raise ArgumentError(str(file), found, expected)
    return unseal(text, str(file))


def finite(value: Any) -> Any:
    """The same content in JSON's types, with None for numbers that are not finite."""
    if isinstance(value, Mapping):
        return {str(key): finite(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(part) for part in value]
    if hasattr(value, "tolist"):  # NumPy arrays and scalars
        return finite(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def made_folder(folder: str | FilePath) -> FilePath:
    """The folder, made if needed. Raises ArgumentError where a file is in the way."""
    place = FilePath(folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise ArgumentError(
            "folder", str(folder), "a folder, or a name that is not taken by a file"
        ) from None
    except PermissionError:
        raise ArgumentError("folder", str(folder), "a folder that you may write to") from None
    return place


def as_toml(table: dict[str, Any]) -> str:
    """TOML text of nested tables with strings, booleans, numbers and arrays (inline where they hold
    tables)."""
    return "\n".join(_lines(table, ())).strip() + "\n"


def _lines(table: dict[str, Any], place: tuple[str, ...]) -> list[str]:
    values = [f"{_key(k)} = {toml_value(v)}" for k, v in table.items() if not isinstance(v, dict)]
    head = (
        ["", f"[{'.'.join(_key(part) for part in place)}]"]
        if place and (values or not table)
        else []
    )
    nested = [
        line for k, v in table.items() if isinstance(v, dict) for line in _lines(v, (*place, k))
    ]
    return [*head, *values, *nested]


def _key(name: str) -> str:
    bare = name and all(c.isascii() and (c.isalnum() or c in "-_") for c in name)
    return name if bare else toml_value(name)


def robot_toml(robot: Robot) -> str:
    """The file of a robot, with an array of tables a kind of part."""
    tables = robot.description.model_dump(mode="json", exclude_defaults=True)
    arrays = {key: tables.pop(key, []) for key in ("wheels", "pivots", "motors", "steering")}
    lines = [as_toml(tables)]
    for key, parts in arrays.items():
        for part in parts:
            values = [f"{name} = {toml_value(value)}" for name, value in part.items()]
            lines.append("\n".join([f"[[{key}]]", *values, ""]))
    return "\n".join(lines)


def toml_value(value: Any) -> str:
    """TOML of a value in one line, tables inline."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):  # JSON's escapes are TOML's, but for DEL
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml_value(part) for part in value) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(k)} = {toml_value(v)}" for k, v in value.items()) + " }"
    raise ArgumentError("value", value, "a string, boolean, number, array or table")


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a Markdown table."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return lines + ["| " + " | ".join(row) + " |" for row in rows]
