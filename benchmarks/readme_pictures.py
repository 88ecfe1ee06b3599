"""The pictures that README.md shows: `python -m benchmarks.readme_pictures` rewrites docs/pictures/."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from trajopt.pipeline import solve, validate
from trajopt.problem import load_problem
from trajopt.report.pictures import save_physics_picture, save_pictures

FOLDER = Path("docs/pictures")
PROBLEM = Path("problems/smdw/scenario_1_lateral.toml")


def main() -> None:
    """Solve one scenario, check it in physics, and keep its pictures."""
    problem = load_problem(PROBLEM, {"spline.free": ["p1", "p2"]})
    solution = solve(problem)
    assert solution.trajectory is not None
    FOLDER.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        save_pictures(solution, folder)
        save_physics_picture(solution, validate(solution.trajectory, problem, picture=True), folder)
        for picture in ("path.png", "profile.png", "physics.png"):
            shutil.copy(folder / picture, FOLDER / picture)
            print(f"wrote {FOLDER / picture}")


if __name__ == "__main__":
    main()
