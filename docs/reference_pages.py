"""Writes the reference from the code: a page for each room of the package, one of all keys of the
files (from the schemas that the loaders use), one of the command line."""

from __future__ import annotations

import importlib
import json
import pkgutil
from pathlib import Path
from typing import Any

import typer

import trajopt
from trajopt.cli import app as commands

ROOT = Path(__file__).parent.parent
SCHEMAS = {
    "problem files": ROOT / "problems" / "problem.schema.json",
    "robot files": ROOT / "trajopt" / "robots" / "robot.schema.json",
    "sweep files": ROOT / "problems" / "sweeps" / "sweep.schema.json",
}


def write(folder: Path) -> None:
    """All pages, and the index of them."""
    folder.mkdir(exist_ok=True)
    pages = {"package": _package(), "keys": _keys(), "command-line": _command_line()}
    rooms = [room for room in pkgutil.iter_modules(trajopt.__path__) if room.ispkg]
    for room in rooms:
        pages[room.name] = _room(room.name)
    tree = "\n".join(pages)
    pages["index"] = f"# Reference\n\n```{{toctree}}\n:maxdepth: 1\n\n{tree}\n```\n"
    for name, text in pages.items():
        path = folder / f"{name}.md"
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def _package() -> str:
    """What ``import trajopt`` gives."""
    names = "\n".join(f"- `trajopt.{name}`: {_first(name)}" for name in sorted(trajopt.__all__))
    return f"# trajopt\n\n{trajopt.__doc__}\n\n{names}\n"


def _first(name: str) -> str:
    text = getattr(trajopt, name).__doc__ or ""
    return " ".join(text.split("\n\n")[0].split()).replace("``", "`")


def _room(name: str) -> str:
    room = importlib.import_module(f"trajopt.{name}")
    text = f"# trajopt.{name}\n\n{room.__doc__ or ''}\n"
    for found in pkgutil.walk_packages(room.__path__, f"trajopt.{name}."):
        text += f"\n## {found.name}\n\n```{{eval-rst}}\n.. automodule:: {found.name}\n   :members:\n```\n"
    return text


# -- keys


def _keys() -> str:
    text = "# Keys of all files\n\nWritten from the schemas that the loaders use.\n"
    for title, path in SCHEMAS.items():
        schema = json.loads(path.read_text(encoding="utf-8"))
        text += f"\n## Keys of {title}\n\n{_table(schema)}"
        for name, part in sorted(schema.get("$defs", {}).items()):
            if "properties" in part:
                text += f"\n### {_plain(name)} ({title})\n\n{_said(part)}\n\n{_table(part)}"
    return text


def _plain(name: str) -> str:
    return name.removesuffix("Section")


def _said(part: dict[str, Any]) -> str:
    return str(part.get("description", "")).replace("``", "`")


def _table(part: dict[str, Any]) -> str:
    rows = ["| key | what | meaning | default |", "|---|---|---|---|"]
    needed = part.get("required", [])
    for key, value in part.get("properties", {}).items():
        default = "required" if key in needed else f"`{json.dumps(value.get('default'))}`"
        meaning = " ".join(_said(value).split())
        rows.append("| " + " | ".join((f"`{key}`", _kind(value), meaning, default)) + " |")
    return "\n".join(rows) + "\n"


def _kind(value: dict[str, Any]) -> str:
    if "$ref" in value:
        return _plain(value["$ref"].rsplit("/", 1)[-1])
    for several in ("anyOf", "oneOf"):
        if several in value:
            return " or ".join(dict.fromkeys(map(_kind, value[several])))
    if "enum" in value:
        return ", ".join(f"`{name}`" for name in value["enum"])
    if "const" in value:
        return f"`{value['const']}`"
    kind = str(value.get("type", "any"))
    if kind == "array":
        items = value.get("items") or {"type": "number"}
        count = value.get("minItems")
        exactly = f"{count} x " if count and count == value.get("maxItems") else ""
        return f"list of {exactly}{_kind(items)}"
    for key, sign in (("minimum", ">="), ("exclusiveMinimum", ">"), ("maximum", "<=")):
        if key in value:
            kind += f" {sign} {value[key]:g}"
    return kind


# -- command line


def _command_line() -> str:
    return "# Command line\n" + _command(typer.main.get_command(commands), "trajopt", 2)


def _command(command: Any, name: str, level: int) -> str:
    text = f"\n{'#' * min(level, 4)} {name}\n\n{(command.help or '').strip()}\n"
    rows = []
    for option in command.params:
        names = ", ".join(f"`{n}`" for n in (*option.opts, *option.secondary_opts))
        said = " ".join((getattr(option, "help", None) or "").split()).replace("|", "\\|")
        rows.append(f"| {names} | {said} |")
    if rows:
        text += "\n| argument | meaning |\n|---|---|\n" + "\n".join(rows) + "\n"
    for inner in getattr(command, "commands", {}).values():
        text += _command(inner, f"{name} {inner.name}", level + 1)
    return text
