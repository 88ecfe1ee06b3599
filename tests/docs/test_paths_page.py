"""What docs/paths.md shows runs, and its problem is the shipped one without obstacles."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from trajopt import load_problem, solve

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "paths.md").read_text(encoding="utf-8")


def test_the_code_runs(capsys: pytest.CaptureFixture[str]) -> None:
    found: dict[str, Any] = {}
    for code in re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL):
        exec(compile(code, "paths.md", "exec"), found)
    assert "stops = [2.0]" in capsys.readouterr().out
    both, reverses = found["both"], found["reverses"]
    assert both.facing([0.0, both.end]).tolist() == [1.0, -1.0]
    assert reverses.gap < 1e-3


def test_the_bay_is_the_shipped_problem(tmp_path: Path) -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)
    file = tmp_path / "bay.toml"
    file.write_text(text, encoding="utf-8")
    shipped = load_problem(ROOT / "problems" / "car" / "bay.toml")
    alone = shipped.replace({"obstacles": None, "limits.clearance": None})
    assert load_problem(file) == alone
    solution = solve(shipped)
    assert solution.holds, solution.status
    assert solution.trajectory is not None
    end = solution.trajectory.at(solution.trajectory.duration).pose[0]
    np.testing.assert_allclose(end, [2.1625, -1.2625, np.pi / 2], atol=1e-4)
    assert (ROOT / "docs" / "pictures" / "bay.png").stat().st_size > 10_000
