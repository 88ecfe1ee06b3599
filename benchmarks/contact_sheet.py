"""Every figure of the project on one sheet, to be looked at: ``python -m benchmarks.contact_sheet`` writes
out/contact_sheet.png, and each figure beside it.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from PIL import Image, ImageDraw

from benchmarks.common import ROOT
from benchmarks.figure_examples import FIGURES
from trajopt.report.files import FORMATS
from trajopt.report.style import in_style, save_figure

WIDE, HIGH, COLUMNS = 560, 460, 6  # pixels of a cell, chosen


def draw_all(folder: Path, kind: str) -> list[Path]:
    """Write every example into ``folder``; the files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name, draw in FIGURES.items():
        with in_style():
            files.append(save_figure(draw(), folder / f"{name.replace(' ', '_')}.{kind}"))
    return files


def sheet(files: list[Path], out: Path) -> None:
    """All pictures in rows, with their names."""
    page = Image.new("RGB", (COLUMNS * WIDE, math.ceil(len(files) / COLUMNS) * HIGH), "white")
    pen = ImageDraw.Draw(page)
    for k, file in enumerate(files):
        x, y = k % COLUMNS * WIDE, k // COLUMNS * HIGH
        with Image.open(file) as picture:
            small = picture.convert("RGB")
        small.thumbnail((WIDE - 16, HIGH - 36), Image.Resampling.LANCZOS)
        page.paste(small, (x + 8, y + 24))
        pen.text((x + 8, y + 6), file.stem.replace("_", " "), fill="#444444")
    page.save(out)


def main() -> None:
    parser = argparse.ArgumentParser(description="A contact sheet of all figures.")
    parser.add_argument("--format", choices=FORMATS, default="png", help="of the single figures")
    parser.add_argument("--out", type=Path, default=ROOT / "out", help="folder")
    options = parser.parse_args()
    files = draw_all(options.out / "figures", options.format)
    print(f"wrote {len(files)} figures into {options.out / 'figures'}")
    if options.format == "png":
        sheet(files, options.out / "contact_sheet.png")
        print(f"wrote {options.out / 'contact_sheet.png'}")


if __name__ == "__main__":
    main()
