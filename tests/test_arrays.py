"""Array types, angle folding, rotation and checks of numbers exist once."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from trajopt.arrays import (
    as_numbers,
    fold,
    require_finite,
    require_not_negative,
    require_positive,
    rotation,
)
from trajopt.errors import ArgumentError

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize(
    ("angle", "folded"),
    [(0.0, 0.0), (np.pi, -np.pi), (-np.pi, -np.pi), (3.5 * np.pi, -0.5 * np.pi), (1e-9, 1e-9)],
)
def test_fold_goes_the_nearest_way_round(angle, folded):
    assert fold(angle) == pytest.approx(folded, rel=1e-12, abs=0.0)
    assert fold(np.array([angle]))[0] == fold(angle)


def test_fold_takes_any_period():
    assert fold(1.0, np.pi / 3) == pytest.approx(1.0 - np.pi / 3)


def test_rotation_turns_counterclockwise_for_each_angle():
    assert rotation(np.pi / 2) @ [1.0, 0.0] == pytest.approx(np.array([0.0, 1.0]))
    angles = np.array([[0.1, -2.0, 3.0]])
    turned = rotation(angles) @ np.array([2.0, 0.0])
    assert turned == pytest.approx(2 * np.stack([np.cos(angles), np.sin(angles)], axis=-1))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, [1.0, np.nan]])
def test_not_finite_is_refused(bad):
    for require in (require_finite, require_positive, require_not_negative):
        with pytest.raises(ArgumentError, match=r"x = .*expected .*finite .*m"):
            require("x", bad, "m")


def test_sign_is_checked():
    for value in (1e-300, 2, [1.0, 3.0]):
        require_positive("x", value)
    require_not_negative("x", 0.0)
    require_finite("x", [-1.0, 0.0])
    for require, bad in ((require_positive, [1.0, 0.0]), (require_not_negative, [1.0, -1e-9])):
        with pytest.raises(ArgumentError, match=r"x = \[.*\]: expected a finite value >=? 0 rad"):
            require("x", bad, "rad")


def test_text_is_not_numbers():
    with pytest.raises(ArgumentError, match="x = 'ab': expected two numbers"):
        as_numbers("x", "ab", "two numbers")
    assert as_numbers("x", [1, 2.5], "").tolist() == [1.0, 2.5]


def test_no_room_has_a_copy():
    copy = re.compile(
        r"^\w+ = NDArray\[|% \(?(2(\.0)? \* (np|math)\.pi|math\.tau)|^def _?rotation\(", re.M
    )
    found = {
        f"{file.relative_to(ROOT)}: {match.group()}"
        for folder in ("trajopt", "benchmarks")
        for file in (ROOT / folder).rglob("*.py")
        if file != ROOT / "trajopt" / "arrays.py"
        for match in copy.finditer(file.read_text(encoding="utf-8"))
    }
    assert not found
