"""The pictures that README.md, docs/routes.md and docs/ground.md show.

python -m benchmarks.readme_pictures                                rewrites docs/pictures/ but for
the sweep python -m benchmarks.readme_pictures --climb out/sweeps/climb_rate  the two of the climb
rate study, from its store
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from pathlib import Path

from benchmarks.theses.smdw_rate_pictures import rate_lines, rate_maps
from trajopt.pipeline import solve, validate
from trajopt.problem import load_problem
from trajopt.report.pictures import save_physics_picture, save_pictures
from trajopt.report.run_folder import write_solution, write_validation
from trajopt.report.style import in_style, save_figure
from trajopt.report.viewer.motion_page import VIEW
from trajopt.report.viewer.record import record
from trajopt.sweeps.store import open_store

FOLDER = Path("docs/pictures")
PROBLEM = Path("problems/smdw/scenario_1_lateral.toml")
# Of docs/routes.md, docs/ground.md and docs/paths.md: problem, picture of its run folder, name here.
ON_GROUND = (
    (Path("problems/map/lab.toml"), "path.png", "lab.png"),
    (Path("problems/car/hill.toml"), "loads.png", "hill_loads.png"),
    (Path("problems/car/bay.toml"), "path.png", "bay.png"),
    (Path("problems/asoc/field.toml"), "path.png", "field_path.png"),
)


def approach() -> None:
    """Solve one scenario, check it in physics, and keep its pictures, one of them moving: what ``trajopt solve``,
    ``trajopt validate`` and ``trajopt view --gif`` write."""
    problem = load_problem(PROBLEM, {"spline.free": ["p1", "p2"]})
    solution = solve(problem)
    assert solution.trajectory is not None
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_solution(solution, folder, seed=0, pictures="png")
        report = validate(solution.trajectory, problem, picture=True)
        write_validation(report, folder, problem.robot)
        save_physics_picture(solution, report, folder)
        print(f"wrote {record(folder / VIEW, FOLDER / 'run.gif', size=(720, 400))}")
        for picture in ("path.png", "profile.png", "physics.png"):
            shutil.copy(folder / picture, FOLDER / picture)
            print(f"wrote {FOLDER / picture}")


def on_ground() -> None:
    """Solve problems on a map and on sloping ground, and keep a picture of each."""
    for file, picture, kept in ON_GROUND:
        with tempfile.TemporaryDirectory() as name:
            save_pictures(solve(load_problem(file)), name)
            shutil.copy(Path(name) / picture, FOLDER / kept)
            print(f"wrote {FOLDER / kept}")


def climb_rates(store: Path) -> None:
    """Draw the climb rate study from its store, and say its main numbers."""
    frame = open_store(store, create=False).frame()
    with in_style():
        for name, figure in (
            ("climb_rate_map.png", rate_maps(frame)),
            ("climb_rate_lines.png", rate_lines(frame)),
        ):
            print(f"wrote {save_figure(figure, FOLDER / name)}")
    sound = frame[frame["status"] == "done"].dropna(subset=["climbed"])
    print(f"{len(frame)} rows, {len(sound)} trials count")
    for column in ("obstacles.step.height", "friction", "heading_error", "torque"):
        print(
            sound.pivot_table(index=column, columns="configuration", values="climbed")
            .mul(100)
            .round(1)
            .to_string()
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--climb", type=Path, help="store of problems/sweeps/climb_rate.toml")
    options = parser.parse_args()
    FOLDER.mkdir(parents=True, exist_ok=True)
    if options.climb is not None:
        climb_rates(options.climb)
    else:
        approach()
        on_ground()


if __name__ == "__main__":
    main()
