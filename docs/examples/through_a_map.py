"""My map, my robot: from a floor plan of polygons to the fastest motion that keeps clear of it."""

from pathlib import Path

import trajopt

problems = Path(__file__).parents[2] / "problems"
changes = {"goal.pose": [8.5, 2.0, -1.57], "limits.clearance": 0.1}
problem = trajopt.load_problem(problems / "map" / "crossing.toml", changes)
solution = trajopt.solve(problem)
clearance = solution.route.best.clearance
print(f"{solution.duration:.3f} s over {solution.trajectory.path.length:.2f} m")
print(f"nearest to anything: {clearance.distance:.3f} m, to the {clearance.name}")
for attempt in solution.route.attempts:
    print(attempt.method, attempt.why or f"{attempt.trajectory.duration:.3f} s")
