"""How exactly approaches end with feedback: `python -m benchmarks.closed_loop [--quick] [--trials N] [--engine E]`.

Random initial wheel angles (known to the planner), start errors up to 1 cm and 1 deg (unknown), friction 0.6-1.0; pose
measured at 20 Hz with 5 mm and 0.5 deg noise, or without noise. Every trial is seeded by its number.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.climb import step_scene
from benchmarks.common import PROBLEMS, ResultTable, publish
from trajopt.control.approach import Mode, Sensors, approach_controller
from trajopt.maneuver import Plan, configurations, plan_configuration
from trajopt.maneuver_problem import load_maneuver
from trajopt.simulate.climb import run_approach, wilson
from trajopt.simulate.engine import Command, Observation

CASES = (("step_5cm.toml", "lateral left"), ("step_5cm.toml", "forward -35 deg"),
         ("step_3_5cm.toml", "lateral left"), ("step_3_5cm.toml", "forward -35 deg"))
START = np.array([0.01, 0.01, math.radians(1.0)])  # m, m, rad: largest start errors (issue)
SETTLE = 1.0  # s after the planned end until errors are taken, chosen: stretched time ends within it
CAP = 30.0  # rad/s, wheel speed limit of the problems
NOISY, EXACT = Sensors(), Sensors(position=0.0, yaw=0.0)
# Tolerances of the issue: (position m, yaw rad, phase rad).
NOISY_BOUNDS = (0.01, math.radians(1.0), 0.1)
EXACT_BOUNDS = (0.005, math.radians(0.5), 0.06)


@dataclass(frozen=True)
class Ending:
    """Final errors: ``position`` m, ``yaw`` rad, ``phase`` rad (worst critical wheel, modulo a turn)."""

    position: float
    yaw: float
    phase: float
    exploded: bool

    def within(self, bounds: tuple[float, float, float]) -> bool:
        return not self.exploded and all(e <= b for e, b in zip((self.position, self.yaw, self.phase), bounds,
                                                                strict=True))


def trial(file: str, name: str, mode: Mode, sensors: Sensors, number: int, engine: str) -> Ending:
    """One approach under control."""
    rng = np.random.default_rng([number, 3])
    initial = rng.uniform(-math.pi, math.pi, 4)
    problem = load_maneuver(PROBLEMS / "smdw" / file).replace({"start.wheels": initial.tolist()})
    configuration = next(c for c in configurations(problem.robot.wheel, problem.obstacle) if c.name == name)
    plan = plan_configuration(problem, configuration)
    if not isinstance(plan, Plan):
        raise SystemExit(f"{file}, {name}, trial {number}: {plan.reason}")
    x, y, yaw = (float(v) for v in np.array(problem.start.pose) + rng.uniform(-1, 1, 3) * START)
    scene = step_scene(problem, float(rng.uniform(0.6, 1.0)))
    critical = plan.problem.goal.critical_indices
    controller = approach_controller(plan.trajectory, problem.platform, initial, critical, cap=CAP, sensors=sensors,
                                     mode=mode, rng=rng)

    def drive(t: float, seen: Observation) -> np.ndarray:
        heading = math.atan2(seen.rotation[1, 0], seen.rotation[0, 0])
        return controller.step(t, np.array([seen.position[0], seen.position[1], heading]), seen.wheel_angles)

    a, b, c, d = (float(v) for v in initial)
    command = Command(np.array([0.0, plan.duration]), np.zeros((2, 4)), (x, y, yaw), (a, b, c, d))
    recording = run_approach(scene, command, engine=engine, controller=drive, rest=SETTLE)
    pose = recording.pose[-1] - controller.goal.pose
    wheels = (recording.wheel_angles[-1] - controller.goal.wheels)[list(critical)]
    wheels = (wheels + math.pi) % (2 * math.pi) - math.pi
    turn = (pose[2] + math.pi) % (2 * math.pi) - math.pi
    return Ending(math.hypot(pose[0], pose[1]), abs(turn), float(np.abs(wheels).max()), recording.exploded)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="2 trials a row")
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--engine", default="mujoco", choices=("mujoco", "pybullet"))
    given = parser.parse_args(arguments)
    trials = 2 if given.quick else given.trials
    settings: tuple[tuple[str, Mode, Sensors, tuple[float, float, float]], ...] = (
        ("pose and phase, noisy", "pose and phase", NOISY, NOISY_BOUNDS),
        ("pose and phase, noiseless", "pose and phase", EXACT, EXACT_BOUNDS),
        ("pose only, noisy", "pose", NOISY, NOISY_BOUNDS),
        ("open loop", "open loop", NOISY, NOISY_BOUNDS))
    rows = []
    for label, mode, sensors, bounds in settings:
        for file, name in CASES:
            found = [trial(file, name, mode, sensors, n, given.engine) for n in range(trials)]
            good = sum(e.within(bounds) for e in found)
            low, high = wilson(good, trials)
            values = np.array([(1e3 * e.position, math.degrees(e.yaw), e.phase) for e in found if not e.exploded])
            middle, worst = np.median(values, axis=0), values.max(axis=0)
            rows.append((label, file.removesuffix(".toml"), name, f"{good}/{trials} ({low:.2f}-{high:.2f})",
                         *(f"{m:.3g} / {w:.3g}" for m, w in zip(middle, worst, strict=True)),
                         str(sum(e.exploded for e in found))))
            print(rows[-1], flush=True)
    table = ResultTable("Final errors of approaches, median / worst",
                        ("control", "problem", "configuration", "within bounds", "position, mm", "yaw, deg",
                         "phase, rad", "exploded"), rows)
    publish(f"closed_loop_{given.engine}" + ("_quick" if given.quick else ""), [table],
            packages=("numpy", "mujoco", "pybullet"),
            notes=["Bounds: 10 mm, 1 deg, 0.1 rad with measurement noise and open loop; 5 mm, 0.5 deg, 0.06 rad "
                   "without noise. Phase of open loop is that of a wheel servo that does not know the pose. Brackets: "
                   "Wilson, 95 %."])


if __name__ == "__main__":
    main()
