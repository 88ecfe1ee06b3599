"""How often planned approaches climb: `python -m benchmarks.theses.climb [--quick] [--engine E]
[--trials N] [--parts ...]`.

Parts: ``planned`` starts sub-test 2 at the states that three planners reach (exact lattice at the
middle of the window, the thesis's PSO aiming at its own 0, uniform random wheel angles); ``driven``
executes the exact plan open loop first (sub-test 1); ``phases`` maps the climb over wheel phase,
torque and friction; ``causes`` varies heading error, gap and approach speed, one at a time. Every
trial is seeded by its place.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.random import Generator

from benchmarks.common import OUT, PROBLEMS, ResultTable, publish
from trajopt.arrays import Array
from trajopt.objectives.terminal import terminal_objective
from trajopt.optimize.search import minimize
from trajopt.problem import Problem, load_problem
from trajopt.systems.smdw.climb import (
    CLIMB_SPEED,
    Climb,
    Outcome,
    Rate,
    climb_all,
    reached,
    run_approach,
)
from trajopt.systems.smdw.configurations import (
    Configuration,
    approach_target,
    configurations_of,
    travel_to_step,
)
from trajopt.systems.smdw.planner import Plan, plan_configuration
from trajopt.systems.smdw.thesis import through_drives
from trajopt.systems.smdw.trials import (
    NEAREST,
    approach_command,
    before_step,
    critical_wheels,
    four,
    step_scene,
)

FILES = {0.035: "step_3_5cm.toml", 0.05: "step_5cm.toml"}
NAMES = {"lateral left": "lateral", "forward -35 deg": "forward35", "forward -45 deg": "forward45"}
SCENARIO = {0.035: 2, 0.05: 1}
# [guzman2015], sections 6.1, 6.1.1, 6.2: climbs in 10 runs (scenario 1 for 5 cm; both scenarios for
# 3.5 cm).
THESIS = {
    ("lateral", 0.05): "0/10",
    ("forward35", 0.05): "5/10",
    ("forward45", 0.05): "5-6/10",
    ("lateral", 0.035): "4/10, 2/10",
    ("forward35", 0.035): "most, 10/10",
    ("forward45", 0.035): "most, 10/10",
}
FRICTION = (0.6, 1.0)  # range, issue's trials
POSITION_SD, YAW_SD, WHEEL_SD = (
    0.003,
    math.radians(0.5),
    0.05,
)  # m, rad, rad: of the state a climb starts from; chosen
PSO_SEARCHES = 5  # of the thesis's PSO, each serving an equal share of the trials
PHASES = np.linspace(-2.4, 2.4, 9)  # rad, along the rotation, where the wheel meets the step
TORQUES, FRICTIONS = (2.0, 4.0, 8.0), (0.5, 0.8)
CAUSES = {
    "heading error at the end, deg": (0.0, 2.0, 5.0, 10.0),
    "gap, cm": (2.0, 5.0, 10.0, 20.0),
    "approach speed, rad/s": (2.0, 4.0, 8.5, 15.0),
}
CAUSES_TORQUES, CAUSES_FRICTION = (
    {"lateral": 3.0, "forward35": 2.0},
    0.8,
)  # N m, -: chosen, where climbs are in doubt
SOURCES = ("exact", "thesis PSO", "uniform")
PACKAGES = ("numpy", "mujoco", "pybullet")


@dataclass(frozen=True)
class Trial:
    """One row of the trial file."""

    part: str
    engine: str
    height: float
    configuration: str
    source: str
    number: int
    friction: float
    torque: float
    critical_up: bool
    first_attempt: bool
    all_up: bool
    exploded: bool
    reason: str
    seconds: float  # wall time, mean of its cell; nan where it was not taken


def plan_of(problem: Problem, configuration: Configuration) -> Plan:
    """The exact plan; these problems all have one."""
    plan = plan_configuration(problem, configuration)
    if not isinstance(plan, Plan):
        raise SystemExit(f"{configuration.name}: {plan.reason}")
    return plan


def climb_from(
    problem: Problem, plan: Plan, wheels: Array, rng: Generator, yaw_error: float = 0.0
) -> Climb:
    """Sub-test 2 from the plan's target with random state errors and friction, and the given wheel
    angles (4,)."""
    x, y, yaw = plan.target.pose
    dx = min(float(rng.normal(0.0, POSITION_SD)), problem.climb.gap - NEAREST)
    shift = np.array([dx, rng.normal(0.0, POSITION_SD), yaw_error + rng.normal(0.0, YAW_SD)])
    angles = wheels + rng.normal(0.0, WHEEL_SD, 4)
    pose = before_step(problem, np.array([x, y, yaw]) + shift)
    c = plan.configuration
    return Climb(
        step_scene(problem, float(rng.uniform(*FRICTION))),
        pose,
        four(angles),
        c.direction,
        critical_wheels(c),
        plan.target.travel,
    )


def pso_endings(height: float, name: str, searches: int) -> list[tuple[Array, float]]:
    """Final wheel angles (4,) and yaw error that the thesis's PSO plans, through its actuators,
    aiming at 0."""
    file = PROBLEMS / "smdw" / f"scenario_{SCENARIO[height]}_{name}.toml"
    problem = through_drives(load_problem(file), {"goal.wheels": [0.0, 0.0, 0.0, 0.0]})
    objective = terminal_objective(problem)
    found = []
    for seed in range(searches):
        x = minimize(objective, objective.bounds, optimizer="pso-thesis-enhanced", seed=seed).x
        end = objective.predict_exactly(x)
        wheels = np.array([float(np.squeeze(v)) for v in end.wheels]) + problem.start_wheels
        found.append((wheels, float(np.squeeze(end.yaw)) - problem.search.goal[2]))
    return found


def planned(
    engine: str,
    trials: int,
    workers: int,
    sources: Sequence[str] = SOURCES,
    files: Mapping[float, str] = FILES,
    known: Collection[tuple[str, ...]] = (),
) -> Iterator[list[Trial]]:
    """Climb rates from the states that planners reach, state errors the same for all; a list a
    cell.

    Cells in ``known`` (height, configuration, source) are left out.
    """
    for height, file in files.items():
        problem = load_problem(PROBLEMS / "smdw" / file)
        for configuration in configurations_of(problem):
            if configuration.name not in NAMES:
                continue
            name, plan = NAMES[configuration.name], plan_of(problem, configuration)
            exact = plan.trajectory.at(plan.duration).wheel_angles[0] + np.array(
                problem.start.wheels
            )
            searches = min(PSO_SEARCHES, trials) if "thesis PSO" in sources else 1
            endings = pso_endings(height, name, searches)
            for source in sources:
                if (str(height), name, source) in known:
                    continue
                climbs = []
                for n in range(trials):
                    rng = np.random.default_rng(
                        [n, round(height * 1e4), list(NAMES.values()).index(name)]
                    )
                    random = rng.uniform(-math.pi, math.pi, 4)
                    pso, turned = endings[n % len(endings)]
                    wheels = {"exact": exact, "thesis PSO": pso, "uniform": random}[source]
                    climbs.append(
                        climb_from(
                            problem, plan, wheels, rng, turned if source == "thesis PSO" else 0.0
                        )
                    )
                started = time.perf_counter()
                outcomes = climb_all(climbs, engine=engine, workers=workers)
                cost = (time.perf_counter() - started) / len(climbs)
                yield _rows("planned", engine, name, source, climbs, outcomes, cost)


def driven(engine: str, trials: int, workers: int) -> Iterator[list[Trial]]:
    """Climb rates after the exact plan was driven open loop from a start with errors; a list a
    cell."""
    for height, file in FILES.items():
        problem = load_problem(PROBLEMS / "smdw" / file)
        for configuration in configurations_of(problem):
            if configuration.name not in NAMES:
                continue
            plan = plan_of(problem, configuration)
            climbs, lost = [], []
            for n in range(trials):
                rng = np.random.default_rng([n, 7, round(height * 1e4)])
                climb = climb_from(problem, plan, np.zeros(4), rng)
                recording = run_approach(
                    climb.step, approach_command(problem, plan, rng), engine=engine
                )
                if recording.exploded:
                    lost.append(Outcome((False,) * 4, False, False, True, recording.reason, 0.0))
                    continue
                pose, wheels = reached(recording)
                climbs.append(
                    replace(climb, pose=before_step(problem, np.array(pose)), wheels=wheels)
                )
            outcomes = climb_all(climbs, engine=engine, workers=workers)
            yield _rows(
                "driven",
                engine,
                NAMES[configuration.name],
                "exact, open loop",
                climbs + climbs[:1] * len(lost),
                outcomes + lost,
            )


def phases(engine: str, runs: int, workers: int) -> Iterator[list[Trial]]:
    """Climbs over the phase at which the leading wheels meet the step, for torques and frictions; a
    list a row."""
    for file in FILES.values():
        problem = load_problem(PROBLEMS / "smdw" / file)
        for configuration in configurations_of(problem):
            if NAMES.get(configuration.name) not in ("lateral", "forward35"):
                continue
            for torque in TORQUES:
                for friction in FRICTIONS:
                    climbs = [
                        _at_phase(problem, configuration, float(phase), friction, torque, n)
                        for phase in PHASES
                        for n in range(runs)
                    ]
                    outcomes = climb_all(climbs, engine=engine, workers=workers)
                    labels = [f"{phase:+.2f}" for phase in PHASES for _ in range(runs)]
                    yield [
                        row
                        for label, climb, outcome in zip(labels, climbs, outcomes, strict=True)
                        for row in _rows(
                            "phases", engine, NAMES[configuration.name], label, [climb], [outcome]
                        )
                    ]


def _at_phase(
    problem: Problem,
    configuration: Configuration,
    phase: float,
    friction: float,
    torque: float,
    number: int,
) -> Climb:
    target = approach_target(problem, configuration, phase=configuration.window.middle)
    spin = np.sign(problem.robot.inverse @ np.array([*configuration.direction, 0.0]))
    wheels = np.array(target.wheels)
    critical = critical_wheels(configuration)
    for i in critical:
        wheels[i] += spin[i] * (phase - configuration.window.middle)
    rng = np.random.default_rng([number, 99])
    pose = np.array(target.pose) + rng.normal(0.0, [0.0005, 0.0005, math.radians(0.1)])
    return Climb(
        step_scene(problem, friction, torque),
        before_step(problem, pose),
        four(wheels),
        configuration.direction,
        critical,
        target.travel,
    )


def causes(engine: str, trials: int, workers: int) -> Iterator[list[Trial]]:
    """Climb rates over heading error, gap and approach speed, the others as planned; a list a
    cell."""
    for file in FILES.values():
        problem = load_problem(PROBLEMS / "smdw" / file)
        for configuration in configurations_of(problem):
            name = NAMES.get(configuration.name)
            if name not in CAUSES_TORQUES:
                continue
            for cause, values in CAUSES.items():
                for value in values:
                    climbs = [
                        _caused(problem, configuration, cause, value, n) for n in range(trials)
                    ]
                    yield _rows(
                        "causes",
                        engine,
                        name,
                        f"{cause}: {value:g}",
                        climbs,
                        climb_all(climbs, engine=engine, workers=workers),
                    )


def _caused(
    problem: Problem, configuration: Configuration, cause: str, value: float, number: int
) -> Climb:
    if cause == "gap, cm":
        problem = problem.replace({"climb.gap": value / 100})
    turned = math.radians(value) if cause == "heading error at the end, deg" else 0.0
    speed = value if cause == "approach speed, rad/s" else CLIMB_SPEED
    target, rng = approach_target(problem, configuration), np.random.default_rng([number, 101])
    errors = rng.normal([0.0, 0.0, turned], [POSITION_SD, POSITION_SD, YAW_SD])
    pose = np.array(target.pose) + errors
    wheels = np.array(target.wheels) + rng.normal(0.0, WHEEL_SD, 4)
    torque = CAUSES_TORQUES[NAMES[configuration.name]]
    start = before_step(problem, pose)
    return Climb(
        step_scene(problem, CAUSES_FRICTION, torque),
        start,
        four(wheels),
        configuration.direction,
        critical_wheels(configuration),
        travel_to_step(problem, configuration, start),
        speed,
    )


def _rows(
    part: str,
    engine: str,
    name: str,
    source: str,
    climbs: Sequence[Climb],
    outcomes: Sequence[Outcome],
    seconds: float = math.nan,
) -> list[Trial]:
    return [
        Trial(
            part,
            engine,
            c.step.height,
            name,
            source,
            n,
            c.step.friction,
            c.step.torque,
            o.critical_up,
            o.first_attempt,
            o.all_up,
            o.exploded,
            o.reason,
            seconds,
        )
        for n, (c, o) in enumerate(zip(climbs, outcomes, strict=True))
    ]


def rate_table(title: str, trials: Sequence[Trial]) -> ResultTable:
    """Rates with Wilson intervals, one row a cell, the thesis's count beside."""
    rows = []
    for key in dict.fromkeys((t.engine, t.height, t.configuration, t.source) for t in trials):
        cell = [t for t in trials if (t.engine, t.height, t.configuration, t.source) == key]
        shares = [
            _share(
                [bool(getattr(t, what)) for t in cell if not t.exploded],
                sum(t.exploded for t in cell),
            )
            for what in ("critical_up", "first_attempt", "all_up")
        ]
        cost = "" if math.isnan(cell[0].seconds) else f"{cell[0].seconds:.2f}"
        rows.append(
            (
                key[0],
                f"{100 * key[1]:g}",
                key[2],
                key[3],
                *(_text(s) for s in shares),
                str(shares[0].exploded),
                cost,
                "" if cell[0].part == "causes" else THESIS[key[2], key[1]],
            )
        )
    return ResultTable(
        title,
        (
            "engine",
            "step, cm",
            "configuration",
            "planned by",
            "critical wheels up",
            "first attempt",
            "all four up",
            "exploded",
            "s a trial",
            "thesis",
        ),
        rows,
    )


