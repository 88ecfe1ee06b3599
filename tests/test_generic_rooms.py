"""Rooms that serve any robot name none, but for one line a system in a registry."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NAMES = re.compile(r"loc8|powerbot|asoc|smdw", re.IGNORECASE)
REGISTRY = re.compile(r"""^ *("[a-z]+": )?"trajopt\.systems\.[a-z0-9_.:]+",$""")


@pytest.mark.parametrize("room", ["sweeps", "bench", "report", "case.py"])
def test_no_robot_is_named(room: str) -> None:
    place = ROOT / "trajopt" / room
    named = [
        f"{file.name}:{number}: {line}"
        for file in (sorted(place.rglob("*.py")) if place.is_dir() else [place])
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1)
        if NAMES.search(line) and not REGISTRY.match(line)
    ]
    assert not named, "\n".join(named)
