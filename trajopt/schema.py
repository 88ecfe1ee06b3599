"""Strict models of TOML files: reading, changing keys, and errors in one line.

Problem files and robot files go through here. A model is a frozen ``Section`` that refuses keys it
does not know; whatever is wrong becomes a ProblemError that names file, key, value and what would
be right.
"""

from __future__ import annotations

import copy
import difflib
import json
import math
import os
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, ClassVar, TypeVar, Union, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, WrapValidator
from pydantic_core import PydanticCustomError

from trajopt.errors import ProblemError
from trajopt.files import LARGEST, content_of

Model = TypeVar("Model", bound=BaseModel)
SMALLEST = 1e-9  # of what is positive, as ``files.LARGEST``


def _not_tiny(value: float) -> float:
    if 0 < value < SMALLEST:
        raise broken_rule("", value, f"a number of at least {SMALLEST:g}")
    return value


Positive = Annotated[float, Field(gt=0), AfterValidator(_not_tiny)]
NonNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(gt=0, le=1)]
Point = tuple[float, float]
Point3 = tuple[float, float, float]

LARGEST_FILE = 1_000_000  # bytes of a TOML file; chosen, a hundred times the shipped ones
MOST_PARTS = 32  # of a dotted key; chosen, eight times what any file has
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_LONG_KEY = re.compile(rf"(?<![\w-])(?:{_PART}){{{MOST_PARTS}}}")
EVERY = "all"  # as a name in a dotted key: every element of an array of tables


class Section(BaseModel):
    """A table of a file: frozen, finite numbers (of at most LARGEST in size where they are sizes),
    no unknown keys. Validators are built when first used: those of parts never are."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)
    sizes: ClassVar[bool] = True


def broken_rule(key: str, value: Any, expected: str) -> PydanticCustomError:
    """A broken rule of a section; carried through pydantic to become a ProblemError."""
    return PydanticCustomError(
        "trajopt_rule", "{expected}", {"key": key, "given": value, "expected": expected}
    )


def _one_or_each(value: Any, read: Any) -> Any:
    """Errors of a union would name its members; strictly, a list is no tuple."""
    try:
        return read(tuple(value) if isinstance(value, list) else value)
    except ValidationError:
        raise broken_rule("", value, "a number > 0, or an array of them") from None


OneOrEach = Annotated[
    Positive | Annotated[tuple[Positive, ...], Field(min_length=1)], WrapValidator(_one_or_each)
]


def as_problem_error(error: PydanticCustomError, file: str) -> ProblemError:
    """A broken rule that was met outside of validation."""
    rule = error.context or {}
    return ProblemError(file, rule["key"], rule["given"], rule["expected"])


def read_text(path: str | Path) -> str:
    """Text of a file, at most LARGEST_FILE bytes of it. Raises ProblemError."""
    try:
        return content_of(path, LARGEST_FILE).decode()
    except FileNotFoundError:
        raise ProblemError(str(path), "file", "missing", "an existing file (*.toml)") from None
    except UnicodeDecodeError as error:
        raise ProblemError(str(path), "file", str(error), "valid TOML in UTF-8") from None
    except (OSError, TypeError, ValueError) as error:
        raise ProblemError(str(path), "file", str(error), "a readable file (*.toml)") from None


def tables_of(text: str, file: str) -> dict[str, Any]:
    """Tables of TOML text. Raises ProblemError."""
    if _LONG_KEY.search(text):  # tomllib's time grows with the square of a key's parts
        raise ProblemError(file, "file", "a longer key", f"keys of at most {MOST_PARTS} parts")
    try:
        return tomllib.loads(text.replace("\r\n", "\n"))
    except RecursionError:
        raise ProblemError(file, "file", "deeper nesting", "tables nested less deep") from None
    except ValueError as error:  # no TOML, or numbers that are no numbers
        raise ProblemError(file, "file", str(error), "valid TOML in UTF-8") from None


def read_tables(path: str | Path, overrides: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Tables of a TOML file with ``overrides`` (dotted keys) applied. Raises ProblemError."""
    data = tables_of(read_text(path), str(path))
    for key, value in changes_of(overrides, str(path)):
        set_key(data, key, value, str(path))
    return data


def changes_of(overrides: Mapping[str, Any] | None, file: str) -> list[tuple[str, Any]]:
    """Dotted keys and their values. Raises ProblemError for what is no mapping of texts."""
    if overrides is None:
        return []
    if not isinstance(overrides, Mapping) or not all(isinstance(key, str) for key in overrides):
        raise ProblemError(file, "overrides", overrides, "dotted keys and their values")
    return list(overrides.items())


def set_key(data: dict[str, Any], dotted: str, value: Any, file: str) -> None:
    """Set a nested key, making tables on the way; None takes it out.

    An element of an array of tables is named by its ``name``, by its number from 0, or by ``all``.
    Unknown names of keys are left to validation. Raises ProblemError for a key below no table.
    """
    *parents, last = dotted.split(".")
    if len(parents) >= MOST_PARTS:
        raise ProblemError(file, dotted, value, f"a key of at most {MOST_PARTS} parts")
    for table in _tables(data, parents, dotted, value, file):
        if value is None:
            table.pop(last, None)
        else:
            table[last] = copy.deepcopy(value)  # never the caller's own tables


