"""Every picture of a run can be PNG, PDF and SVG."""

from __future__ import annotations

from pathlib import Path

import pytest

from trajopt.errors import ArgumentError
from trajopt.report.convergence_picture import convergence_figure
from trajopt.report.path_picture import path_figure
from trajopt.report.profile_picture import profile_figure
from trajopt.report.style import in_style, new_figure, save_figure
from trajopt.solution import Solution

START = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}


@pytest.mark.parametrize("kind", START)
def test_suffix_chooses_the_format(kind: str, exact: Solution, tmp_path: Path) -> None:
    assert exact.path is not None
    assert exact.search is not None
    assert exact.trajectory is not None
    with in_style():
        for figure in (
            path_figure(exact, exact.path),
            convergence_figure(exact, exact.search),
            profile_figure(exact, exact.trajectory),
        ):
            file = save_figure(figure, tmp_path / f"a.{kind}")
            assert file.read_bytes().startswith(START[kind])


def test_other_suffixes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"a\.jpg.*\.png, \.pdf or \.svg"):
        save_figure(new_figure(2.0), tmp_path / "a.jpg")
