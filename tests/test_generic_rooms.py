"""Rooms that serve any robot name none, but for one line a system in a registry."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NAMES = re.compile(r"loc8|powerbot|asoc|smdw", re.IGNORECASE)
REGISTRY = re.compile(r'^[^"]*("[a-z]+": )?"trajopt\.systems\.[a-z0-9_.:]+"')
PACKAGE = ROOT / "trajopt"
ROOMS = sorted(
    place.name
    for place in PACKAGE.iterdir()
    if place.name != "systems" and (place.suffix == ".py" or (place / "__init__.py").exists())
)


@pytest.mark.parametrize("room", ROOMS)
def test_no_robot_is_named(room: str) -> None:
    place = PACKAGE / room
    named = [
        f"{file.name}:{number}: {line}"
        for file in (sorted(place.rglob("*.py")) if place.is_dir() else [place])
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1)
        if NAMES.search(line) and not REGISTRY.match(line)
    ]
    assert not named, "\n".join(named)


@pytest.mark.parametrize("file", sorted(PACKAGE.rglob("__init__.py")), ids=lambda f: f.parent.name)
def test_every_room_says_what_is_in_it(file: Path) -> None:
    assert ast.get_docstring(ast.parse(file.read_text(encoding="utf-8")))
