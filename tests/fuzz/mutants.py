"""Damaged files of every kind, and what becomes of them: refused in one line, or used.

``python -m tests.fuzz.mutants --count 20000 --seed 1`` runs them in this process, with a watchdog of
10 s and 1 GB, and prints the outcomes by kind of file; it ends with 1 where one was a fault: an
exception but TrajoptError, a hang, memory, or NaN in a result that is said to hold.
"""

from __future__ import annotations

import argparse
import math
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image

from trajopt.control.commands import compare_log
from trajopt.errors import TrajoptError
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
SECONDS, BYTES = 10.0, 1_000_000_000  # a mutant may take; the goal
_WAITED = 120.0  # s on the clock, where others keep the processors busy; chosen
SOLVED = 8  # every so many problems that load are solved too; chosen
NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.])")
# what stands for a value
ODD = (
    *(b"0", b"-1", b"1", b"2", b"1e9", b"-1e9", b"1e300", b"-1e300", b"5e-324", b"1e-9", b"1e-6"),
    *(b"nan", b"inf", b"-inf", b"9" * 5000, b"9" * 400, b"true", b'"1"', b'""', b"'x'", b"0x7f"),
    *(b"[]", b"{}", b"[1]", b"[" * 3000, b"[1, [2]]", b"{a = 1}", b"1979-05-27", b"", b"7" * 17),
    *(
        b'"../../../etc/passwd"',
        b'"\\u0000"',
        b'"[/bold]"',
        b'"\x1b[2J"',
        b"1_0",
        b"03",
        b"1e",
        b"\xff",
    ),
)
ALIEN = (
    b"",
    b"\n",
    b"\0",
    b'"',
    b"'",
    b"[",
    b"]",
    b"{",
    b"}",
    b"=",
    b",",
    b".",
    b"#",
    b"\xff\xfe",
    b"\r",
)


@dataclass(frozen=True)
class Kind:
    """Files of a kind in ``folder`` (sound ones), and what uses one; returns what came of it."""

    name: str
    files: tuple[Path, ...]
    use: Callable[[Path], str]
    text: bool = True


@dataclass
class Outcomes:
    """Counts by kind and outcome, and the faults."""

    counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        kinds = sorted({kind for kind, _ in self.counts})
        lines = [
            f"{kind}: "
            + ", ".join(f"{n} {o}" for (k, o), n in sorted(self.counts.items()) if k == kind)
            for kind in kinds
        ]
        return "\n".join([*lines, f"{len(self.faults)} faults", *self.faults[:20]])


class Hang(BaseException):
    """The watchdog: no ``except Exception`` may hold it."""


def mutated(data: bytes, draw: random.Random, text: bool) -> bytes:
    """One to three changes of ``data``."""
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        data = _changed(data, draw, text)
    return data


def _changed(data: bytes, draw: random.Random, text: bool) -> bytes:
    size = max(1, len(data))
    at, until = sorted((draw.randrange(size), min(size, draw.randrange(size) + 1)))
    lines = data.splitlines(keepends=True) or [b""]
    line, other = draw.randrange(len(lines)), draw.randrange(len(lines))
    match draw.randrange(14 if text else 5):
        case 0:  # a bit
            changed = bytearray(data or b"\0")
            changed[min(at, len(changed) - 1)] ^= 1 << draw.randrange(8)
            return bytes(changed)
        case 1:
            return data[:at]
        case 2:
            return data[:at] + data[until:]
        case 3:
            return data[:at] + draw.choice(ALIEN) + data[at:]
        case 4:
            return data[:until] + data[at:]
        case 5:
            del lines[line]
        case 6:
            lines[line], lines[other] = lines[other], lines[line]
        case 7:
            lines.insert(line, lines[other])
        case _:
            found = list(NUMBER.finditer(data))
            if found:
                one = draw.choice(found)
                near = repr(float(one[0]) * draw.choice((-1, 0.5, 2, 10, 0.1, 1e3, 1e-3))).encode()
                odd = draw.choice(ODD) if draw.random() < 0.4 else near
                return data[: one.start()] + odd + data[one.end() :]
    return b"".join(lines)


def run(kinds: list[Kind], count: int, seed: int, folder: Path) -> Outcomes:
    """``count`` mutants, kinds and files in turn."""
    found = Outcomes()
    clocks = {signal.SIGPROF: signal.ITIMER_PROF, signal.SIGALRM: signal.ITIMER_REAL}
    before = {number: signal.signal(number, _bark) for number in clocks}
    for number in range(count):
        kind = kinds[number % len(kinds)]
        draw = random.Random(f"{seed} {number}")
        sound = draw.choice(kind.files)
        content = sound.read_bytes()
        place = folder / kind.name
        file = place / sound.name
        file.write_bytes(mutated(content, draw, kind.text))
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        signal.setitimer(signal.ITIMER_REAL, _WAITED)
        try:
            outcome = kind.use(file)
        except TrajoptError as error:
            outcome = "refused"
            if "\n" in str(error) or len(str(error)) > 2000:
                found.faults.append(
                    f"{kind.name} {number} {sound.name}: told in {str(error)[:200]!r}"
                )
        except (Exception, Hang) as error:
            outcome = "FAULT"
            where = traceback.extract_tb(error.__traceback__)[-1]
            told = f"{type(error).__name__}: {error} ({where.filename}:{where.lineno})"
            found.faults.append(f"{kind.name} {number} {sound.name}: {told[:300]}")
        finally:
            for clock in clocks.values():
                signal.setitimer(clock, 0)
            file.write_bytes(content)  # other mutants may need the sound one
        found.counts[kind.name, outcome] += 1
    for number, handler in before.items():
        signal.signal(number, handler)
    return found


def _bark(*_: object) -> None:
    raise Hang(f"more than {SECONDS} s")


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


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory(prefix="trajopt-fuzz-") as name:
        kinds = all_kinds(Path(name))
        run(kinds, 300, options.seed + 1, Path(name))  # loads what is loaded when first used
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, used + BYTES))
        started = time.monotonic()
        found = run(kinds, options.count, options.seed, Path(name))
    print(found)
    print(f"{options.count} mutants in {time.monotonic() - started:.0f} s")
    return 1 if found.faults else 0


if __name__ == "__main__":
    sys.exit(main())
