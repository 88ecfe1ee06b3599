"""The store: durable parts, one row a case, versions, compaction, writers at once."""

from __future__ import annotations

import json
import os
import shutil
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from tests.sweeps.run_functions import noop
from trajopt.sweeps.cases import Case, CaseTable, case_table
from trajopt.sweeps.host import parameter_kinds
from trajopt.sweeps.rows import DONE, ERROR, Row, array_table, fitted, result_kinds, row_table
from trajopt.sweeps.store import Store, StoreError, open_store
from trajopt.sweeps.sweeps import sweep


def write(store: Store, cases: CaseTable, rows: list[Row], name: str = "chunk") -> None:
    kinds = result_kinds(rows, {})
    beside = array_table(rows, cases)
    if beside is not None:
        store.write_part("arrays", name, beside)
    store.write_part(
        "parts", name, row_table(fitted(rows, kinds), cases, parameter_kinds(cases), kinds, "host")
    )


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


def test_names_of_results_do_not_hide_parameters(store: Store, cases: CaseTable) -> None:
    write(store, cases, [Row(0, DONE, {"x": 7.0, "status": "fine"}, {})])
    row = store.frame().iloc[0]
    assert (row["x"], row["result.x"], row["status"], row["result.status"]) == (
        0,
        7.0,
        DONE,
        "fine",
    )


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
    assert pq.read_metadata(store.parts("arrays")[0]).num_rows == 10
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
    "content", ['{"format": 0}', '{"format": 2, "kind": "trajopt sweep"}', "[]", "not json"]
)
def test_other_formats_are_refused(tmp_path: Path, content: str) -> None:
    place = tmp_path / "store"
    open_store(place)
    (place / "store.json").write_text(content)
    with pytest.raises(StoreError, match=r"format|JSON"):
        open_store(place)


OLD = Path(__file__).resolve().parents[1] / "data" / "sweep" / "format_1"


def test_a_store_of_an_older_version_is_read_and_goes_on(tmp_path: Path) -> None:
    """Written by the first version of this package that had sweeps (commit ff2b1b9), with x = 3 an
    error."""
    place = shutil.copytree(
        OLD, tmp_path / "store", ignore=shutil.ignore_patterns("temporary", "jobs")
    )
    store = open_store(place, create=False)
    frame = store.frame()
    assert store.counts() == {"done": 5, "error": 1}
    assert sorted(frame["x"]) == list(range(6))
    good = frame[frame["status"] == "done"]
    assert (good["square"] == good["x"] ** 2.0).all()
    row, arrays = store.case(good["case"].iloc[0])
    np.testing.assert_array_equal(arrays["track"], np.arange(6.0).reshape(3, 2) * row["x"])
    again = sweep(
        [{"x": i, "friction": 0.1 * i, "kind": "ab"[i % 2], "place": [0.5, i]} for i in range(6)],
        noop,
        executor=1,
        store=place,
    )
    assert again.counts() == {
        "done": 11,
        "error": 1,
    }  # another function: other cases, in one table with the old ones
    again.compact()
    assert len(again.frame()) == 12


@pytest.mark.parametrize("version", [0, 2, "1"])
def test_a_store_of_another_format_is_refused_and_left_alone(
    tmp_path: Path, version: object
) -> None:
    place = shutil.copytree(OLD, tmp_path / "store")
    (place / "store.json").write_text(json.dumps({"format": version, "kind": "trajopt sweep"}))
    before = {p: p.read_bytes() for p in place.rglob("*") if p.is_file()}
    with pytest.raises(
        StoreError, match="but this version reads and writes format 1; use the trajopt version"
    ):
        sweep([{"x": 1}], noop, executor=1, store=place)
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
    store.align()
    assert store.table().equals(before)
    assert sorted(pd.read_parquet(store.path / "parts")["v"]) == ["[1.0, 2.0]", "true"]


def test_other_directories_are_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("x")
    with pytest.raises(StoreError, match="another directory"):
        open_store(tmp_path)
    with pytest.raises(StoreError, match="no sweep store"):
        open_store(tmp_path / "nowhere", create=False)


def test_format_on_disk(store: Store) -> None:
    assert json.loads((store.path / "store.json").read_text()) == {
        "format": 1,
        "kind": "trajopt sweep",
    }


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
