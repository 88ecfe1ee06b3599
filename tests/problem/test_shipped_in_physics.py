"""Every shipped problem, from its file to a run folder and through both engines, as a user
would."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from trajopt.cli import app
from trajopt.problem import load_problem

ROOT = Path(__file__).parents[2]
SWEEPS = sorted((ROOT / "problems" / "sweeps").glob("*.toml"))
FILES = sorted(set((ROOT / "problems").glob("*/*.toml")) - set(SWEEPS))
# Share of the way that physics may be off with the planned wheel speeds alone: 3 % on wheels that
# hold; a problem that is infeasible breaks its limits, and the thesis's PowerBot problems plan
# beyond what its drive wheels can brake on (their slip limit is unsafe downhill and at the goal),
# so only their report counts.
NEAR = 0.03


def run(*arguments: str) -> str:
    done = CliRunner().invoke(app, list(arguments))
    assert done.exit_code in (0, 1), done.output
    return done.output


@pytest.mark.slow
@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}-{file.stem}")
def test_it_is_solved_drawn_and_driven(file: Path, tmp_path: Path) -> None:
    problem = load_problem(file)
    out = tmp_path / "run"
    run("solve", str(file), "--out", str(out))
    told = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert told["holds"] == (problem.infeasible is None), told["status"]
    for name in ("trajectory.csv", "path.png", "profile.png", "loads.png", "problem.toml"):
        assert (out / name).stat().st_size > 200, name
    for engine in ("mujoco", "pybullet"):
        run("validate", str(out), "--engine", engine)
        report = json.loads((out / "validation.json").read_text(encoding="utf-8"))
        assert report["engine"] == engine
        if problem.limits_section.variant is None and problem.infeasible is None:
            assert report["final_distance_m"] <= NEAR * report["length_m"], report
            # what steers follows the plan; castors that trail come close to it
            for name, error in report["steering_error_rad"].items():
                kind = next(w.kind for w in problem.robot.description.wheels if w.name == name)
                assert error <= (0.01 if kind == "steered" else 0.15), (name, error)
        if problem.infeasible is None:
            assert report["contacts"] == []


def first_cases(file: Path, folder: Path) -> Path:
    """The sweep file with the first value of every axis but the first, which keeps two."""
    sweep = tomllib.loads(file.read_text(encoding="utf-8"))
    if "problem" in sweep:
        sweep["problem"] = str((file.parent / sweep["problem"]).resolve())
    kept = {}
    for i, (name, axis) in enumerate(sweep.pop("axes").items()):
        values = axis.get("values") or (axis.get("range") or axis["log"])[:2]
        kept[name] = {"values": values[: 2 if i == 0 else 1]}
    tables = {"axes": kept, **{k: v for k, v in sweep.items() if isinstance(v, dict)}}
    plain = {k: v for k, v in sweep.items() if k not in tables}
    lines = [f"{key} = {toml(value)}" for key, value in {**plain, **tables}.items()]
    made = folder / file.name
    made.write_text("\n".join(lines), encoding="utf-8")
    return made


def toml(value: object) -> str:
    if isinstance(value, dict):
        pairs = (f"{json.dumps(key)} = {toml(inner)}" for key, inner in value.items())
        return "{ " + ", ".join(pairs) + " }"
    return json.dumps(value)


@pytest.mark.slow
@pytest.mark.parametrize("file", SWEEPS, ids=lambda file: file.stem)
def test_a_sweep_file_runs(file: Path, tmp_path: Path) -> None:
    """Counted whole, and two cases of it run."""
    assert "cases" in run("sweep", "run", str(file), "--dry-run")
    store = tmp_path / "store"
    run("sweep", "run", str(first_cases(file, tmp_path)), "--store", str(store))
    run("sweep", "export", str(store), str(tmp_path / "table.csv"))
    table = pd.read_csv(tmp_path / "table.csv")
    assert len(table) == 2
    assert set(table["status"]) == {"done"}
