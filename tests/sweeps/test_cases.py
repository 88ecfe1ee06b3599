"""Cases, identities, axes, expressions, sweep files."""

from __future__ import annotations

import json
import math
import time
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trajopt.errors import ArgumentError, ProblemError
from trajopt.schema import validated
from trajopt.sweeps.axes import combined, with_derived
from trajopt.sweeps.cases import case_table, identity_base
from trajopt.sweeps.expressions import evaluate, parse
from trajopt.sweeps.runfunction import name_of, packed, unpacked
from trajopt.sweeps.sweepfile import RUN_CASE, SweepFile, load_sweep, sweep_schema

ROOT = Path(__file__).resolve().parents[2]

values = st.one_of(
    st.integers(-(2**62), 2**62),
    st.floats(allow_nan=False, allow_infinity=False),
    st.booleans(),
    st.text(max_size=5),
    st.none(),
)


@given(
    st.lists(
        st.fixed_dictionaries({"a": st.integers(-5, 5), "b": values}), min_size=1, max_size=20
    ),
    st.randoms(),
)
def test_identity_depends_on_content_only(cases: list[dict[str, Any]], random: Any) -> None:
    shuffled = list(cases)
    random.shuffle(shuffled)
    turned = [{"b": c["b"], "a": c["a"]} for c in shuffled]
    one, two = case_table(cases, b"x"), case_table(turned, b"x")
    assert sorted(one.ids.tolist()) == sorted(two.ids.tolist())


def test_identity_sees_every_part() -> None:
    def ids(run: str = "m:f", problem: Any = None, **case: Any) -> bytes:
        return bytes(case_table([case], identity_base(run, problem)).ids[0])

    found = {
        ids(x=1),
        ids(x=2),
        ids(y=1),
        ids(x="1"),
        ids(x=True),
        ids(x=None),
        ids(x=[1]),
        ids(run="m:g", x=1),
        ids(problem={"a": 1}, x=1),
        ids(x=1, y=1),
    }
    assert len(found) == 10
    assert ids(x=-0.0) == ids(x=0.0)
    assert ids(x=np.float64(0.1)) == ids(x=0.1)
    assert ids(x=np.array([1.0, 2.0])) == ids(x=(1.0, 2.0))


def test_identity_stays_as_it_is_stored() -> None:
    """Stores on disk hold these identities: a change of the rule must change the store's format."""
    base = identity_base("module:function", {"a": 1.5})
    assert case_table([{"x": 1, "y": "z"}], base).ids[0] == b"ca6e188dbfd296852b06c91a032193a3"


def test_seeds_and_streams_follow_the_identity() -> None:
    cases = case_table([{"x": i} for i in range(100)]).rows()
    assert len({c.seed for c in cases}) == 100
    assert all(0 <= c.seed < 2**63 for c in cases)
    assert cases[3].rng().random() == cases[3].rng().random()
    assert cases[3].rng().random() != cases[4].rng().random()


def test_equal_cases_appear_once() -> None:
    table = case_table([{"x": 1}, {"x": 2}, {"x": 1}])
    assert [c["x"] for c in table.rows()] == [1, 2]


@pytest.mark.parametrize(
    "bad", [[{"x": 1}, {"y": 1}], [{"x": math.nan}], [{"x": object()}], [{"x": 2**70}], [3]]
)
def test_bad_cases_are_refused(bad: Any) -> None:
    with pytest.raises(ArgumentError):
        case_table(bad)


def columns_of(**tables: Any) -> dict[str, Any]:
    """Columns of the axes (and sample) of a file with these tables."""
    file = validated(SweepFile, tables, "file")
    return combined(file.axes, file.sample)


def axis_values(name: str, axis: dict[str, Any]) -> Any:
    return columns_of(axes={name: axis})[name]


def test_product_zip_and_order() -> None:
    columns = columns_of(
        axes={
            "a": {"values": [1, 2]},
            "b": {"values": [10, 20, 30], "zip": "g"},
            "c": {"values": ["x", "y", "z"], "zip": "g"},
        }
    )
    rows = list(zip(*(columns[k].tolist() for k in "abc"), strict=True))
    assert rows == [
        (1, 10, "x"),
        (1, 20, "y"),
        (1, 30, "z"),
        (2, 10, "x"),
        (2, 20, "y"),
        (2, 30, "z"),
    ]