def _share(values: list[bool], exploded: int) -> Rate:
    return Rate(sum(values), len(values), exploded)


def _text(share: Rate) -> str:
    low, high = share.interval
    return f"{share.successes}/{share.trials} ({low:.2f}-{high:.2f})"


def phase_table(trials: Sequence[Trial]) -> ResultTable:
    """Critical wheels up over phase: one row a torque and friction."""
    rows = []
    labels = [f"{phase:+.2f}" for phase in PHASES]
    for key in dict.fromkeys(
        (t.engine, t.height, t.configuration, t.torque, t.friction) for t in trials
    ):
        cell = [
            t for t in trials if (t.engine, t.height, t.configuration, t.torque, t.friction) == key
        ]
        counts = []
        for label in labels:
            sound = [t for t in cell if t.source == label and not t.exploded]
            counts.append(f"{sum(t.critical_up for t in sound)}/{len(sound)}")
        rows.append((key[0], f"{100 * key[1]:g}", key[2], f"{key[3]:g}", f"{key[4]:g}", *counts))
    return ResultTable(
        "Critical wheels up over phase where the wheel meets the step (rad along the rotation)",
        ("engine", "step, cm", "configuration", "torque, N m", "friction", *labels),
        rows,
    )


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="2 trials a cell, part 'planned' only")
    parser.add_argument("--engine", default="mujoco", choices=("mujoco", "pybullet"))
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--runs", type=int, default=1, help="runs a cell of the phase map")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--parts", nargs="+", default=["planned", "driven", "phases", "causes"])
    parser.add_argument(
        "--sources", nargs="+", default=list(SOURCES), help="planners of part 'planned'"
    )
    parser.add_argument(
        "--heights", nargs="+", type=float, default=list(FILES), choices=list(FILES), help="m"
    )
    parser.add_argument(
        "--resume", action="store_true", help="keep the cells of the trial file of part 'planned'"
    )
    given = parser.parse_args(arguments)
    trials, parts = (2, ["planned"]) if given.quick else (given.trials, given.parts)
    name = f"climb_{given.engine}" + ("_quick" if given.quick else "")
    files = {height: FILES[height] for height in given.heights}
    cells: dict[str, list[Trial]] = {}
    for trial in kept(name) if given.resume else []:
        if trial.part == "planned" or trial.part not in parts:
            cells.setdefault(trial.part, []).append(trial)
    done = {(str(t.height), t.configuration, t.source) for t in cells.get("planned", [])}
    for part in parts:
        work = {
            "planned": lambda: planned(
                given.engine, trials, given.workers, given.sources, files, done
            ),
            "driven": lambda: driven(given.engine, trials, given.workers),
            "phases": lambda: phases(given.engine, given.runs, given.workers),
            "causes": lambda: causes(given.engine, given.trials, given.workers),
        }[part]()
        for rows in work:  # written after every cell, so that a run cut short is kept
            cells.setdefault(part, []).extend(rows)
            _keep(name, [row for cell in cells.values() for row in cell])
    publish(
        name, [_table(part, rows) for part, rows in cells.items()], packages=PACKAGES, notes=[NOTE]
    )


