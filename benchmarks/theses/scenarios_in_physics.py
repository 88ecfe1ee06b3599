"""How far physics is from the plan on the thesis's problems: `python -m
benchmarks.theses.scenarios_in_physics`.

Each problem with P1 and P2 free, exact wheel angles, time-scaled, driven open loop in both engines.
"""

from __future__ import annotations

import numpy as np

from benchmarks.common import PROBLEMS, ResultTable, publish
from trajopt.pipeline import solve, validate
from trajopt.problem import load_problem
from trajopt.systems.smdw.thesis import DURATIONS

HEADER = (
    "engine",
    "problem",
    "path m",
    "end off mm",
    "yaw off mrad",
    "worst wheel mrad",
    "most off the path mm",
)


def main() -> None:
    """Print the table and write it."""
    rows = []
    changes = {"actuator": None, "infeasible": None, "spline.free": ["p1", "p2"]}
    for name in sorted(DURATIONS):
        file = PROBLEMS / "smdw" / f"{name}.toml"
        problem = load_problem(file, changes)
        trajectory = solve(problem).trajectory
        assert trajectory is not None
        for engine in ("pybullet", "mujoco"):
            report = validate(trajectory, problem, engine=engine)
            rows.append(
                (
                    engine,
                    file.stem,
                    f"{report.length:.2f}",
                    f"{1e3 * report.final_distance:.1f}",
                    f"{1e3 * report.yaw:+.1f}",
                    f"{1e3 * np.abs(report.wheel_deviation).max():.1f}",
                    f"{1e3 * report.path_max:.1f}",
                )
            )
    table = ResultTable("Open loop, P1 and P2 free", HEADER, sorted(rows))
    publish("scenarios_in_physics", [table], packages=("trajopt", "numpy", "pybullet", "mujoco"))


if __name__ == "__main__":
    main()
