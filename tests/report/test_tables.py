"""Tables on the terminal: short, plain, and right."""

from __future__ import annotations

import pytest
from rich.console import Console
from rich.table import Table

from trajopt.report.tables import solution_table, validation_table
from trajopt.robots import robot
from trajopt.simulate.check import ValidationReport
from trajopt.solution import Solution


def text_of(table: Table) -> str:
    console = Console(width=100, record=True, quiet=False, file=None, force_terminal=False)
    with console.capture() as capture:
        console.print(table)
    return capture.get()


def test_a_solution_that_holds(exact: Solution) -> None:
    text = text_of(solution_table(exact))
    assert "holds: " in text
    assert "does not hold" not in text
    assert f"{exact.duration:.4f} s" in text
    assert "wheel front-left" in text
    assert "binds" in text
    assert len(text.splitlines()) <= 32
    assert max(map(len, text.splitlines())) <= 100


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("through_actuators", "broken by"),
        ("violated", "violation"),
        ("without_motion", "limit 'tip' at s = 0.25"),
    ],
)
def test_a_solution_that_does_not_hold(
    name: str, says: str, request: pytest.FixtureRequest
) -> None:
    text = text_of(solution_table(request.getfixturevalue(name)))
    assert "does not hold" in text
    assert says in text
    assert "nan" not in text.lower()


def test_validation(drifted: ValidationReport) -> None:
    text = text_of(validation_table(drifted, robot("loc8")))
    assert "0.040 m/s, wheel rear-right" in text
    assert "door after 1.50 s at (2.000, 0.250) m" in text
    assert "made-up 0.0" in text
    assert "+2.00 mm (+0.07 %)" in text
    assert "-1.00 mm (-0.03 %)" in text
    assert "-2.000 mrad" in text