def _tables(
    table: Any, keys: list[str], dotted: str, value: Any, file: str
) -> Iterator[dict[str, Any]]:
    for depth, key in enumerate(keys):
        table = table.setdefault(key, {}) if isinstance(table, dict) else table
        if isinstance(table, (list, tuple)) and depth + 1 <= len(keys):
            rest = keys[depth + 1 :]
            yield from _elements(table, rest, dotted, value, file)
            return
        if not isinstance(table, dict):
            none = ".".join(keys[: depth + 1])
            raise ProblemError(file, dotted, value, f"a key below a table ({none} is none)")
    yield table


def _elements(
    array: Any, rest: list[str], dotted: str, value: Any, file: str
) -> Iterator[dict[str, Any]]:
    """Tables below the elements of an array of tables that the first of ``rest`` chooses."""
    names = [e.get("name", str(i)) if isinstance(e, dict) else str(i) for i, e in enumerate(array)]
    chosen = [
        element
        for i, element in enumerate(array)
        if rest and rest[0] in (EVERY, names[i], str(i)) and isinstance(element, dict)
    ]
    if not chosen:
        raise ProblemError(
            file, dotted, value, f"one of {', '.join([EVERY, *names])} after the array's name"
        )
    for element in chosen:
        yield from _tables(element, rest[1:], dotted, value, file)


def validated(model: type[Model], data: Mapping[str, Any], file: str) -> Model:
    """``data`` as a model with its ``source`` set. Raises ProblemError in one line."""
    if "source" in data:
        raise ProblemError(file, "source", data["source"], "no such key: it is set by the loader")
    try:
        if getattr(model, "sizes", False):
            _require_sizes(data, (), file)
        # Through JSON, because only there does strict mode take arrays for tuples.
        text = json.dumps({**data, "source": file}, default=_as_json)
        return model.model_validate_json(text, strict=True)
    except ValidationError as error:
        raise translated(error, file, model) from None
    except (RecursionError, TypeError, ValueError) as error:
        if isinstance(error, ProblemError):
            raise
        raise ProblemError(file, "file", str(error), "tables of plain values") from None


def _require_sizes(value: Any, place: tuple[int | str, ...], file: str) -> None:
    if isinstance(value, Mapping):
        for name, part in value.items():
            _require_sizes(part, (*place, str(name)), file)
    elif isinstance(value, (list, tuple)):
        for i, part in enumerate(value):
            _require_sizes(part, (*place, i), file)
    elif isinstance(value, (int, float)) and LARGEST < abs(value) < math.inf:
        raise ProblemError(file, _joined(place), value, f"a number of at most {LARGEST:g} in size")


def translated(error: ValidationError, file: str, model: type[BaseModel]) -> ProblemError:
    """One line for the first finding, in the words of the files."""
    first = error.errors()[0]
    place = [str(part) for part in first["loc"]]
    if first["type"] == "trajopt_rule":
        context = first["ctx"]
        key = ".".join(part for part in (_joined(first["loc"]), context["key"]) if part)
        key = key.replace(".[", "[")
        return ProblemError(file, key, context["given"], context["expected"])
    key = _joined(first["loc"])
    if first["type"] == "extra_forbidden":
        known = known_keys(place[:-1], model)
        near = difflib.get_close_matches(place[-1], known, n=1, cutoff=0.0)
        return ProblemError(file, key, first["input"], f"a known key; the nearest is '{near[0]}'")
    if first["type"] == "missing":
        return ProblemError(file, key, "missing", "this key to be given")
    message = first["msg"].removeprefix("Input should be ").replace("a valid array", "an array")
    message = message.replace("an object", "a table")  # what JSON calls an object
    if first["type"] == "too_long":
        message = (
            f"at most {first['ctx']['max_length']} values, not {first['ctx']['actual_length']}"
        )
    return ProblemError(file, key, first["input"], message[0].lower() + message[1:])


def json_schema(model: type[BaseModel]) -> str:
    """JSON schema of a kind of file, for editors."""
    schema = model.model_json_schema()
    schema["properties"].pop("source", None)
    return json.dumps(schema, indent=2) + "\n"


def known_keys(section: list[str], whole: type[BaseModel]) -> list[str]:
    """Keys of the section at a place of a file; numbers are elements of arrays of tables, and the
    ``kind`` of a union of models its tag."""
    models: list[Any] = [whole]
    for name in section:
        tagged = [m for m in models if name in _tags(m)]
        fields = {f.alias or key: f for key, f in models[0].model_fields.items()}
        if tagged:
            models = tagged
        elif name in fields:
            models = list(_models(fields[name].annotation)) or models
    known = models[0].model_fields
    return [f.alias or key for key, f in known.items() if key != "source"]


def _tags(model: Any) -> tuple[Any, ...]:
    kind = model.model_fields.get("kind")
    return get_args(kind.annotation) if kind else ()


def _models(annotation: Any) -> Iterator[Any]:
    """The models in an annotation: of an optional section, an array of them, a union."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    elif get_origin(annotation) in (tuple, dict, Union, UnionType, Annotated):
        for part in get_args(annotation):
            yield from _models(part)


def _as_json(value: Any) -> Any:
    """NumPy values, sections and paths as JSON. Raises TypeError for anything else."""
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", exclude_none=True, by_alias=True)
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"{value} is a {type(value).__name__}")


def _joined(location: tuple[int | str, ...]) -> str:
    text = ""
    for part in location:
        if isinstance(part, int):
            text += f"[{part}]"
            continue
        part = part if re.fullmatch(r"[\w-]+", part) else json.dumps(part, ensure_ascii=False)
        text += f".{part}" if text else part
    return text
