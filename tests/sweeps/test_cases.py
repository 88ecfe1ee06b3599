"""Cases, identities, axes, expressions."""

from __future__ import annotations

import math
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
from trajopt.sweeps.sweepfile import SweepFile

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
