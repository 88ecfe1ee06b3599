"""Moving pictures of a run, taken from its page."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from trajopt.errors import ArgumentError, MissingDependencyError
from trajopt.report.viewer.browser import open_page

FRAMES = {".gif": 15, ".mp4": 30}  # a second, chosen: what a page of text can bear, what is smooth
_COLOURS = 128  # of a GIF's palette, chosen
_MOST = 900  # frames; longer motions are played faster, chosen


def record(
    page: FilePath,
    file: FilePath,
    *,
    size: tuple[int, int] = (640, 400),
    camera: str = "whole",
    speed: float = 1.0,
) -> FilePath:
    """Play the motion of ``page`` into ``file`` (*.gif, *.mp4), ``size`` pixels, ``speed`` times as fast as it is.

    Raises ArgumentError for another kind of file, MissingDependencyError without a browser, or for *.mp4 imageio.
    """
    kind = file.suffix.lower()
    if kind not in FRAMES:
        raise ArgumentError("file", str(file), "a name that ends in .gif or .mp4")
    if not speed > 0:
        raise ArgumentError("speed", speed, "a factor > 0")
    frames = _frames(page, size, camera, speed, FRAMES[kind])
    (_write_gif if kind == ".gif" else _write_mp4)(frames, file, FRAMES[kind])
    return file


def _frames(
    page: FilePath, size: tuple[int, int], camera: str, speed: float, rate: int
) -> Iterator[Any]:
    """Pictures of the stage alone, drawn twice as large, so that edges are smooth."""
    from PIL import Image

    with open_page(page, size, scale=2.0) as (shown, _):
        duration = shown.evaluate("view.duration")
        count = max(2, min(_MOST, round(duration / speed * rate) + 1))
        shown.evaluate("view.alone()")
        shown.evaluate(f"view.look({camera!r})")
        for time in np.linspace(0.0, duration, count).tolist():
            shown.evaluate(f"view.frame({time})")
            picture = Image.open(io.BytesIO(shown.screenshot())).convert("RGB")
            yield picture.resize(size, Image.Resampling.LANCZOS)


def _write_gif(frames: Iterator[Any], file: FilePath, rate: int) -> None:
    from PIL import Image

    pictures = list(frames)
    palette = pictures[len(pictures) // 2].quantize(_COLOURS, dither=Image.Dither.NONE)
    small = [p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures]
    waits = [1000 // rate] * (len(small) - 1) + [1500]
    small[0].save(
        file, save_all=True, append_images=small[1:], duration=waits, loop=0, optimize=True
    )


def _write_mp4(frames: Iterator[Any], file: FilePath, rate: int) -> None:
    try:
        import imageio.v2 as imageio
    except ImportError:
        raise MissingDependencyError("imageio", "video", "an MP4") from None
    writer: Any = imageio.get_writer(file, fps=rate, codec="libx264", quality=8, macro_block_size=2)
    with writer:
        for frame in frames:
            writer.append_data(np.asarray(frame))
