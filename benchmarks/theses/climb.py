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
import math
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.common import PROBLEMS, publish
from benchmarks.theses.climb_tables import CAUSES_FRICTION, CAUSES_TORQUES, NOTE, PHASES, table_of
from benchmarks.theses.climb_trials import (
    FILES,
    NAMES,
    POSITION_SD,
    WHEEL_SD,
    YAW_SD,
    Trial,
    climb_from,
    keep,
    kept,
    plan_of,
    trials_of,
)
from trajopt.arrays import Array
from trajopt.objectives.terminal import terminal_objective
from trajopt.optimize.search import minimize
from trajopt.problem import Problem, load_problem
from trajopt.systems.smdw.climb import CLIMB_SPEED, Climb, Outcome, climb_all, reached, run_approach
from trajopt.systems.smdw.configurations import (
    Configuration,
    approach_target,
    configurations_of,
    travel_to_step,
)
from trajopt.systems.smdw.thesis import through_drives
from trajopt.systems.smdw.trials import (
    approach_command,
    before_step,
    critical_wheels,
    four,
    step_scene,
)

SCENARIO = {0.035: 2, 0.05: 1}
PSO_SEARCHES = 5  # of the thesis's PSO, each serving an equal share of the trials
TORQUES, FRICTIONS = (2.0, 4.0, 8.0), (0.5, 0.8)
CAUSES = {
    "heading error at the end (deg)": (0.0, 2.0, 5.0, 10.0),
    "gap (cm)": (2.0, 5.0, 10.0, 20.0),
    "approach speed (rad/s)": (2.0, 4.0, 8.5, 15.0),
}
SOURCES = ("exact", "thesis PSO", "uniform")
PACKAGES = ("numpy", "mujoco", "pybullet")


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
                yield trials_of("planned", engine, name, source, climbs, outcomes, cost)


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
            yield trials_of(
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
                        for row in trials_of(
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
                    yield trials_of(
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
    if cause == "gap (cm)":
        problem = problem.replace({"climb.gap": value / 100})
    turned = math.radians(value) if cause == "heading error at the end (deg)" else 0.0
    speed = value if cause == "approach speed (rad/s)" else CLIMB_SPEED
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
            keep(name, [row for cell in cells.values() for row in cell])
    publish(
        name,
        [table_of(part, rows) for part, rows in cells.items()],
        packages=PACKAGES,
        notes=[NOTE],
    )


if __name__ == "__main__":
    main()
