"""Kinds of files that a user gives: sound ones, and what uses them."""

from __future__ import annotations

import math
import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from trajopt.control.commands import compare_log
from trajopt.optimize.base import Budget
from trajopt.pipeline import solve
from trajopt.problem import load_problem
from trajopt.report.run_folder import read_solution, write_solution
from trajopt.robots.robot import DATA, Robot
from trajopt.solution import Solution
from trajopt.sweeps.sweepfile import load_sweep
from trajopt.world.height_files import load_height_map
from trajopt.world.mesh import load_mesh

ROOT = Path(__file__).parents[2]
SOLVED = 8  # every so many problems that load are solved too; chosen


@dataclass(frozen=True)
class Kind:
    """Files of a kind in ``folder`` (sound ones), and what uses one; returns what came of it."""

    name: str
    files: tuple[Path, ...]
    use: Callable[[Path], str]
    text: bool = True


# -- kinds of files


def all_kinds(folder: Path) -> list[Kind]:
    """Every kind of file, with sound ones copied into ``folder``/<kind>, where mutants stand too."""
    problems = sorted((ROOT / "problems").glob("*/*.toml"))
    problems = [file for file in problems if file.parent.name != "sweeps"]
    copies = _copies(folder / "problem", problems)
    _copies(folder / "problem" / "ground", sorted((ROOT / "problems" / "ground").iterdir()))
    for file in copies:  # no file is looked for elsewhere
        file.write_text(file.read_text().replace("../ground/", "ground/"))
    maps, meshes = _grounds(folder / "map"), _meshes(folder / "mesh")
    sweeps = _copies(folder / "sweep", sorted((ROOT / "problems" / "sweeps").glob("*.toml")))
    for file in sweeps:
        file.write_text(file.read_text().replace("../", f"{ROOT}/problems/"))
    sweeps.append(folder / "sweep" / "all.toml")
    sweeps[-1].write_text(SWEEP)
    (folder / "path").mkdir()
    way = folder / "path" / "way.csv"
    way.write_text(
        "# x y\nx,y,yaw\n" + "".join(f"{0.5 * i},{0.1 * i * i},0.{i}\n" for i in range(9))
    )
    problem = folder / "path" / "p.toml"
    problem.write_text(PATH)
    solved = {
        name: solve(load_problem(file), budget=budget)
        for name, file, budget in (
            ("search", copies[0].parent / "table_5_3.toml", Budget(200)),
            ("path", problem, None),
        )
    }
    log = folder / "log" / "log.csv"
    log.parent.mkdir()
    trajectory = solved["path"].trajectory
    assert trajectory is not None
    times = np.linspace(0, trajectory.duration, 40)
    state = trajectory.at(times)
    rows = np.column_stack([times, state.pose, state.twist[:, 0]])
    log.write_text("t,x,y,yaw,v\n" + "".join(",".join(map(repr, r)) + "\n" for r in rows.tolist()))
    loaded = Counter[str]()

    def problem_kind(file: Path) -> str:
        found = load_problem(file)
        loaded["problem"] += 1
        if loaded["problem"] % SOLVED:
            return "read"
        return _judged(solve(found, budget=None if found.job.name != "search" else Budget(100)))

    kinds = [
        Kind("problem", tuple(copies), problem_kind),
        Kind("robot", tuple(_copies(folder / "robot", sorted(DATA.glob("*.toml")))), _robot),
        Kind("sweep", tuple(sweeps), _sweep),
        Kind("map", tuple(maps), _map, text=False),
        Kind("mesh", tuple(meshes), _mesh),
        Kind("path", (way,), lambda _: _judged(solve(load_problem(problem)))),
        Kind("log", (log,), lambda file: _finite(list(compare_log(trajectory, file)))),
    ]
    for name, solution in solved.items():
        place = write_solution(solution, folder / f"run {name}", seed=0)
        files = tuple(f for f in place.iterdir())
        kinds.append(Kind(place.name, files, lambda file: _judged(read_solution(file.parent))))
    return kinds


