"""``trajopt view``: a run in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from trajopt.cli.shared import Force, console, require_free
from trajopt.errors import ArgumentError


def view(
    folder: Annotated[
        Path,
        typer.Argument(
            help="folder written by solve --out, or the store of a sweep", show_default=False
        ),
    ],
    value: Annotated[
        str | None, typer.Option(help="of a sweep: the column that heat maps show first")
    ] = None,
    open_: Annotated[bool, typer.Option("--open/--no-open", help="open the page")] = True,
    gif: Annotated[Path | None, typer.Option("--gif", help="record it into this file")] = None,
    mp4: Annotated[Path | None, typer.Option("--mp4", help="record it into this file")] = None,
    camera: Annotated[
        str, typer.Option(help="of a recording: whole, above, side, chase, wheel")
    ] = "whole",
    speed: Annotated[float, typer.Option(help="of a recording, over the motion's own")] = 1.0,
    size: Annotated[tuple[int, int], typer.Option(help="of a recording, pixels")] = (640, 400),
    force: Force = False,
) -> None:
    """Write view.html, which shows a run or a sweep without network or server; open or record it."""
    import webbrowser

    from trajopt.report.run_folder import read_solution
    from trajopt.report.viewer.motion_page import write_view
    from trajopt.report.viewer.record import record

    require_free("--gif", gif, force)
    require_free("--mp4", mp4, force)
    page = None
    if (folder / "store.json").exists():
        from trajopt.report.viewer.sweep_page import write_sweep_page

        if gif or mp4:
            raise ArgumentError("--gif, --mp4", str(folder), "a run folder: a sweep does not move")
        page = write_sweep_page(folder, folder / "view.html", value=value)
    elif value is not None:
        raise ArgumentError("--value", value, "none but with the store of a sweep")
    else:
        solution = read_solution(folder)
        page = write_view(solution, folder)
        if page is None:
            raise ArgumentError("folder", str(folder), "a run with a motion; " + solution.status)
    console.print(f"written to {page}", highlight=False, soft_wrap=True)
    for file, kind in ((gif, ".gif"), (mp4, ".mp4")):
        if file is not None:
            if file.suffix.lower() != kind:
                raise ArgumentError(f"--{kind[1:]}", str(file), f"a name that ends in {kind}")
            record(page, file, size=size, camera=camera, speed=speed)
            console.print(f"written to {file}", highlight=False, soft_wrap=True)
    if open_ and gif is None and mp4 is None:
        webbrowser.open(page.resolve().as_uri())
