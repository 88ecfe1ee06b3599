"""A real browser for tests: skipped without Chromium on a developer's machine, never in CI."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from trajopt.report.viewer.browser import chromium, open_page


@contextmanager
def page_of(file: Path, size: tuple[int, int] = (900, 560)) -> Iterator[Any]:
    """The page, whose console must be silent at the end."""
    if chromium() is None and not os.environ.get("CI"):
        pytest.skip("Chromium is not installed (a Debian package): pages are not looked at")
    with open_page(file, size) as (page, said):
        yield page
        assert said == []
