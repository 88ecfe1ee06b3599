"""What a user waits for: whole calls and cold commands, beside peers, for ``benchmarks.peers.time_scaling``.

Calls are timed by the processor time of this process, ours and the peer's in turn, least of all; so
that what else the machine does counts little. Cold commands are told by wall clock too.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from benchmarks.common import ResultTable
from benchmarks.peers.time_scaling_cases import curve, robot
from benchmarks.peers.toppra_robot import WheeledRobot, interpolator, solved
from trajopt.arrays import Array
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.limit import Limit
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.tip import Tip
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.paths.path import Path
from trajopt.pipeline import solve
from trajopt.problem import load_problem
from trajopt.robots.robot import Robot
from trajopt.timing.scaling import time_scale

LIMITS = (Slip(0.332, sides=16, rule="load"), Tip(), WheelAcceleration(8.0), WheelSpeed(12.0))
PROBLEM = "problems/smdw/table_5_3.toml"
LAP = 3000.0  # m of centre line, in points 3 m apart; chosen
HEADER = ("work", "ms", "peer", "its ms", "peer / ours", "goal")
Row = list[str]


def in_turn(runs: Sequence[Callable[[], Any]], repetitions: int) -> list[float]:
    """Least processor seconds of each run, taken in turn, after one for warming up."""
    least = [float("inf")] * len(runs)
    for run in runs:
        run()
    for _ in range(repetitions):
        for k, run in enumerate(runs):
            begin = time.process_time()
            run()
            least[k] = min(least[k], time.process_time() - begin)
    return least


def row(work: str, ours: float, peer: str, theirs: float | None, goal: str) -> Row:
    told = ("", "") if theirs is None else (f"{theirs * 1e3:.2f}", f"{theirs / ours:.2f}")
    return [work, f"{ours * 1e3:.2f}", peer, *told, goal]


def calls(repetitions: int) -> ResultTable:
    """Whole calls."""
    rows = [*robot_rows(repetitions), *plain_rows(repetitions), lap_row(repetitions)]
    rows += [*other_rows(repetitions), *solve_rows(repetitions)]
    return ResultTable("Whole calls, processor time", HEADER, rows)


def robot_rows(repetitions: int) -> list[Row]:
    """Slip, tip and wheels: toppra neither refines nor checks; its contacts stand still."""
    path, one = curve(), robot()
    peer, spline = WheeledRobot(one, 0.332, 16, 8.0, 12.0), interpolator(curve())
    rows = []
    for points, plain, proof in ((200, "5", ""), (1001, "8", "4"), (10_000, "15", "")):
        theirs, ours, sure = in_turn(
            [
                partial(solved, spline, peer, points),
                partial(time_scale, path, LIMITS, robot=one, gridpoints=points, gap=None),
                partial(time_scale, path, LIMITS, robot=one, gridpoints=points),
            ],
            repetitions if points < 5000 else max(3, repetitions // 5),
        )
        work = f"time_scale, slip, tip and wheels, {points} points"
        rows.append(row(work, ours, "toppra", theirs, f">= {plain}"))
        rows.append(
            row(f"{work}, with its proof", sure, "toppra", theirs, f">= {proof}" if proof else "")
        )
    return rows


def plain_rows(repetitions: int) -> list[Row]:
    """Speed and acceleration along the path; copp-py has those of two coordinates."""
    path, limits = curve(), (Speed(1.0), Acceleration(1.0, 1.5))
    runs: list[Callable[[], Any]] = [lambda: time_scale(path, limits, gridpoints=1001, gap=None)]
    try:
        from benchmarks.peers.time_scaling import copp_problem
        from benchmarks.peers.time_scaling_cases import coordinate_stages

        stages, q, dq, ddq = coordinate_stages(1001)
        copp_problem(stages.s, q, dq, ddq)

        def copp() -> Any:
            problem, run = copp_problem(stages.s, q, dq, ddq)
            return run(problem)

        runs.append(copp)
    except ImportError:
        pass
    found = in_turn(runs, repetitions)
    theirs = found[1] if len(found) > 1 else None
    return [
        row(
            "time_scale, speed and acceleration, 1001 points", found[0], "copp-py", theirs, ">= 0.5"
        )
    ]


def lap_row(repetitions: int) -> Row:
    """A centre line as a lap: path and timing, and a forward-backward profile alone on a 2 m grid."""
    points = centre_line()
    limits: tuple[Limit, ...] = (Speed(15.0), Acceleration(2.0, 3.0), Slip(0.35, rule="load"))
    one = ball_robot()
    ours, theirs = in_turn(
        [
            lambda: time_scale(Path.through(points), limits, robot=one, gap=None),
            lambda: forward_backward(points, 0.35 * 9.80665, 2.0, 3.0, 15.0),
        ],
        max(2, repetitions // 5),
    )
    return row(f"path and time_scale of {LAP:.0f} m", ours, "forward-backward", theirs, ">= 1")


def ball_robot() -> Robot:
    """Two driven wheels, a ball in front and one behind."""
    size = {"radius": 0.1, "width": 0.04, "mass": 1.0}
    places = {"left": (0.0, 0.22), "right": (0.0, -0.22), "front": (0.3, 0.0), "rear": (-0.3, 0.0)}
    kinds = {"left": "fixed", "right": "fixed", "front": "spherical", "rear": "spherical"}
    return Robot.of(
        {
            "name": "balls",
            "body": {
                "mass": 40.0,
                "cog": [0.03, 0.0, 0.1],
                "yaw_inertia": 2.0,
                "chassis": [0.7, 0.5, 0.2],
                "clearance": 0.05,
            },
            "wheels": [
                {"name": name, "kind": kinds[name], "position": list(place), **size}
                for name, place in places.items()
            ],
            "motors": [{"name": "drives", "wheels": ["left", "right"], "torque": 9.0}],
        }
    )


def centre_line() -> Array:
    """(N, 2): points of a winding lap, m."""
    t = np.linspace(0, 2 * np.pi, int(LAP / 3), endpoint=False)
    radius = LAP / 8 * (1 + 0.25 * np.cos(3 * t) + 0.08 * np.sin(7 * t))
    return np.column_stack([radius * np.cos(t), radius * np.sin(t)])


def forward_backward(
    points: Array, grip: float, forward: float, braking: float, most: float
) -> Array:
    """(N,): speeds as race-line software finds them: curvature of the points on a 2 m grid, then what is
    left of the friction circle, forward and backward."""
    chords = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    spline = CubicSpline(chords, points)
    s = np.arange(0.0, chords[-1], 2.0)
    d, dd = spline(s, 1), spline(s, 2)
    bend = np.abs(d[:, 0] * dd[:, 1] - d[:, 1] * dd[:, 0]) / np.sum(d * d, axis=1) ** 1.5
    speed = np.minimum(np.sqrt(grip / np.maximum(bend, 1e-9)), most)
    for i in range(len(s) - 1):
        left = np.sqrt(max(0.0, 1 - (speed[i] ** 2 * bend[i] / grip) ** 2))
        reach = speed[i] ** 2 + 2 * (s[i + 1] - s[i]) * min(forward, grip * left)
        speed[i + 1] = min(speed[i + 1], np.sqrt(reach))
    for i in range(len(s) - 1, 0, -1):
        left = np.sqrt(max(0.0, 1 - (speed[i] ** 2 * bend[i] / grip) ** 2))
        reach = speed[i] ** 2 + 2 * (s[i] - s[i - 1]) * min(braking, grip * left)
        speed[i - 1] = min(speed[i - 1], np.sqrt(reach))
    return speed


def other_rows(repetitions: int) -> list[Row]:
    """States at times, and splines through many points."""
    trajectory = time_scale(curve(), LIMITS, robot=robot())
    times = np.linspace(0, trajectory.duration, 20_001)
    (seconds,) = in_turn([lambda: trajectory.at(times)], repetitions)
    rows = [row("trajectory.at of 20,001 times, wheels and castors", seconds, "", None, "<= 3 ms")]
    for count, goal in ((4000, "<= 10 ms"), (10_000, "<= 20 ms")):
        points = np.cumsum(np.random.default_rng(1).uniform(0.1, 1.0, (count, 2)), axis=0)
        chords = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        ours, theirs = in_turn(
            [
                partial(_length, points),
                partial(CubicSpline, chords, points, bc_type="natural"),
            ],
            max(3, repetitions // 3),
        )
        rows.append(
            row(f"Path.through of {count} points, with its length", ours, "scipy", theirs, goal)
        )
    return rows


def _length(points: Array) -> float:
    return Path.through(points).length


def solve_rows(repetitions: int) -> list[Row]:
    problem = load_problem(PROBLEM)
    rows = []
    for name, goal in (("lattice", 8), ("pso", 40), ("lattice+ipopt+newton", 20)):
        (seconds,) = in_turn(
            [partial(solve, problem, optimizer=name)],
            max(3, repetitions // 3),
        )
        rows.append(row(f"solve() by {name}", seconds, "", None, f"<= {goal} ms"))
    return rows


FIRST = """
from trajopt import Path, Slip, Tip, WheelAcceleration, WheelSpeed, robot, time_scale
limits = (Slip(0.3), Tip(), WheelAcceleration(8.0), WheelSpeed(12.0))
time_scale(Path.through([[0, 0], [1, 0.5], [2, 0]]), limits, robot=robot("powerbot"))
"""
TOPPRA = """
import numpy as np, toppra, toppra.algorithm, toppra.constraint as c
path = toppra.SplineInterpolator([0, 1, 2], np.array([[0, 0], [1, 0.5], [2, 0]]))
box = np.array([[-1, 1], [-1, 1]])
limits = [c.JointVelocityConstraint(box), c.JointAccelerationConstraint(box)]
toppra.algorithm.TOPPRA(limits, path, solver_wrapper="seidel").compute_trajectory(0, 0)
"""
COMMAND = "from trajopt.cli import main; main()"


def cold(repetitions: int) -> ResultTable:
    """New processes: the first call, and commands."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        runs = (
            ("first call in a new process", ["-c", FIRST], "<= toppra's"),
            ("toppra's first call in a new process", ["-c", TOPPRA], ""),
            (
                "solve, with pictures",
                ["-c", COMMAND, "solve", PROBLEM, "--out", f"{folder}/a"],
                "<= 1.5 s",
            ),
            (
                "solve, without",
                ["-c", COMMAND, "solve", PROBLEM, "--out", f"{folder}/b", "--no-pictures"],
                "<= 0.6 s",
            ),
            ("explain", ["-c", COMMAND, "explain", PROBLEM], "<= 0.5 s"),
            ("plan", ["-c", COMMAND, "plan", "problems/smdw/step_5cm.toml"], "<= 0.6 s"),
            ("--help", ["-c", COMMAND, "--help"], "<= 0.12 s"),
        )
        for name, arguments, goal in runs:
            rows.append([name, *_process(arguments, max(2, repetitions // 10), {}), goal])
        empty = {"NUMBA_CACHE_DIR": f"{folder}/cache"}
        rows.append(
            ["first call ever, nothing compiled", *_process(["-c", FIRST], 1, empty), "<= 8 s"]
        )
    return ResultTable("New processes", ("work", "wall s", "processor s", "goal"), rows)


def _process(arguments: list[str], repetitions: int, extra: dict[str, str]) -> tuple[str, str]:
    """Least wall and processor seconds."""
    wall = processor = float("inf")
    for _ in range(repetitions):
        before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run(
            [sys.executable, *arguments], check=False, capture_output=True, env=os.environ | extra
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        wall = min(wall, time.perf_counter() - begin)
        used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        processor = min(processor, used)
    return f"{wall:.2f}", f"{processor:.2f}"