def test_ranges() -> None:
    np.testing.assert_allclose(axis_values("a", {"range": [0, 1, 5]}), [0, 0.25, 0.5, 0.75, 1])
    np.testing.assert_allclose(axis_values("a", {"log": [1, 1000, 4]}), [1, 10, 100, 1000])


def test_random_draws_have_their_distribution_and_seed() -> None:
    spec = {"random": {"uniform": [2.0, 4.0], "count": 4000, "seed": 1}}
    draws = axis_values("a", spec)
    assert draws.min() >= 2
    assert draws.max() <= 4
    assert abs(draws.mean() - 3) < 4 * (2 / math.sqrt(12)) / math.sqrt(4000)
    np.testing.assert_array_equal(draws, axis_values("a", spec))
    assert not np.array_equal(draws, axis_values("b", spec))
    normal = axis_values("a", {"random": {"normal": [1.0, 0.5], "count": 4000, "seed": 1}})
    assert abs(normal.mean() - 1) < 0.04
    assert abs(normal.std() - 0.5) < 0.03


@pytest.mark.parametrize("method", ["latin-hypercube", "sobol"])
def test_joint_samples_fill_every_stratum(method: str) -> None:
    columns = columns_of(
        sample={
            "method": method,
            "count": 64,
            "seed": 3,
            "axes": {"x": {"uniform": [0.0, 64.0]}, "y": {"uniform": [0.0, 64.0]}},
        },
    )
    for name in "xy":
        assert sorted(np.floor(columns[name]).astype(int).tolist()) == list(range(64))


def test_derived_and_excluded() -> None:
    columns = with_derived(
        columns_of(axes={"a.b": {"values": [1, 2, 3]}, "c": {"values": [0, 1]}}),
        {"d": "[a.b + c, 2 * a.b]"},
        ["a.b == 2 and c > 0"],
    )
    assert columns["d"].tolist() == [[1, 2], [2, 2], [2, 4], [3, 6], [4, 6]]


@pytest.mark.parametrize(
    "axis",
    [
        {},
        {"values": []},
        {"range": [0, 1]},
        {"log": [0, 1, 3]},
        {"values": [1], "x": 2},
        {"random": {"uniform": [1, 0], "count": 2, "seed": 0}},
        {"random": {"uniform": [0, 1], "count": 2}},
    ],
)
def test_bad_axes_are_refused(axis: dict[str, Any]) -> None:
    with pytest.raises(ProblemError, match=r"axes\.a"):
        axis_values("a", axis)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * x ** 2", 19),
        ("-x if x > 5 else x / 2", 1.5),
        ("max(x, 10) % 4", 2),
        ("not (x < 3) and 1 < x <= 3", True),
        ("[sin(pi), x]", [math.sin(math.pi), 3]),
        ("p.q - 1", 6),
        ("'a' == 'a'", True),
    ],
)
def test_expressions(text: str, value: Any) -> None:
    assert evaluate(parse("key", text), {"x": 3, "p.q": 7}) == value


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os')",
        "x.__class__",
        "(lambda: 1)()",
        "[i for i in x]",
        "open('f')",
        "unknown",
        "x[0]",
        "1 / 0",
        "x +",
        "f'{x}'",
        "10**10**8",
        "'%1000000000d' % 3",
        "-" * 3000 + "3",
        "-" * 300 + "3",
        "(" * 250 + "3" + ")" * 250,
        "+".join(["1"] * 600),
        "9" * 5000,
        "2 ** 64",
        "2 ** 63",
        "9223372036854775807 + 1",
        "1e308 * 10",
        "(-8) ** 0.5",
        "[1] * 1000000000",
        "'a' * 1000000000",
        "round(5, -1000000000)",
        "floor(1e300)",
        "exp(1000)",
        "sqrt(-1)",
        "min([])",
        "max('ab')",
        "x < 'a'",
        "x\0",
        "",
        "x" * 3000,
    ],
)
def test_expressions_run_no_code_and_stay_small(text: str) -> None:
    with pytest.raises(ArgumentError, match="key"):
        evaluate(parse("key", text), {"x": 3})


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
        ("#" + "x" * 1_000_001, "at most 1000000 bytes"),
    ],
)
def test_every_line_of_a_sweep_file_is_checked(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "sweep.toml"
    file.write_text(text if "run = " in text else RUN + text)
    started = time.perf_counter()
    with pytest.raises(ProblemError, match=words) as told:
        load_sweep(file)
    assert time.perf_counter() - started < 2.0
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
        ('[axes."ground.friction"]\nvalues = [-1.0]', "greater than 0"),
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
