"""Data into a built page."""

from __future__ import annotations

import base64
import json
from importlib.resources import files
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from trajopt.report.files import finite, write_text

PAGES = "trajopt.report.viewer"
_DATA = "{{data}}"  # where a built page has its data


def packed(values: ArrayLike) -> dict[str, str]:
    """Numbers as the pages unpack them: float32, base64; rows one after the other."""
    raw = np.ascontiguousarray(values, dtype="<f4").tobytes()
    return {"f32": base64.b64encode(raw).decode("ascii")}


def write_page(kind: str, data: dict[str, Any], file: FilePath) -> FilePath:
    """Write the page called ``kind`` with its data into ``file``, whole or not at all; its path."""
    text = json.dumps(finite(data), ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    page = (files(PAGES) / "pages" / f"{kind}.html").read_text(encoding="utf-8")
    before, _, after = page.partition(_DATA)
    write_text(file, before + text.replace("<", "\\u003c") + after)
    return file
