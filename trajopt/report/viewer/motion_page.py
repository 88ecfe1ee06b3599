"""The page of one run: its robot in its scene, planned and simulated, with plots under one cursor."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.report.files import FORMAT, read_sealed
from trajopt.report.motion import limit_use
from trajopt.report.viewer.motion import Motion, motion_data, planned, simulated
from trajopt.report.viewer.pages import packed, write_page
from trajopt.report.viewer.robot_data import robot_data
from trajopt.report.viewer.scene_data import scene_data
from trajopt.robots.robot import Robot
from trajopt.solution import Solution
from trajopt.timing.trajectory import Trajectory
from trajopt.world.scene import Scene

VIEW = "view.html"
_LINES = 8  # of a plot at most
_SHARES = 600  # points of a limit's curve at most, chosen


def write_view(solution: Solution, folder: FilePath) -> FilePath | None:
    """Write view.html of a solution into its run folder: its motion, and the one of ``simulated.csv`` where there is
    one. Returns the file; None for a solution without a trajectory."""
    trajectory, robot = solution.trajectory, solution.problem.robot
    (folder / VIEW).unlink(missing_ok=True)
    if trajectory is None:
        return None
    motions, hits, about = [planned(trajectory)], [], f"{trajectory.duration:.2f} s planned"
    if (folder / "simulated.csv").exists():
        facts = read_sealed(folder / "validation.json", FORMAT)
        motions.append(
            simulated(
                read_columns(folder / "simulated.csv"), robot, f"simulated ({facts['engine']})"
            )
        )
        hits = facts["contacts"]
        about += f"; in {facts['engine']} {1e3 * facts['final_distance_m']:.1f} mm off at the end"
    problem = solution.problem
    data = view_data(robot, problem.scene, motions, problem.title, about, trajectory)
    data["hits"] = hits
    return write_page("motion", data, folder / VIEW)


def view_data(
    robot: Robot,
    scene: Scene,
    motions: Sequence[Motion],
    title: str,
    about: str,
    trajectory: Trajectory | None = None,
) -> dict[str, Any]:
    """What the page shows of motions of one robot in one scene; with the ``trajectory`` that the
    first one is, curves too."""
    places = np.vstack([motion.place[:, :2] for motion in motions])
    return {
        "title": title,
        "about": about,
        "robot": robot_data(robot),
        "scene": scene_data(scene, places),
        "motions": [motion_data(motion, robot) | _under(motion, scene) for motion in motions],
        "hits": [],
        "plots": [] if trajectory is None else _plots(trajectory, motions, robot),
    }


def _under(motion: Motion, scene: Scene) -> dict[str, Any]:
    """Heights of the ground below the robot, or of what it stands on where that is higher."""
    x, y, z = motion.place.T
    return {"ground": packed(np.maximum(scene.ground.height(x, y), z))}


def read_columns(file: FilePath) -> dict[str, Array]:
    """The columns of a table of numbers. Raises ArgumentError for another file."""
    try:
        with file.open(encoding="utf-8", newline="") as stream:
            rows = list(csv.reader(stream))
        values = np.array([[float(v or "nan") for v in row] for row in rows[1:]])
        return dict(zip(rows[0], values.T, strict=True))
    except (OSError, ValueError, IndexError) as error:
        raise ArgumentError(str(file), str(error), "the table that validate writes") from None


def _plots(trajectory: Trajectory, motions: Sequence[Motion], robot: Robot) -> list[dict[str, Any]]:
    """Speed, limits' shares, wheel angles, and distance from the plan, each at most 8 lines."""
    speed = [
        _line(m.name, m.times, np.hypot(m.twist[:, 0], m.twist[:, 1]), k)
        for k, m in enumerate(motions)
    ]
    times, used = limit_use(trajectory)
    every = max(1, len(times) // _SHARES)
    peaks = np.maximum.reduceat(used, np.arange(0, len(used), every), axis=0)
    shares = [
        _line(limit.name.replace("_", " "), times[::every, k], np.minimum(peaks[:, k], 2.0), k)
        for k, limit in enumerate(trajectory.limits)
    ]
    names = [wheel.name for wheel in robot.description.wheels]
    rolling = [names.index(name) for name in robot.wheel_names]
    angles = [
        _line(names[w] + (", simulated" if k else ""), m.times, m.spin[:, w], i, dashed=k > 0)
        for k, m in enumerate(motions)
        for i, w in enumerate(rolling)
    ]
    found: list[dict[str, Any]] = [
        {"title": "speed", "unit": "m/s", "lines": speed},
        {"title": "share of each limit in use", "unit": "–", "lines": shares[:_LINES], "mark": 1.0},
        {"title": "wheel angle", "unit": "rad", "lines": angles[:_LINES]},
    ]
    steering = [k for k, name in enumerate(names) if np.any(motions[0].steering[:, k])]
    if steering:
        lines = [
            _line(names[w], motions[0].times, motions[0].steering[:, w], i)
            for i, w in enumerate(steering)
        ]
        found.append({"title": "steering and castor angle", "unit": "rad", "lines": lines[:_LINES]})
    for plan, real in pairwise(motions):
        off = [
            np.interp(real.times, plan.times, plan.place[:, k]) - real.place[:, k] for k in (0, 1)
        ]
        line = _line("simulated", real.times, 1e3 * np.hypot(*off), 1)
        found.append({"title": "distance from the plan", "unit": "mm", "lines": [line]})
    return found


def _line(
    name: str, times: Array, values: Array, colour: int, *, dashed: bool = False
) -> dict[str, Any]:
    return {
        "name": name,
        "x": packed(times),
        "y": packed(values),
        "colour": colour,
        "dashed": dashed,
    }
