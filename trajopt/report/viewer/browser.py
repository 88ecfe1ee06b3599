"""A page in a browser without a window: for recordings and tests."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path as FilePath
from typing import Any

from trajopt.errors import MissingDependencyError, SimulationError

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
# Graphics by the processor, and no sandbox, which a container's root does not get.
_FLAGS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
_READY = "window.view !== undefined"
_running: list[Any] = []  # the browser of the outermost ``started``
_PATIENCE = 120_000  # ms until a page must be ready, chosen: processors may be busy


def chromium() -> str | None:
    """Where Chromium is installed; None where it is not."""
    return next(filter(None, map(shutil.which, NAMES)), None)


@contextmanager
def started() -> Iterator[Any]:
    """A browser; the one of a ``started`` around this where there is one, for starting it takes longer than a page.

    Raises MissingDependencyError without Playwright or Chromium.
    """
    if _running:
        yield _running[0]
        return
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise MissingDependencyError("playwright", "video", "a browser without a window") from None
    program = chromium()
    if program is None:
        raise MissingDependencyError(
            "chromium (a Debian package)", "video", "a browser without a window"
        )
    with sync_playwright() as play:
        _running.append(play.chromium.launch(executable_path=program, args=list(_FLAGS)))
        try:
            yield _running[0]
        finally:
            _running.pop().close()


@contextmanager
def open_page(
    file: FilePath, size: tuple[int, int], *, scale: float = 1.0, fine: bool = False
) -> Iterator[tuple[Any, list[str]]]:
    """The page, without network, once it is ready; and what its console says. ``scale``: pixels of a picture over those
    of ``size``; ``fine``: smooth edges and shadows although the processor draws.

    Raises MissingDependencyError as ``started``, SimulationError where the page does not start.
    """
    said: list[str] = []
    with started() as browser:
        from playwright.sync_api import Error

        context = browser.new_context(
            viewport={"width": size[0], "height": size[1]}, device_scale_factor=scale, offline=True
        )
        page = context.new_page()
        page.on("console", lambda message: said.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: said.append(f"error: {error}"))
        try:
            page.goto(file.resolve().as_uri() + ("#fine" if fine else ""), timeout=_PATIENCE)
            page.wait_for_function(_READY, timeout=_PATIENCE)
        except Error as error:
            context.close()
            raise SimulationError(f"{file}: the page does not start: {said or error}") from None
        yield page, said
        context.close()