PATH = """
title = "way"
robot.name = "loc8"
ground.friction = 0.6
[path]
file = "way.csv"
heading = "free"
[limits]
speed = 1.0
acceleration = 0.5
deceleration = 0.5
"""
SWEEP = """
title = "all"
run = "tests.sweeps.run_functions:cheap"
time_limit = 10.0
memory_limit = "2 GB"
exclude = ["x > 3 and y < 0.5", "abs(n) > 100"]
[axes.x]
range = [0, 4, 5]
[axes.y]
log = [0.1, 10, 3]
zip = "a"
[axes.z]
values = ["a", true, 3.5]
zip = "a"
[axes."a.b"]
random = { normal = [0.0, 1.0], count = 4, seed = 1 }
[sample]
method = "sobol"
count = 8
seed = 3
[sample.axes.n]
uniform = [-2, 2]
[sample.axes.m]
log-uniform = [0.1, 2]
[derived]
w = "2 * x + sqrt(y) if z == 'a' else -a.b ** 2"
"""


def _copies(place: Path, files: list[Path]) -> list[Path]:
    place.mkdir(parents=True, exist_ok=True)
    return [Path(shutil.copy(file, place / file.name)) for file in files]


def _grounds(place: Path) -> list[Path]:
    place.mkdir(parents=True)
    heights = np.random.default_rng(0).random((12, 9))
    np.save(place / "a.npy", heights)
    np.save(place / "b.npy", (100 * heights).astype(np.int16))
    grey = (255 * heights).astype(np.uint8)
    Image.fromarray(grey).save(place / "c.png")
    Image.fromarray(grey).save(place / "d.tif")
    Image.fromarray(heights.astype(np.float32)).save(place / "e.tif")
    return sorted(place.iterdir())


def _meshes(place: Path) -> list[Path]:
    place.mkdir(parents=True)
    points = [(0, 0, 0), (1, 0, 0.1), (1, 1, 0.2), (0, 1, 0.1)]
    obj = "".join(f"v {x} {y} {z}\n" for x, y, z in points) + "f 1 2 3\nf 1/1 3/3 4/4\n"
    (place / "a.obj").write_text(obj)
    corners = np.array([[points[i] for i in face] for face in ((0, 1, 2), (0, 2, 3))], np.float32)
    text = "".join(
        "facet normal 0 0 1\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in face.tolist())
        + "endloop\nendfacet\n"
        for face in corners
    )
    (place / "b.stl").write_text(f"solid s\n{text}endsolid s\n")
    head = b"\0" * 80 + (2).to_bytes(4, "little")
    body = b"".join(b"\0" * 12 + face.tobytes() + b"\0\0" for face in corners)
    (place / "c.stl").write_bytes(head + body)
    return sorted(place.iterdir())


def _robot(file: Path) -> str:
    robot = Robot.load(file)
    _finite([robot.yaw_inertia, robot.turning_length, *np.ravel(robot.inverse)])
    return "read"


def _sweep(file: Path) -> str:
    load_sweep(file)
    return "read"


def _map(file: Path) -> str:
    grey = file.suffix == ".png" or file.stem == "d"
    ground = load_height_map(file, 0.1, relief=0.5 if grey else None)
    return _finite(np.ravel(ground.height(np.linspace(0, 0.5, 9), 0.1)).tolist())


def _mesh(file: Path) -> str:
    return _finite(np.ravel(load_mesh(file, 0.1).height(0.3, 0.3)).tolist())


def _judged(solution: Solution) -> str:
    if not solution.holds:
        return "does not hold"
    numbers = [solution.cost, solution.duration, *solution.margins.values()]
    return _finite([n for n in numbers if n is not None]) + ", holds"


def _finite(numbers: list[float]) -> str:
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f"not finite: {numbers}"[:200])
    return "used"
