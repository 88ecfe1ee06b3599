"""A page of about 800 bodies and 10 s of motion: its size, how fast it opens, and how fast it plays where the processor
draws.

Run from the repository on an idle machine: ``python -m benchmarks.page_speed``. Needs Chromium and Playwright.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any

from benchmarks.common import ResultTable, publish
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.speed import Speed
from trajopt.paths.path import Path as Way
from trajopt.report.viewer.browser import open_page
from trajopt.report.viewer.motion import planned
from trajopt.report.viewer.motion_page import view_data
from trajopt.report.viewer.pages import write_page
from trajopt.robots.robot import Robot
from trajopt.timing.scaling import time_scale
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

SIZE = (640, 400)
SECONDS = 6.0  # for which it plays
# Frames in a row, each waited for, ms: of the page's script alone, and until it is drawn.
FRAMES = """(count) => {
  const gl = document.querySelector("canvas").getContext("webgl2"), pixel = new Uint8Array(4);
  const wait = () => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  wait();
  let script = 0;
  const begin = performance.now();
  for (let i = 0; i < count; i++) {
    const before = performance.now();
    view.frame((view.duration * i) / count);
    script += performance.now() - before;
    wait();
  }
  return [script / count, (performance.now() - begin) / count];
}"""


def many_bodies(file: Path) -> int:
    """Write the page of a robot of 13 wheels with 60 rollers each, planned and driven, 10 s; how many bodies it has."""
    robot = Robot.omni(
        name="many", mass=60.0, cog=(0.0, 0.0, 0.2), chassis=(0.8, 0.8, 0.2), clearance=0.1, count=13,
        distance=0.6, radius=0.1, width=0.04, wheel_mass=1.5, torque=3.0, rollers=60, roller_radius=0.006,
    )  # fmt: skip
    path = Way.through(
        [[0.0, 0.0], [2.2, 0.6], [4.4, 0.0]], heading=[0.0, 1.0, 0.5], turning_length=0.5
    )
    trajectory = time_scale(path, [Speed(0.5), Acceleration(0.5, 0.5)], robot=robot)
    motions = [planned(trajectory), planned(trajectory, "driven")]
    data = view_data(robot, Scene(0.6, Flat()), motions, "many bodies", "", trajectory)
    write_page("motion", data, file)
    return len(data["robot"]["parents"])


def measure(file: Path) -> dict[str, Any]:
    """Seconds until all is built; script and whole time of a frame, ms; frames a second while it plays."""
    before = perf_counter()
    with open_page(file, SIZE) as (page, said):
        ready = perf_counter() - before
        opened = page.evaluate("view.opened")
        script, whole = page.evaluate(FRAMES, 30)
        page.evaluate("""() => {
          window.drawn = 0;
          const draw = view.player.draw.bind(view.player);
          view.player.draw = () => { window.drawn++; draw(); };
          view.player.set(0);
        }""")
        begin = page.evaluate("(view.player.toggle(), performance.now())")
        page.wait_for_timeout(1e3 * SECONDS)
        frames, now = page.evaluate("[window.drawn, performance.now()]")
        if said:
            raise SystemExit(f"the page's console says {said}")
    return {
        "browser and page": ready, "opened": opened, "script": script, "whole": whole,
        "rate": 1e3 * frames / (now - begin),
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=3, help="times the page is opened")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "view.html"
        bodies = many_bodies(file)
        size = file.stat().st_size
        found = [measure(file) for _ in range(options.repeats)]
    header = ("bodies (two robots)", "page, MB", "open, s", "frame: script, ms", "frame: drawn, ms", "frames/s playing")  # fmt: skip
    rows = [
        (
            f"2 x {bodies}", f"{size / 1e6:.2f}", f"{one['opened']:.2f}", f"{one['script']:.1f}",
            f"{one['whole']:.1f}", f"{one['rate']:.1f}",
        )
        for one in found
    ]  # fmt: skip
    title = f"A page in Chromium without graphics card, {SIZE[0]} x {SIZE[1]}"
    publish("page_speed", [ResultTable(title, header, rows)], packages=["playwright"])


if __name__ == "__main__":
    main()
