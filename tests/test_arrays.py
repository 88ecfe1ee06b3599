"""Array types, angle folding, rotation and checks of numbers exist once."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from trajopt.arrays import (
    as_numbers,
    fold,
    require_between,
    require_finite,
    require_not_negative,
    require_positive,
    require_rising,
    require_whole,
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
    for value in (1e-300, 2, np.float32(0.5)):
        assert require_positive("x", value) == value
    require_positive("x", [1.0, 3.0], "", None)
    require_not_negative("x", 0.0)
    require_finite("x", [-1.0, 0.0], "", (2,))
    for require, bad in ((require_positive, [1.0, 0.0]), (require_not_negative, [1.0, -1e-9])):
        with pytest.raises(ArgumentError, match=r"x = \[.*\]: expected a finite value >=? 0 rad"):
            require("x", bad, "rad", None)


@pytest.mark.parametrize(
    "bad", ["ab", "1", True, [True], [1, "2"], [None], [1, [2]], 1j, [1.0, object()], 10**400, {}]
)
def test_what_is_no_number_is_refused(bad):
    with pytest.raises(ArgumentError, match=r"x = .*: expected two numbers"):
        as_numbers("x", bad, "two numbers")


def test_numbers_come_as_floats_of_the_shape_asked_for():
    assert as_numbers("x", [1, 2.5], "").tolist() == [1.0, 2.5]
    assert as_numbers("x", 10**30, "", ()) == 1e30
    assert as_numbers("x", [], "", (None,)).shape == (0,)
    assert as_numbers("x", np.ones((4, 2)), "", (None, 2)).shape == (4, 2)
    for shape in ((), (1,), (3,), (None, 1), (2, None)):
        with pytest.raises(ArgumentError, match="expected two"):
            as_numbers("x", [1.0, 2.0], "two", shape)


def test_rising_between_and_whole():
    assert require_rising("x", [0, 1], "m").tolist() == [0.0, 1.0]
    for bad in ([], [1.0, 1.0], [0.0, np.nan], [0.0, np.inf], 1.0):
        with pytest.raises(ArgumentError, match="increasing m"):
            require_rising("x", bad, "m")
    require_between("x", 0.5, 0, 1, "rad")
    for bad in (0, 1, np.nan, -1):
        with pytest.raises(ArgumentError, match="between 0 and 1 rad"):
            require_between("x", bad, 0, 1, "rad")
    require_whole("x", np.int64(3), 3, "3 or more")
    for bad in (2, 3.0, True, "3", 2**64):
        with pytest.raises(ArgumentError, match="3 or more"):
            require_whole("x", bad, 3, "3 or more")


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
