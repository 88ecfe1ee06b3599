"""Printing on a terminal: names and messages of others appear as they are, whatever they hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

from trajopt.errors import printable

if TYPE_CHECKING:
    from rich.text import Text

SPARED = "\n\t"


def words(*parts: str | tuple[str, str]) -> Text:
    """Text of parts, each with a style where it is a pair; no markup, no control characters."""
    from rich.text import Text  # takes as long to load as a short command

    pairs = [part if isinstance(part, tuple) else (part, "") for part in parts]
    return Text.assemble(*((printable(text, SPARED), style) for text, style in pairs))
