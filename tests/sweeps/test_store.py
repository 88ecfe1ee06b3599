"""The store: durable parts, one row a case, versions, compaction, writers at once."""

from __future__ import annotations

import json
import os
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.sweeps.run_functions import noop
from trajopt.errors import ArgumentError
from trajopt.files import seal
from trajopt.sweeps.cases import Case, CaseTable, case_table
from trajopt.sweeps.host import parameter_kinds
from trajopt.sweeps.parts import StoreError, rows_in
from trajopt.sweeps.rows import (
    DONE,
    ERROR,
    Origin,
    Row,
    array_table,
    result_kinds,
    results_of,
    row_table,
)
from trajopt.sweeps.store import Store, open_store
from trajopt.sweeps.sweeps import sweep
from trajopt.sweeps.upkeep import align


def write(store: Store, cases: CaseTable, rows: list[Row], name: str = "chunk") -> None:
    kinds = result_kinds(rows, {})
    beside = array_table(rows, cases)
    if beside is not None:
        store.write_part("arrays", name, beside)
    origin = Origin("run", "code", "host")
    store.write_part("parts", name, row_table(rows, cases, parameter_kinds(cases), kinds, origin))


@pytest.fixture
def cases() -> CaseTable:
    return case_table([{"x": i, "kind": "ab"[i % 2], "place": [float(i), 1.0]} for i in range(10)])


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return open_store(tmp_path / "store")


def test_rows_come_back(store: Store, cases: CaseTable) -> None:
    write(
        store,
        cases,
        [
            Row(
                i,
                DONE,
                {"y": i * 0.5, "good": True, "v": [1.0, float(i)]},
                {"track": np.full((2, 3), float(i))},
            )
            for i in range(10)
        ],
    )
    frame = store.frame()
    assert frame["case"].tolist() == sorted(i.decode() for i in cases.ids.tolist())
    assert (frame["y"] == frame["x"] / 2).all()
    row, arrays = store.case(frame["case"][4])
    np.testing.assert_array_equal(arrays["track"], np.full((2, 3), float(row["x"])))
    assert row["v"] == [1.0, float(row["x"])]
    assert row["place"] == [float(row["x"]), 1.0]


def test_parts_are_readable_as_they_are(store: Store, cases: CaseTable) -> None:
    write(store, cases, [Row(i, DONE, {"y": 1.0}, {}) for i in range(5)])
    write(
        store, cases, [Row(i, ERROR, {"y": None}, {}, "E", "m", "t") for i in range(5, 10)], "other"
    )
    assert len(pd.read_parquet(store.path / "parts")) == 10


def test_one_row_a_case_finished_before_failed_then_latest(store: Store, cases: CaseTable) -> None:
    write(
        store,
        cases,
        [Row(0, DONE, {"y": 1.0}, {}, started=5.0), Row(1, ERROR, {}, {}, "E", started=5.0)],
    )
    write(
        store,
        cases,
        [Row(0, ERROR, {}, {}, "E", started=9.0), Row(1, ERROR, {}, {}, "F", started=9.0)],
    )
    write(store, cases, [Row(1, ERROR, {}, {}, "G", started=7.0)])
    by_case = store.frame().set_index("case")
    first, second = (i.decode() for i in cases.ids[:2].tolist())
    assert by_case.loc[first, "status"] == DONE
    assert by_case.loc[second, "error"] == "F"
    assert len(store.finished()) == 2
    assert len(store.finished(with_failed=False)) == 1


def test_compaction_keeps_rows_and_arrays(store: Store, cases: CaseTable) -> None:
    for i in range(10):
        write(
            store,
            cases,
            [Row(i, DONE, {"y": float(i)}, {"a": np.array([float(i)])}, started=1.0)],
            f"c{i}",
        )
        write(
            store,
            cases,
            [Row(i, DONE, {"y": float(i)}, {"a": np.array([float(i)])}, started=2.0)],
            f"c{i}",
        )
    before = store.table()
    assert store.compact() == (20, 1)
    assert store.table().equals(before)
    assert len(store.parts("arrays")) == 1
    assert rows_in(store.parts("arrays")[0]) == 10
    assert store.compact() == (1, 1)


