"""Damage: every flipped bit of a store is harmless or told, never silent; names are names."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.sweeps.crashes import cases, digest
from tests.sweeps.run_functions import cheap, mixed
from trajopt.cli.sweep import app
from trajopt.files import DamageError, seal, unseal
from trajopt.sweeps.cases import Case
from trajopt.sweeps.parts import PartError, StoreError
from trajopt.sweeps.store import Store, open_store
from trajopt.sweeps.sweeps import sweep
from trajopt.sweeps.upkeep import compact, repair, verify


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Store:
    return sweep(cases(40), mixed, executor=1, store=tmp_path_factory.mktemp("whole") / "store")


@pytest.fixture
def store(whole: Store, tmp_path: Path) -> Store:
    return open_store(shutil.copytree(whole.path, tmp_path / "store"))


def flip(file: Path, bit: int) -> None:
    data = bytearray(file.read_bytes())
    data[bit // 8] ^= 1 << bit % 8
    file.write_bytes(data)


def told(store: Store) -> str:
    """Everything that can be read of a store."""
    opened = open_store(store.path, create=False)
    row, arrays = opened.case(opened.frame()["case"][0])
    runs = [str(r) for r in opened.runs()]
    return f"{digest(opened)} {row} {arrays} {runs} {opened.counts()}"


def flips(store: Store, count: int, seed: int) -> list[str]:
    """Flip bits of all kinds of files, one at a time; the kinds of files where it was silent."""
    before, draw, silent = told(store), random.Random(seed), []
    for _ in range(count):
        files = [p for p in store.path.rglob("*") if p.is_file()]
        file = draw.choice(files)
        content = file.read_bytes()
        flip(file, draw.randrange(8 * len(content)))
        try:
            if told(store) != before:
                silent.append(file.name)
        except StoreError as error:
            assert str(file) in str(error)  # noqa: PT017
            assert "\n" not in str(error)  # noqa: PT017
        file.write_bytes(content)
    return silent


def test_flipped_bits_are_told_or_harmless(store: Store) -> None:
    assert flips(store, 200, 1) == []


@pytest.mark.slow
def test_two_thousand_flipped_bits(store: Store) -> None:
    assert flips(store, 2000, 2) == []


@pytest.mark.parametrize("cut", [0, 1, 4, 100, -1])
def test_a_part_that_is_cut_short_is_told_and_left_by_compaction(store: Store, cut: int) -> None:
    file = store.parts()[0]
    file.write_bytes(file.read_bytes()[:cut])
    before = sorted(store.path.rglob("*"))
    for action in (compact, Store.table, Store.counts):
        with pytest.raises(StoreError, match=file.name):
            action(store)
    assert sorted(store.path.rglob("*")) == before


@pytest.mark.parametrize("folder", ["parts", "arrays"])
def test_repair_and_rerun_give_the_same_table(store: Store, whole: Store, folder: str) -> None:
    file = store.parts(folder)[-1]
    flip(file, 8 * (file.stat().st_size - 40))
    damage, *lacking = verify(store)
    assert (damage.file, len(lacking)) == (file, folder == "arrays")
    assert repair(store.path) == [damage, *lacking]
    assert verify(store) == []
    lost = (store.path / "damaged" / f"{file.name}.cases").read_text().split()
    gone = {i.decode() for i in whole.finished()} - {i.decode() for i in store.finished()}
    assert gone
    assert gone == set(lost)
    sweep(cases(40), mixed, executor=1, store=store)
    assert digest(store) == digest(whole)


def test_lost_arrays_are_told(store: Store, whole: Store) -> None:
    for file in store.parts("arrays"):
        file.unlink()
    with pytest.raises(StoreError, match="0 of its 1 arrays"):
        told(store)
    assert verify(store)
    repair(store.path)
    sweep(cases(40), mixed, executor=1, store=store)
    assert digest(store) == digest(whole)


def test_records_and_the_format_are_repaired(store: Store) -> None:
    record = store.records()[0]
    flip(record, 100)
    (store.path / "store.json").write_bytes(b"\0")
    with pytest.raises(StoreError, match="sweep repair"):
        open_store(store.path)
    assert len(repair(store.path)) == 2
    assert not verify(open_store(store.path))
    assert open_store(store.path).runs() == []


def test_a_part_without_a_checksum_is_told(store: Store) -> None:
    (store.path / "parts" / "more.parquet").write_bytes(store.parts()[0].read_bytes())
    with pytest.raises(PartError, match=r"more\.parquet: damaged: its name holds no checksum"):
        store.table()


def test_commands_tell_damage_in_one_line(store: Store) -> None:
    def run(*arguments: str) -> tuple[int, str]:
        done = CliRunner().invoke(app, [*arguments, str(store.path)])
        return done.exit_code, done.output

    assert run("verify") == (0, "whole\n")
    flip(store.parts()[0], 77)
    code, output = run("verify")
    assert code == 1
    assert "to run again" in output
    assert run("repair")[0] == 0
    assert run("verify") == (0, "whole\n")


@pytest.mark.parametrize("name", ["lr[0.1]", "plai*", "a?b", "[!x]", "~", "$HOME", "a'b", "{a,b}"])
def test_names_are_taken_literally(tmp_path: Path, name: str) -> None:
    beside = sweep(cases(9), cheap, executor=1, store=tmp_path / "plain")
    before = sorted(beside.path.rglob("*"))
    store = sweep(cases(20), cheap, executor=1, store=tmp_path / name)
    sweep(cases(25), cheap, executor=1, store=tmp_path / name)
    assert store.counts() == {"done": 25}
    assert store.runs()[-1]["missing"] == 5
    compact(store)
    assert len(store.parts()) == 1
    assert store.counts() == {"done": 25}
    assert sorted(beside.path.rglob("*")) == before


def test_names_that_no_directory_can_have(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for name in ("file", "nul\0", "x" * 300, "loop"):
        with pytest.raises(StoreError):
            open_store(tmp_path / name)


def test_a_case_has_row_and_arrays_of_the_same_run(tmp_path: Path) -> None:
    """Another run of the same cases, whose rows are later but failed: the first run's arrays."""
    first = sweep(cases(3), turned, executor=1, store=tmp_path / "one", code="same")
    second = sweep(cases(3), turned, executor=None, store=tmp_path / "two", code="same")
    for folder in ("parts", "arrays"):
        for file in second.parts(folder):
            shutil.copy(file, first.path / folder)
    for _ in range(2):
        for case in first.frame()["case"]:
            row, arrays = first.case(case)
            np.testing.assert_array_equal(arrays["track"], row["y"] * np.ones(3))
        compact(first)
    assert len(first.arrays()) == 3
    assert verify(first) == []


def turned(_: Case) -> dict[str, object]:
    """A number that differs from run to run, and an array of it."""
    y = float(np.random.default_rng().random())
    return {"y": y, "track": y * np.ones(3)}


def test_sealed_json() -> None:
    text = seal({"a": [1, 2.5, "x"], "b": None})
    assert unseal(text, "f") == {"a": [1, 2.5, "x"], "b": None}
    for bad in ("", "[]", "{}", text.replace("2.5", "2.6"), text[:-3], '{"checksum": 1}'):
        with pytest.raises(DamageError, match="f: damaged"):
            unseal(bad, "f")
