"""Pictures of sweeps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from trajopt.errors import ArgumentError
from trajopt.report.sweeps import heat_map, lines, pairs


@pytest.fixture
def frame() -> pd.DataFrame:
    rng = np.random.default_rng(0)
    a, b = np.repeat(np.arange(4) * 0.1, 30), np.tile(np.repeat([1, 2, 3], 10), 4)
    made = pd.DataFrame({"a": a, "b": b, "cost": a * b + 0.01 * rng.random(120), "status": "done"})
    made.loc[0, ["status", "cost"]] = ["error", np.nan]
    return made


def test_heat_map_shows_means(frame: pd.DataFrame) -> None:
    axes = heat_map(frame, "a", "b", "cost").axes[0]
    cells = np.asarray(axes.images[0].get_array())
    assert cells.shape == (3, 4)
    np.testing.assert_allclose(cells, np.outer([1, 2, 3], np.arange(4) * 0.1), atol=0.01)


def test_lines_show_medians(frame: pd.DataFrame, tmp_path: Path) -> None:
    figure = lines(frame, "a", "cost", "b")
    assert len(figure.axes[0].lines) == 3
    np.testing.assert_allclose(figure.axes[0].lines[1].get_ydata(), 2 * np.arange(4) * 0.1, atol=0.01)
    figure.savefig(tmp_path / "lines.png")
    assert (tmp_path / "lines.png").stat().st_size > 5_000


def test_pairs(frame: pd.DataFrame) -> None:
    assert len(pairs(frame, ["a", "b", "cost"]).axes) == 9


def test_wrong_columns_are_named(frame: pd.DataFrame) -> None:
    with pytest.raises(ArgumentError, match="nothing"):
        heat_map(frame, "a", "nothing", "cost")
    with pytest.raises(ArgumentError, match="at least one finished"):
        lines(frame.assign(status="error"), "a", "cost")
