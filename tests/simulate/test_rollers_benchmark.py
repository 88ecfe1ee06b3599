"""The rollers benchmark: its case list, one measured row, its verdict and its files."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path

import pytest

from benchmarks.theses.rollers import (
    HEADER,
    SHAPES,
    SPEEDS,
    Case,
    Row,
    cases,
    measure,
    summary,
    write,
)
from trajopt.simulate.engine import ENGINES


def test_cases_cover_all_combinations_but_ellipsoids_in_bullet() -> None:
    listed = cases(SPEEDS, ENGINES)
    assert len(listed) == len(set(listed)) == (2 * len(SHAPES) - 1) * 2 * 3 * 5
    assert not any(case.engine == "pybullet" and case.shape == "ellipsoid" for case in listed)


def test_a_measured_row_is_written_with_its_conditions(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    row = measure(Case("mujoco", "Mecanum", "ellipsoid", "forward", 5.0))
    assert abs(row.along) < 0.02
    assert abs(row.across) < 0.02
    assert 0.0 < row.ripple < 0.05
    write([row], "numpy 2", tmp_path)
    with (tmp_path / "rollers.csv").open(encoding="utf-8") as file:
        header, line = list(csv.reader(file))
    assert tuple(header[:-1]) == HEADER
    assert line[:5] == ["mujoco", "Mecanum", "ellipsoid", "forward", "5"]
    assert "numpy" in line[-1]
    assert "within 3 %" in (tmp_path / "rollers.md").read_text(encoding="utf-8")


def test_one_bad_run_makes_the_verdict() -> None:
    good = Row(
        Case("mujoco", "SMDW", "barrel", "forward", 1.0), 0.01, -0.02, 0.0, 0.0, 0.0, 9.0, ""
    )
    worse = dataclasses.replace(good, across=-0.031)
    thrown = dataclasses.replace(good, reason="the state is not finite")
    assert summary([good])[0][-1] == "within 3 %"
    assert summary([good, worse])[0][-1] == "fails"
    assert summary([good, thrown])[0][-1] == "fails"
