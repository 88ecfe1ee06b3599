"""A Mecanum robot that must arrive with given wheel angles: the swarm, IPOPT and SciPy by seeds."""

from pathlib import Path
from statistics import median

import trajopt

problems = Path(__file__).parents[2] / "problems"
problem = trajopt.load_problem(problems / "smdw" / "table_5_3.toml")
budget = trajopt.Budget(evaluations=4000)
for optimizer in ("pso", "ipopt", "slsqp", "lattice"):
    found = [
        trajopt.solve(problem, optimizer=optimizer, seed=seed, budget=budget) for seed in range(5)
    ]
    costs = [solution.cost for solution in found]
    seconds = [solution.wall_time for solution in found]
    print(
        f"{optimizer:8} cost {median(costs):.1e} (worst {max(costs):.1e}), {median(seconds):.2f} s"
    )
