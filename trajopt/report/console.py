"""The console that the command line prints on."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.text import Text

from trajopt.errors import printable
from trajopt.report.words import SPARED


class PlainConsole(Console):
    """A console that reads no markup in texts, highlights nothing, and shows control characters as
    escapes; ``words`` brings styles."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, highlight=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """Text of a string, as ``print`` and tables show it."""
        options |= {"markup": False, "emoji": False, "highlight": False}
        return super().render_str(printable(text, SPARED), **options)
