"""What the theses' pages print is what it was; `python -m tests.systems.golden_figures --write`
keeps what has changed for a reason."""

from __future__ import annotations

import pytest

from tests.systems.golden_figures import GROUPS, differences, kept

ENGINES = {"smdw_physics": "mujoco", "smdw_climbs": "mujoco"}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] if group.slow else [])
        for name, group in GROUPS.items()
    ],
)
def test_figures_are_those_kept(name: str) -> None:
    if name in ENGINES:
        pytest.importorskip(ENGINES[name])
    found = differences(name, kept()[name], GROUPS[name].compute())
    assert not found, "\n".join(found)


def test_every_group_is_kept_and_nothing_else() -> None:
    assert list(kept()) == list(GROUPS)
    assert sum(len(figures) for figures in kept().values()) > 300


def test_a_figure_that_is_gone_new_or_off_is_named() -> None:
    old = {"a": 1.0, "b": 2.0, "c": 3.0}
    assert differences("smdw_costs", old, dict(old)) == []
    assert differences("smdw_costs", old, {**old, "b": 2.0 * (1 + 2e-6)}) == ["b: 2.000004, kept 2"]
    assert differences("smdw_costs", old, {"a": 1.0, "c": 3.0, "d": 0.0}) == [
        "b: gone",
        "d: not in the file",
    ]
