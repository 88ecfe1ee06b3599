"""Files that are whole or not there, and checksums: damage is noticed, not read."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from trajopt.errors import TrajoptError

_KEY = "checksum"  # the key of sealed JSON that the checksum of all others stands under


class DamageError(TrajoptError):
    """A file does not hold what was written."""


@contextmanager
def whole_file(file: Path) -> Iterator[Path]:
    """A name beside ``file`` to write under, with the same suffix: becomes ``file`` when all is
    written, and goes where that fails."""
    part = file.with_name(f".part-{os.getpid()}-{file.name}")
    try:
        yield part
        os.replace(part, file)
    finally:
        part.unlink(missing_ok=True)


def file_name(name: str) -> str:
    """A name for a file out of any text, in no other folder: other characters than letters, digits,
    ``_``, ``-`` and ``.`` become ``_``, and a checksum tells such names apart.

    >>> file_name("track"), file_name("../track")
    ('track', '_.._track-87273933')
    """
    plain = re.sub(r"[^\w.-]", "_", name)[:100]
    if plain == name and not plain.startswith("."):
        return name
    return f"_{plain}-{digest(name.encode(errors='backslashreplace'))[:8]}"


def digest(data: bytes) -> str:
    """Checksum of bytes: the first 32 hexadecimal digits of their SHA-256."""
    return hashlib.sha256(data).hexdigest()[:32]


def seal(content: Mapping[str, Any]) -> str:
    """JSON text of ``content`` with a checksum over it as the last key.

    >>> unseal(seal({"a": 1}), "file")
    {'a': 1}
    """
    return json.dumps({**content, _KEY: digest(_plain(content))}, indent=2) + "\n"


def unseal(text: str | bytes, file: str) -> dict[str, Any]:
    """The content of sealed JSON; ``file`` is its name for the message. Raises DamageError."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DamageError(f"{file}: damaged: not readable as JSON ({error})") from None
    if not isinstance(found, dict) or _KEY not in found:
        raise DamageError(f"{file}: damaged: a JSON object with the key '{_KEY}' is expected")
    if found.pop(_KEY) != digest(_plain(found)):
        raise DamageError(f"{file}: damaged: its content does not match its checksum")
    return found


def _plain(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, sort_keys=True).encode()