def test_reading_while_compacting_and_writing(store: Store) -> None:
    many = case_table([{"x": i} for i in range(60)])
    faults: list[str] = []
    finished = threading.Event()

    def compact() -> None:
        while not finished.is_set():
            store.compact()

    threads = [threading.Thread(target=compact) for _ in range(2)]
    for thread in threads:
        thread.start()
    seen = 0
    for i in range(60):
        write(store, many, [Row(i, DONE, {"y": 1.0}, {})], f"c{i}")
        now = len(store.table())
        if now < max(seen, i + 1):
            faults.append(f"{now} rows after {i + 1}")
        seen = now
    finished.set()
    for thread in threads:
        thread.join()
    assert not faults
    assert len(store.table()) == 60


def test_half_written_parts_are_never_read(store: Store, cases: CaseTable) -> None:
    (store.path / "temporary" / "part.parquet").write_bytes(b"PAR1 half")
    write(store, cases, [Row(0, DONE, {}, {})])
    assert len(store.table()) == 1


def test_a_damaged_part_is_named(store: Store) -> None:
    (store.path / "parts" / "bad.parquet").write_bytes(b"nothing")
    with pytest.raises(StoreError, match=r"bad\.parquet"):
        store.table()


@pytest.mark.parametrize(
    "content", ['{"format": 0}', '{"format": 1, "kind": "trajopt sweep"}', "[]", "not json"]
)
def test_other_formats_are_refused(tmp_path: Path, content: str) -> None:
    place = tmp_path / "store"
    open_store(place)
    (place / "store.json").write_text(content)
    with pytest.raises(StoreError, match=r"format|JSON"):
        open_store(place)


@pytest.mark.parametrize(
    "content",
    ['{"format": 1, "kind": "trajopt sweep"}', seal({"format": 3, "kind": "trajopt sweep"})],
)
def test_a_store_of_another_format_is_refused_and_left_alone(tmp_path: Path, content: str) -> None:
    place = sweep([{"x": 1}], noop, executor=1, store=tmp_path / "store").path
    (place / "store.json").write_text(content)
    before = {p: p.read_bytes() for p in place.rglob("*") if p.is_file()}
    with pytest.raises(
        StoreError, match="but this version reads and writes format 2; use the trajopt version"
    ):
        sweep([{"x": 2}], noop, executor=1, store=place)
    assert {p: p.read_bytes() for p in place.rglob("*") if p.is_file()} == before


def late(case: Case) -> dict[str, Any]:
    """A column that only some late cases have (none of the three sampled ones), and an error at the
    front."""
    if case["x"] == 0:
        raise ValueError("first")
    row: dict[str, Any] = {"square": case["x"] ** 2.0}
    return {**row, "late": case["x"] / 2} if 90 <= case["x"] < 99 else row


