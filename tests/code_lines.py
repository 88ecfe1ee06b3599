"""Counts lines of code of Python files: without blank lines, comments and docstrings (`make
lines`)."""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from pathlib import Path

_NO_CODE = (
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
)


def code_lines(source: str) -> int:
    """How many lines of ``source`` hold code."""
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in _NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(source)):
        body = getattr(node, "body", None)
        if not isinstance(body, list):
            continue
        for statement in body:
            value = statement.value if isinstance(statement, ast.Expr) else None
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                lines.difference_update(range(statement.lineno, (statement.end_lineno or 0) + 1))
    return len(lines)


def main() -> None:
    """Prints a line a folder of each argument, and the sum."""
    for root in map(Path, sys.argv[1:]):
        counts: dict[str, int] = {}
        for file in sorted(root.rglob("*.py")):
            room = file.relative_to(root).parts[0].removesuffix(".py")
            counts[room] = counts.get(room, 0) + code_lines(file.read_text(encoding="utf-8"))
        for room, count in counts.items():
            print(f"{count:7d}  {root}/{room}")
        print(f"{sum(counts.values()):7d}  {root}")


if __name__ == "__main__":
    main()
