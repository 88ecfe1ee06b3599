"""What docs/minimize.md shows runs, and its tables name every optimizer and every stage of auto."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.optimize.functions import as_objective
from trajopt.optimize.portfolio import stages
from trajopt.optimize.search import OPTIMIZERS, optimizer_named

TEXT = (Path(__file__).parents[2] / "docs" / "minimize.md").read_text(encoding="utf-8")


def test_the_code_runs() -> None:
    found: dict[str, Any] = {}
    for code in re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL):
        exec(compile(code, "minimize.md", "exec"), found)
    assert abs(found["found"].fun - 2.0) < 1e-4


def test_every_optimizer_is_there() -> None:
    table = TEXT.split("## What there is")[1].split("## What `auto`")[0]
    named = {
        name
        for row in table.splitlines()
        if row.startswith("| `")
        for name in re.findall(r"`([^`]+)`", row.split("|")[1])
    }
    assert named == set(OPTIMIZERS)
    saving = {n for n in OPTIMIZERS if getattr(optimizer_named(n), "saves", False)}
    for row in table.splitlines():
        if row.startswith("| `"):
            names = re.findall(r"`([^`]+)`", row.split("|")[1])
            told = row.split("|")[4].strip()
            kept = names if told == "yes" else names[:1] if told == "the first" else []
            assert saving & set(names) == set(kept), row


def test_shares_are_those_of_the_table() -> None:
    box = np.tile([0.0, 1.0], (2, 1))
    plain = stages(as_objective(lambda x: x[0], box))
    kept = stages(as_objective(lambda x: x[0], box, constraints=[("eq", lambda x: x[0])]))
    smooth = stages(as_objective(lambda x: x[0], box, jac=lambda x: x))
    assert [(m.name, s) for m, s in plain] == [("l-bfgs-b", 0.1), ("cma-es", 1.0)]
    assert [(m.name, s) for m, s in kept] == [("slsqp", 0.3), ("pso", 1.0)]
    assert [(m.name, s) for m, s in smooth] == [("slsqp", 0.5), ("cma-es", 1.0)]
