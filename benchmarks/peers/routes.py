"""Routes of least time against two stages: a short smooth path, then its fastest motion.

Run as ``python -m benchmarks.peers.routes``. Every map of ``benchmarks/routes/scenes.py`` and every
robot: the two stages (least length and 0.1 times the integral of squared curvature, best of the same
ways around, exact time scaling), the one program from there, the better of both, processor seconds to
the first route and to the end, and the outline's least distance by a check of its own.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.common import ResultTable, publish
from benchmarks.routes.check import independent_clearance
from benchmarks.routes.scenes import SCENES, Tables, grid
from trajopt.pipeline import solve
from trajopt.problem import Problem

ROBOTS = ("powerbot", "small-differential", "car", "swerve", "loc8")
PACKAGES = ("trajopt", "numpy", "casadi", "shapely")
COLUMNS = (
    "map",
    "robot",
    "two stages, s",
    "one program, s",
    "gain, %",
    "first route after, s",
    "all, s",
    "least distance, m",
)


def maps(name: str, chosen: list[str], folder: Path) -> Iterator[tuple[str, Tables]]:
    """Name and tables of the maps for a robot."""
    for scene in chosen:
        yield scene, grid(name, folder) if scene == "grid" else SCENES[scene](name)


def row(scene: str, name: str, tables: Tables) -> list[str]:
    """One line of the table."""
    problem = Problem.model_validate(tables)
    started = time.process_time()
    solution = solve(problem)
    total = time.process_time() - started
    assert solution.route is not None
    if solution.path is None or solution.trajectory is None:
        return [scene, name, solution.status, "", "", "", f"{total:.1f}", ""]
    best = {
        method: min(
            (a.cost("duration") for a in solution.route.attempts if a.method == method),
            default=float("inf"),
        )
        for method in ("two stages", "one program")
    }
    first = min(a.seconds for a in solution.route.attempts if a.trajectory is not None)
    gain = 100 * (1 - solution.duration / best["two stages"])
    free = independent_clearance(solution.path, problem.robot, problem.scene.keep_out.solids)
    cells = [f"{best['two stages']:.3f}", f"{best['one program']:.3f}", f"{gain:.2f}"]
    return [scene, name, *cells, f"{first:.1f}", f"{total:.1f}", f"{free:.4f}"]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--maps", nargs="+", default=[*SCENES, "grid"])
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS))
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name in options.robots:
            for scene, tables in maps(name, options.maps, Path(folder)):
                rows.append(row(scene, name, tables))
                print(*rows[-1], sep=", ", flush=True)
    table = ResultTable("Routes of least time", COLUMNS, rows)
    publish("routes", [table], packages=PACKAGES)


if __name__ == "__main__":
    main()
