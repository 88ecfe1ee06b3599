"""Sweep files: each line is checked, problems and run functions are found."""

from __future__ import annotations

import json
import time
import tomllib
from pathlib import Path

import pytest

from trajopt.errors import ProblemError
from trajopt.sweeps.runfunction import name_of, packed, unpacked
from trajopt.sweeps.sweepfile import RUN_CASE, load_sweep, sweep_schema

ROOT = Path(__file__).resolve().parents[2]


def test_example_sweep_files_load() -> None:
    files = sorted((ROOT / "problems/sweeps").glob("*.toml"))
    assert files
    for file in files:
        assert len(load_sweep(file).table) > 1


RUN = 'run = "tests.sweeps.run_functions:cheap"\n'
AXES = "[axes.x]\nvalues = [1, 2]\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[axes]\nx = 3", "axes.x = 3: expected a table"),
        ("axes = 3", "axes = 3: expected a table"),
        ("solve = 1\n" + AXES, "solve = 1: expected a table"),
        ("derived = []\n" + AXES, r"derived = \[\]: expected a table"),
        ("exclude = [1]\n" + AXES, r"exclude\[0\] = 1: expected a valid string"),
        ('time_limit = "1 h"\n' + AXES, "time_limit = '1 h': expected a valid number"),
        ("time_limit = -1\n" + AXES, "time_limit = -1: expected greater than 0"),
        ('memory_limit = "much"\n' + AXES, "memory_limit = 'much': expected bytes"),
        ('memory_limit = "1.2.3 GB"\n' + AXES, "memory_limit"),
        ("memory_limit = -5\n" + AXES, "memory_limit = -5"),
        ("code = 1\n" + AXES, "code = 1"),
        ("title = 1\n" + AXES, "title = 1"),
        ("problem = 1\n" + AXES, "problem = 1"),
        ("run = 1\n", "run = 1"),
        ("[axes.x]\nvalues = 3", "axes.x.values = 3: expected an array"),
        ("[axes.x]\nvalues = []", r"axes.x.values = \[\]"),
        ("[axes.x]\nvalue = [1]", "axes.x.value = .*the nearest is 'values'"),
        ("[axes.x]\nvalues = [nan]", "nan|NaN"),
        ("[axes.x]\nvalues = [inf]", "finite number"),
        (f"[axes.x]\nvalues = [{2**63}]", "64 bits"),
        (f"[axes.x]\nvalues = [{'9' * 5000}]", "digits"),
        ("[axes.x]\nvalues = [2020-01-01]", "is a date"),
        ("[axes.x]\nrange = [0, 1, 1.5]", r"axes.x.range\[2\] = 1.5"),
        ("[axes.x]\nrange = [0, 1, 100000000]", r"axes.x.range\[2\]"),
        ("[axes.x]\nrange = [-1e308, 1e308, 3]", "axes.x"),
        ("[axes.x]\nlog = [0, 1, 3]", "axes.x.log"),
        ("[axes.x]\nrange = [0, 1, 3]\nvalues = [1]", "axes.x = .*one of values, range"),
        ("[axes.x.y]\nvalues = [1]", r"axes.x.y = .*quoted name"),
        ("[axes.x]\nrandom = {uniform = [1, 0], count = 2, seed = 0}", "axes.x.random = "),
        ("[axes.x]\nrandom = {uniform = [0, 1], count = 2}", "axes.x.random.seed = 'missing'"),
        ("[axes.x]\nrandom = {gauss = [0, 1], count = 2, seed = 1}", "axes.x.random.gauss"),
        ('[axes.""]\nvalues = [1]', "1 to 200 printable"),
        ('[axes."a\\u0000b"]\nvalues = [1]', "1 to 200 printable"),
        ('[axes.a]\nvalues = [1]\n[axes."a.b"]\nvalues = [1]', "axes.a = 'a.b'"),
        ('[axes."x"]\nvalues = [1]\n[derived]\n"x.y" = "x"', "axes.x = 'x.y'"),
        ("[sample]\nmethod = 'best'\ncount = 1\nseed = 1\naxes = {}", "sample.method = 'best'"),
        ("[sample]\nmethod = 'random'\ncount = 1\nseed = 1\naxes = {}", "sample.axes"),
        ("[derived]\ny = 3\n" + AXES, "derived.y = 3: expected a valid string"),
        ("[derived]\ny = 'x +'\n" + AXES, r"derived.y = 'x \+'"),
        ("[derived]\ny = '10**10**8'\n" + AXES, "derived.y"),
        ("exclude = 'z > 1'\n" + AXES, r"exclude\[0\] = 'z > 1'.*none of the names x"),
        ("a = " + "[" * 6000 + "]" * 6000, "nest"),
        (".".join("a" * 20_000) + " = 1", "at most 32 parts"),
        ("[" + ".".join(["'a'"] * 20_000) + "]", "at most 32 parts"),
        ("a = " + "9" * 5000, "digits"),
        ("\0", "valid TOML"),
        ("#" + "x" * 1_000_001, "larger than 1,000,000 bytes"),
    ],
)
def test_every_line_of_a_sweep_file_is_checked(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "sweep.toml"
    file.write_text(text if "run = " in text else RUN + text)
    started = time.process_time()
    with pytest.raises(ProblemError, match=words) as told:
        load_sweep(file)
    assert time.process_time() - started < 2.0
    assert str(told.value).startswith(f"{file}: ")
    assert "\n" not in str(told.value)
    assert len(str(told.value)) < 1000


def test_files_that_cannot_be_read_are_told(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "latin").write_bytes(b"title = '\xe4'")
    for name in ("", "loop", "missing", "nul\0", "latin", "x" * 300, "/dev/zero", "/dev/null"):
        with pytest.raises(ProblemError):
            load_sweep(tmp_path / name)
    for value in (3, None, b"x", [1]):
        with pytest.raises((ProblemError, TypeError)):
            load_sweep(value)


def test_the_schema_of_sweep_files_holds_the_shipped_ones() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    kept = (ROOT / "problems" / "sweeps" / "sweep.schema.json").read_text()
    assert kept == sweep_schema()
    for file in (ROOT / "problems" / "sweeps").glob("*.toml"):
        jsonschema.validate(tomllib.loads(file.read_text()), json.loads(kept))


def sweep_file(folder: Path, text: str) -> Path:
    file = folder / "sweep.toml"
    file.write_text(f'problem = "{ROOT}/problems/smdw/scenario_1_lateral.toml"\n' + text)
    return file


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("bad = 1", "bad"),
        ('[axes."ground.frictoin"]\nvalues = [1.0]', "'friction'"),
        ("[axes.height]\nvalues = [1.0]", "height"),
        ('[axes."ground.friction"]\nvalues = [-1.0]', "a number > 0"),
        ('[axes."run.optimiser"]\nvalues = ["pso"]', "run.optimizer"),
        ('[axes."run.seed"]\nvalues = [0.5, 1.0]', "run.seed = 0.5"),
        ('solve.engine = "bullet"', "run.engine = 'bullet': expected one of none, pybullet"),
        ("solve.evaluation = 9", "run.evaluation = 9: expected one of run.optimizer"),
        ('solve.engine = "none"\n[axes."run.engine"]\nvalues = ["none"]', "each name once"),
        ('exclude = ["x >"]\n[axes."ground.friction"]\nvalues = [1.0]', "x >"),
        (
            'exclude = ["ground.friction > 0"]\n[axes."ground.friction"]\nvalues = [1.0]',
            "at least one case",
        ),
    ],
)
def test_wrong_sweep_files_are_told(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        load_sweep(sweep_file(tmp_path, text))


def test_problem_changes_identity(tmp_path: Path) -> None:
    text = '[axes."ground.friction"]\nvalues = [0.3, 0.4]\n'
    one = load_sweep(sweep_file(tmp_path, text)).table.ids
    two = load_sweep(sweep_file(tmp_path, text + "[solve]\noptimizer = 'pso'\n")).table.ids
    assert not set(one.tolist()) & set(two.tolist())


def test_solve_is_short_for_an_axis_of_one_value(tmp_path: Path) -> None:
    axis = '[axes."ground.friction"]\nvalues = [0.3, 0.4]\n'
    short = load_sweep(sweep_file(tmp_path, axis + "[solve]\nevaluations = 7\n")).table
    long = axis + '[axes."run.evaluations"]\nvalues = [7]\n'
    assert set(short.ids.tolist()) == set(load_sweep(sweep_file(tmp_path, long)).table.ids.tolist())
    assert [c["run.evaluations"] for c in short.rows()] == [7, 7]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[axes.x]\nvalues = [1]", "problem"),
        (f'run = "{RUN_CASE}"\n[axes.x]\nvalues = [1]', "problem"),
        ('run = "tests.sweeps.run_functions"\n[axes.x]\nvalues = [1]', "module:function"),
        ('run = "tests.sweeps.run_functions:nothing"\n[axes.x]\nvalues = [1]', "nothing"),
        (
            'run = "tests.sweeps.run_functions:cheap"\nsolve.seed = 1\n[axes.x]\nvalues = [1]',
            "no such table",
        ),
        (
            f'problem = "{ROOT}/problems/smdw/step_5cm.toml"\n'
            'run = "tests.sweeps.run_functions:friction"\n[axes."run.seed"]\nvalues = [1]',
            "a name without a dot",
        ),
    ],
)
def test_wrong_run_functions_are_told(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "sweep.toml").write_text(text)
    with pytest.raises(ProblemError, match=words):
        load_sweep(tmp_path / "sweep.toml")


@pytest.mark.parametrize(
    ("file", "key"),
    [
        ("smdw/scenario_1_lateral", "ground.friction"),
        ("smdw/step_5cm", "ground.friction"),
        ("powerbot/experiment_1", "ground.friction"),
    ],
)
def test_a_function_gets_the_problem_of_its_case(tmp_path: Path, file: str, key: str) -> None:
    (tmp_path / "sweep.toml").write_text(
        f'problem = "{ROOT}/problems/{file}.toml"\nrun = "tests.sweeps.run_functions:friction"\n'
        f'[axes."{key}"]\nvalues = [0.25, 0.5]\n[axes.factor]\nvalues = [2.0]\n'
    )
    plan = load_sweep(tmp_path / "sweep.toml")
    assert [plan.run(case) for case in plan.table.rows()] == [0.5, 1.0]
    assert name_of(plan.run) == "tests.sweeps.run_functions:friction"
    assert name_of(unpacked(packed(plan.run))) == name_of(plan.run)
