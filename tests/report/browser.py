"""A real browser for tests: skipped without Chromium on a developer's machine, never in CI."""

from __future__ import annotations

import atexit
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from trajopt.report.viewer.browser import chromium, open_page, started

_kept = ExitStack()
_started: list[Any] = []  # one browser for all tests of a process


@contextmanager
def page_of(file: Path, size: tuple[int, int] = (900, 560)) -> Iterator[Any]:
    """The page, whose console must be silent at the end."""
    need_browser()
    with open_page(file, size) as (page, said):
        yield page
        assert said == []


def need_browser() -> None:
    """Starts the browser that all tests of this process share."""
    if chromium() is None and not os.environ.get("CI"):
        pytest.skip("Chromium is not installed (a Debian package): pages are not looked at")
    if not _started:
        _started.append(_kept.enter_context(started()))
        atexit.register(_kept.close)
