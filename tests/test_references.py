"""Each source that is cited stands in REFERENCES.md, and nothing cites a file that is not here."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LIST = ROOT / "REFERENCES.md"
KINDS = (".py", ".md", ".toml", ".json")
# An author and a year; sources without one are found from the list's side.
KEY = re.compile(r"\[([a-z]+[0-9]{4}[a-z]?)\]")
# Documents of the project's beginnings, and sources by number instead of key.
ABSENT = re.compile(
    r"\b(?i:thesis|lecture)\s+(?:# )?00\d|\bSOURCES 0|\b(SOURCES|DESIGN|TARGETS)(\.md|: )|\(DESIGN\)"
)


def texts() -> dict[Path, str]:
    """Everything written here that could cite: files that git keeps, or all outside git."""
    told = subprocess.run(
        ["git", "-C", str(ROOT), "ls-files"], capture_output=True, text=True, check=False
    )
    names = told.stdout.splitlines() if told.returncode == 0 else []
    folders = ("trajopt", "tests", "benchmarks", "problems", "docs")
    files = [ROOT / n for n in names] or [
        *ROOT.glob("*.md"),
        *(f for d in folders for f in (ROOT / d).rglob("*")),
    ]
    return {
        file.relative_to(ROOT): file.read_text(encoding="utf-8")
        for file in files
        if file.suffix in KINDS and file.is_file() and file not in (LIST, Path(__file__))
    }


@pytest.fixture(scope="module")
def sources() -> dict[str, str]:
    """Entries of the list by key."""
    rows = re.findall(r"^\| \[([a-z0-9-]+)\] \| (.*) \|$", LIST.read_text(encoding="utf-8"), re.M)
    assert len(rows) == len(dict(rows)), "a key twice"
    return dict(rows)


def test_every_key_is_in_the_list(sources):
    unknown = {
        f"{file}: [{key}]"
        for file, text in texts().items()
        for key in KEY.findall(text)
        if key not in sources
    }
    assert not unknown


def test_every_entry_is_cited_and_has_title_and_year(sources):
    written = "\n".join(texts().values())
    for key, entry in sources.items():
        assert re.search(rf"\[([a-z0-9-]+, )*{key}(, [a-z0-9-]+)*\]", written), key
        assert re.search(r"\*[^*]+\*", entry), key
        assert re.search(r"\b(19|20)\d\d\b|no date", entry), key
        year = re.search(r"[a-z](\d{4})$", key)
        assert year is None or year[1] in entry, key


def test_nothing_cites_what_is_not_here():
    found = {
        f"{file}: {match.group()}"
        for file, text in texts().items()
        for match in ABSENT.finditer(text)
    }
    assert not found