NOTE = (
    "A wheel is up when its centre stays risen by 0.7 of the step's height over the last 0.2 s. First attempt: "
    "within half a turn of meeting the step (forward: the leading wheel; lateral: both). Brackets: Wilson, 95 %. "
    f"Friction {FRICTION[0]}-{FRICTION[1]}, 8 N m, unless the row says otherwise. A heading error turns the robot "
    f"about its centre; where a corner then is within {1e3 * NEAREST:g} mm of the step the robot is moved back, so "
    "gaps and phases at contact change with it. Exploded runs are counted apart. "
    "Thesis: runs that climbed, in another simulator."
)


def _table(part: str, rows: Sequence[Trial]) -> ResultTable:
    if part == "phases":
        return phase_table(rows)
    titles = {
        "planned": "Sub-test 2 from planned states",
        "driven": "Sub-test 1 open loop, then sub-test 2",
        "causes": f"What else sets the rate: friction {CAUSES_FRICTION:g}, "
        + ", ".join(f"{name} at {torque:g} N m" for name, torque in CAUSES_TORQUES.items()),
    }
    return rate_table(titles[part], rows)


def kept(name: str) -> list[Trial]:
    """Trials that an earlier run wrote."""
    file = OUT / f"{name}_trials.csv"
    if not file.exists():
        return []
    with file.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    return [
        Trial(
            r["part"],
            r["engine"],
            float(r["height"]),
            r["configuration"],
            r["source"],
            int(r["number"]),
            float(r["friction"]),
            float(r["torque"]),
            r["critical_up"] == "True",
            r["first_attempt"] == "True",
            r["all_up"] == "True",
            r["exploded"] == "True",
            r["reason"],
            float(r.get("seconds") or math.nan),
        )
        for r in rows
    ]


def _keep(name: str, rows: Sequence[Trial]) -> None:
    OUT.mkdir(parents=True, exist_ok=True)
    with (OUT / f"{name}_trials.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(asdict(rows[0])))
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


if __name__ == "__main__":
    main()
