"""Climbs from the final states that the SMDW thesis prints: `python -m
benchmarks.theses.smdw_printed [--engines E ...]`.

Its sub-test 2 started from the states of its Tables 6.2-6.4: 2 s at 8.5 rad/s against the step.
Friction and the place of the edge are not printed, nor what its wheels look like in detail: this
says what those states are worth here.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks.common import OUT, PROBLEMS, ResultTable, publish
from benchmarks.theses.climb_tables import THESIS
from benchmarks.theses.climb_trials import NAMES
from trajopt.problem import Problem, load_problem
from trajopt.report.intervals import wilson
from trajopt.robots.robot import robot
from trajopt.simulate.engine import ENGINES, Recording
from trajopt.systems.smdw.climb import Climb, Outcome, judge, record_climb
from trajopt.systems.smdw.configurations import Configuration, configurations_of
from trajopt.systems.smdw.trials import critical_wheels, four, step_scene

DATA = Path(__file__).parent / "data" / "smdw"
TABLES = {
    "lateral left": "table_6_2_lateral",
    "forward -35 deg": "table_6_3_forward35",
    "forward -45 deg": "table_6_4_forward45",
}
# Signs of the wheel speeds of sub-test 2 as printed in Table 6.5; right-handed ones may differ.
PRINTED_SPIN = {
    "lateral left": np.array([1.0, -1.0, -1.0, 1.0]),
    "forward -35 deg": np.ones(4),
    "forward -45 deg": np.ones(4),
}
SET_YAW = -math.pi / 2  # rad, section 6.1.1: yaw put right by hand, lateral
YAWS = ("as printed", "-90 deg", "-90 deg, as near as before")
SET_YAW_THESIS = "10/10, 2 of them sliding"  # section 6.1.1, Figure 6.8
FILE = OUT / "smdw_printed_trials.csv"
NOTE = (
    "A wheel is up when its centre stays risen by 0.7 of the step's height. Friction 0.8, 8 N m. The place of the "
    "edge is inferred; every centimetre shifts the phase at which a wheel meets it by 0.1 rad."
)
HEIGHTS = (0.05, 0.035)  # m, sections 6.1 and 6.1.1


def read(name: str) -> list[dict[str, str]]:
    """Rows of a data file; lines that start with # are its sources."""
    lines = (DATA / f"{name}.csv").read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


@dataclass(frozen=True, eq=False)
class Group:
    """Climbs of one configuration and step height (m) from its ten printed states, with the ``yaw``
    printed or set; ``thesis`` is what it counted."""

    configuration: str
    height: float
    yaw: str
    climbs: list[Climb]
    thesis: str

    def recorded(self, engine: str) -> list[tuple[Recording, Outcome]]:
        runs = [record_climb(climb, engine) for climb in self.climbs]
        return [(run, judge(climb, run)) for climb, run in zip(self.climbs, runs, strict=True)]


def groups() -> Iterator[Group]:
    """Scenario 1 at both heights, and lateral at 3.5 cm with the yaw set right (Figures 6.6, 6.7,
    6.8)."""
    problem = load_problem(PROBLEMS / "smdw" / "step_5cm.toml")
    for configuration in configurations_of(problem):
        if configuration.name not in TABLES:
            continue
        name = NAMES[configuration.name]
        for height in HEIGHTS:
            climbs = [
                printed_climb(problem, configuration, row, height)
                for row in read(TABLES[configuration.name])
            ]
            yield Group(
                configuration.name, height, YAWS[0], climbs, THESIS[name, height].split(",")[0]
            )
            if configuration.motion.lateral and height == min(HEIGHTS):
                turned = [replace(c, pose=(*c.pose[:2], SET_YAW)) for c in climbs]
                yield Group(configuration.name, height, YAWS[1], turned, SET_YAW_THESIS)
                yield Group(configuration.name, height, YAWS[2], [moved_up(c) for c in climbs], "")


def moved_up(climb: Climb) -> Climb:
    """The yaw set right, and the robot moved so that its leading wheel's centre is as near to the
    step as before."""
    x, y, yaw = climb.pose
    half_base, half_track = robot("loc8-smdw").wheels[0].position
    # ahead of the robot's centre
    before = half_base * abs(math.cos(yaw)) - half_track * math.sin(yaw)
    return replace(climb, pose=(x + before - half_track, y, SET_YAW))


def printed_climb(
    problem: Problem, configuration: Configuration, row: dict[str, str], height: float
) -> Climb:
    """Sub-test 2 from a printed state. Wheel angles keep their phase along the rotation, whatever
    its sign."""
    spin = np.sign(problem.robot.inverse @ np.array([*configuration.direction, 0.0]))
    wheels = (
        np.array([float(row[f"theta{i}_rad"]) for i in (1, 2, 3, 4)])
        * PRINTED_SPIN[configuration.name]
        * spin
    )
    pose = (float(row["xf_m"]), float(row["yf_m"]), float(row["psif_rad"]))
    scene = step_scene(problem, problem.scene.friction)
    room = scene.step.place[0] - pose[0]
    return Climb(
        replace(scene, step=replace(scene.step, height=height)),
        pose,
        four(wheels),
        configuration.direction,
        critical_wheels(configuration),
        (room, room),
    )


def table(trials: Sequence[Mapping[str, str]]) -> ResultTable:
    """Critical wheels up from the printed states, one column an engine, from rows of the trial
    file."""
    engines = list(dict.fromkeys(t["engine"] for t in trials))
    rows = []
    for key in dict.fromkeys(
        (t["configuration"], t["step_m"], t["yaw"], t["thesis"]) for t in trials
    ):
        cells = [
            _share(
                [
                    t
                    for t in trials
                    if t["engine"] == engine
                    and t["exploded"] == "False"
                    and key == (t["configuration"], t["step_m"], t["yaw"], t["thesis"])
                ]
            )
            for engine in engines
        ]
        rows.append((key[0], f"{100 * float(key[1]):g}", key[2], key[3], *cells))
    return ResultTable(
        "Figures 6.6-6.8: climbs from the thesis's own printed final states (Tables 6.2-6.4)",
        ("configuration", "step, cm", "yaw", "thesis", *engines),
        rows,
    )


def _share(trials: Sequence[Mapping[str, str]]) -> str:
    good = sum(t["critical_up"] == "True" for t in trials)
    low, high = wilson(good, len(trials))
    return f"{good}/{len(trials)} ({low:.2f}-{high:.2f})"


def kept() -> list[dict[str, str]]:
    """Rows of the trial file, none where there is none."""
    if not FILE.exists():
        return []
    with FILE.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="MuJoCo only, nothing written")
    parser.add_argument("--engines", nargs="+", default=list(ENGINES), choices=ENGINES)
    given = parser.parse_args(arguments)
    rows: list[dict[str, str]] = []
    for engine, group in product(("mujoco",) if given.quick else given.engines, groups()):
        for number, (_, outcome) in enumerate(group.recorded(engine)):
            rows.append(
                {
                    "engine": engine,
                    "configuration": group.configuration,
                    "step_m": f"{group.height:g}",
                    "yaw": group.yaw,
                    "thesis": group.thesis,
                    "number": str(number + 1),
                    "critical_up": str(outcome.critical_up),
                    "all_up": str(outcome.all_up),
                    "exploded": str(outcome.exploded),
                }
            )
    if not given.quick:
        OUT.mkdir(parents=True, exist_ok=True)
        with FILE.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
    publish(
        "smdw_printed" + ("_quick" if given.quick else ""),
        [table(rows)],
        packages=("mujoco", "pybullet"),
        notes=[NOTE],
    )


if __name__ == "__main__":
    main()