@pytest.fixture(scope="module")
def uneven(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """A finished sweep whose parts did not all know all columns when they were written."""
    store = sweep(
        [{"x": i} for i in range(100)],
        late,
        executor=1,
        store=tmp_path_factory.mktemp("uneven") / "store",
    )
    return sweep([{"x": i} for i in range(200, 203)], noop, executor=1, store=store)


def test_pandas_reads_the_parts_as_they_are(uneven: Store) -> None:
    assert len(uneven.parts()) > 1
    frame = pd.read_parquet(uneven.path / "parts").sort_values("x")
    assert frame["late"].dropna().tolist() == [x / 2 for x in range(90, 99)]


def test_polars_reads_the_parts_as_they_are(uneven: Store) -> None:
    polars = pytest.importorskip("polars", reason="polars is not installed")
    frame = polars.read_parquet(uneven.path / "parts" / "*.parquet").sort("x")
    assert frame["late"].drop_nulls().to_list() == [x / 2 for x in range(90, 99)]
    assert frame["status"].to_list() == [ERROR] + [DONE] * 102


def test_duckdb_reads_the_parts_as_they_are(uneven: Store) -> None:
    duckdb = pytest.importorskip("duckdb", reason="duckdb is not installed")
    found = duckdb.sql(
        f"select status, count(*), sum(late), sum(square) from '{uneven.path}/parts/*.parquet' "
        "group by status order by status"
    ).fetchall()
    assert found == [
        (DONE, 102, sum(range(90, 99)) / 2, float(sum(x * x for x in range(100)))),
        (ERROR, 1, None, None),
    ]


def test_kinds_that_exclude_each_other_become_text(store: Store, cases: CaseTable) -> None:
    write(store, cases, [Row(0, DONE, {"y": 0.5, "v": [1.0, 2.0]}, {})])
    write(store, cases, [Row(1, DONE, {"y": "high", "v": True}, {})], "other")
    assert sorted(store.frame()["y"]) == ["0.5", "high"]
    before = store.table()
    align(store)
    assert store.table().equals(before)
    assert sorted(pd.read_parquet(store.path / "parts")["v"]) == ["[1.0, 2.0]", "true"]


def test_other_directories_are_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("x")
    with pytest.raises(StoreError, match="another directory"):
        open_store(tmp_path)
    with pytest.raises(StoreError, match="no sweep store"):
        open_store(tmp_path / "nowhere", create=False)


def test_format_on_disk(store: Store) -> None:
    content = json.loads((store.path / "store.json").read_text())
    assert content.pop("checksum") == "318090101a37efd9cee301c95cab1160"
    assert content == {"format": 2, "kind": "trajopt sweep"}


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_full_disk_leaves_the_store_whole(
    store: Store, cases: CaseTable, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(store, cases, [Row(0, DONE, {}, {})])
    full = open  # every write of a part goes to a device without space

    def to_full(file: object, mode: str = "r", **options: object) -> object:
        return full("/dev/full" if "temporary" in str(file) else file, mode, **options)  # type: ignore[call-overload]

    monkeypatch.setattr("builtins.open", to_full)
    with pytest.raises(StoreError, match="no space left"):
        write(store, cases, [Row(1, DONE, {}, {})])
    monkeypatch.undo()
    assert len(store.table()) == 1
    assert list((store.path / "temporary").iterdir()) == []


@pytest.mark.parametrize(
    ("returned", "words"),
    [
        ({"a.b": 1, "a": {"b": 2}}, "'a.b'.*each name once"),
        ({"x": 1}, "'x'.*no value of the case"),
        ({"status": "fine"}, "'status'"),
        ({"run_host": "fine"}, "'run_host'"),
        ({"y": 2**60 + 1}, "2\\^53"),
        ({"y": np.array([2**60 + 1])}, "2\\^53"),
        ({"y": "\ud800"}, "UTF-8"),
        ({"\ud800": 1}, "result key"),
        ({"y": {"z": np.ones(2), "z.": 1}, "y.z": 3}, "'y.z'"),
    ],
)
def test_results_that_clash_or_lose_are_told(returned: Any, words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        results_of(returned, {"x"})


def test_results_of_mixed_kinds_keep_their_values(tmp_path: Path) -> None:
    values = [1.5, "high", True, [1.0, 2.0], None]
    store = sweep(
        [{"x": i} for i in range(5)],
        lambda case: {"y": values[case["x"]]},
        executor=1,
        store=tmp_path / "store",
        code="1",
    )
    frame = store.frame().sort_values("x")
    assert frame["y"].tolist()[:4] == ["1.5", "high", "true", "[1.0, 2.0]"]
    assert store.counts() == {"done": 5}
