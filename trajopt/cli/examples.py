"""``trajopt examples``: problems and scripts to start from."""

from __future__ import annotations

import ast
import shutil
import tomllib
from pathlib import Path
from typing import Annotated

import typer

from trajopt.cli.shared import Force, console, simple_table
from trajopt.errors import ArgumentError
from trajopt.report.words import words

_PACKAGE = Path(__file__).parents[1]
_FOLDERS = ("problems", "docs/examples")


def shipped() -> Path:
    """The folder that holds ``problems`` and ``docs/examples``: in the installed package, or the
    checkout."""
    inside = _PACKAGE / "shipped"
    return inside if inside.is_dir() else _PACKAGE.parent


def examples(
    out: Annotated[
        Path | None, typer.Option("--out", help="copy all of them into this folder")
    ] = None,
    force: Force = False,
) -> None:
    """List the problems and scripts that come along, or copy them."""
    root = shipped()
    if out is None:
        table = simple_table()
        for column in ("file", "about"):
            table.add_column(column)
        for file in sorted(file for folder in _FOLDERS for file in (root / folder).rglob("*.*")):
            if about := _about(file):
                table.add_row(words(str(file.relative_to(root))), words(about))
        console.print(table)
        return
    there = [folder for folder in _FOLDERS if (out / folder).exists()]
    if there and not force:
        expected = f"a folder without {' and '.join(there)}, or --force"
        raise ArgumentError("--out", str(out), expected)
    for folder in _FOLDERS:
        skipped = shutil.ignore_patterns("__pycache__")
        shutil.copytree(root / folder, out / folder, ignore=skipped, dirs_exist_ok=True)
    console.print(f"written to {out}", soft_wrap=True)


def _about(file: Path) -> str:
    """What a problem or a script says of itself."""
    text = file.read_text(encoding="utf-8") if file.suffix in (".toml", ".py") else ""
    if file.suffix == ".toml":
        return str(tomllib.loads(text).get("title", ""))
    return (ast.get_docstring(ast.parse(text)) or "") if text else ""
