"""How Sphinx builds the site: `make docs`. The reference is written anew from the code each time."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parent))
import reference_pages

project = "trajopt"
author = "the authors of trajopt"
project_copyright = author
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "sphinx_copybutton"]
html_theme = "furo"
html_title = "trajopt"
myst_heading_anchors = 3
myst_enable_extensions = ["dollarmath"]
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
toc_object_entries = False
suppress_warnings = ["ref.python"]  # several rooms have a Motion


def _as_written(*event: Any) -> None:
    """Bars and stars in docstrings, whose lines come last, are absolute values and products."""
    lines = event[-1]
    for i, line in enumerate(lines):
        parts = re.split("(``.*?``)", line)
        lines[i] = "".join(p if p[:2] == "``" else re.sub(r"([|*])", r"\\\1", p) for p in parts)


def setup(app: Sphinx) -> None:
    """Write the reference before sources are read."""
    app.connect("builder-inited", lambda app: reference_pages.write(Path(app.srcdir) / "reference"))
    app.connect("autodoc-process-docstring", _as_written)
