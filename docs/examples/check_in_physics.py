"""Drive a planned motion in a physics engine with real rollers, without and with feedback."""

from pathlib import Path

import trajopt

problems = Path(__file__).parents[2] / "problems"
problem = trajopt.load_problem(problems / "smdw" / "table_5_3.toml")
solution = trajopt.solve(problem)
for control in (None, "pose and phase"):
    report = trajopt.validate(solution.trajectory, problem, control=control)
    print(
        f"{control or 'open loop'}: {1000 * report.final_distance:.1f} mm off, "
        f"wheels up to {abs(report.wheel_deviation).max():.3f} rad off ({report.engine})"
    )
