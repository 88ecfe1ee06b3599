"""A sweep over two keys of a problem, interrupted and resumed: what is finished stays."""

from itertools import product
from pathlib import Path

import trajopt
from trajopt.pipeline import solve
from trajopt.problem import load_problem

PROBLEM = Path(__file__).parents[2] / "problems" / "powerbot" / "across_slope.toml"


def run(case):
    changes = {"ground.friction": case["friction"], "limits.speed": case["speed"]}
    return {"duration": solve(load_problem(PROBLEM, changes)).duration}


if __name__ == "__main__":  # workers are new processes
    cases = [
        {"friction": mu, "speed": v} for mu, v in product((0.4, 0.6, 0.8), (0.5, 1.0, 1.5, 2.0))
    ]
    trajopt.sweep(cases[:5], run, executor=2, store="friction_and_speed")  # as if it ended here
    store = trajopt.sweep(cases, run, executor=2, store="friction_and_speed")
    print(store.counts(), "in", len(store.runs()), "runs")
    print(store.frame().pivot(index="friction", columns="speed", values="duration").round(3))
