"""Pictures of sweeps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks.theses.smdw_rate_pictures import rate_lines, rate_maps
from trajopt.errors import ArgumentError
from trajopt.report.intervals import wilson
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
    np.testing.assert_allclose(
        figure.axes[0].lines[1].get_ydata(), 2 * np.arange(4) * 0.1, atol=0.01
    )
    figure.savefig(tmp_path / "lines.png")
    assert (tmp_path / "lines.png").stat().st_size > 5_000


def test_lines_of_flags_show_shares_with_their_interval(frame: pd.DataFrame) -> None:
    made = frame.assign(good=frame["a"] > 0.15)
    axes = lines(made, "b", "good").axes[0]
    good = made[(made["status"] == "done") & (made["b"] == 1)]["good"]
    assert axes.lines[0].get_ydata()[0] == pytest.approx(good.mean())
    band = axes.collections[0].get_paths()[0].vertices
    low, high = wilson(int(good.sum()), len(good))
    assert low < good.mean() < high
    assert band[band[:, 0] == 1][:, 1].min() == pytest.approx(low)
    assert band[band[:, 0] == 1][:, 1].max() == pytest.approx(high)


def test_climb_rates_are_drawn_as_they_are() -> None:
    rows = [
        {
            "configuration": name,
            "obstacles.step.height": height,
            "friction": friction,
            "heading_error": error,
            "torque": torque,
            "status": "done",
            "climbed": float(torque > 3.0 if name == "lateral" else height < 0.03),
        }
        for name in ("lateral", "forward")
        for height in (0.02, 0.05)
        for friction in (0.3, 0.8)
        for error in (-0.05, 0.0, 0.05)
        for torque in (2.0, 4.0)
    ]
    rows.append({**rows[0], "climbed": None})  # left physics: does not count
    frame = pd.DataFrame(rows)
    maps = rate_maps(frame)
    shown = [np.asarray(axes.images[0].get_array()) for axes in maps.axes[:2]]
    np.testing.assert_allclose(shown[0], 0.5)  # lateral comes first
    np.testing.assert_allclose(shown[1], [[1.0, 1.0], [0.0, 0.0]])
    assert "1 left physics" in maps.get_suptitle()
    over_torque = rate_lines(frame).axes[1]
    np.testing.assert_allclose(over_torque.lines[0].get_ydata(), [0.0, 1.0])
    with pytest.raises(ArgumentError, match="climbed"):
        rate_maps(frame.drop(columns="climbed"))


def test_pairs(frame: pd.DataFrame) -> None:
    assert len(pairs(frame, ["a", "b", "cost"]).axes) == 9


def test_wrong_columns_are_named(frame: pd.DataFrame) -> None:
    with pytest.raises(ArgumentError, match="nothing"):
        heat_map(frame, "a", "nothing", "cost")
    with pytest.raises(ArgumentError, match="at least one finished"):
        lines(frame.assign(status="error"), "a", "cost")
