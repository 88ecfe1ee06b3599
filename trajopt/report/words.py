"""Printing on a terminal: names and messages of others appear as they are, whatever they hold."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.text import Text

from trajopt.errors import printable

_SPARED = "\n\t"


def words(*parts: str | tuple[str, str]) -> Text:
    """Text of parts, each with a style where it is a pair; no markup, no control characters."""
    pairs = [part if isinstance(part, tuple) else (part, "") for part in parts]
    return Text.assemble(*((printable(text, _SPARED), style) for text, style in pairs))


class PlainConsole(Console):
    """A console that reads no markup in texts, highlights nothing, and shows control characters as
    escapes; ``words`` brings styles."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, highlight=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """Text of a string, as ``print`` and tables show it."""
        options |= {"markup": False, "emoji": False, "highlight": False}
        return super().render_str(printable(text, _SPARED), **options)
