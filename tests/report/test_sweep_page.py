"""The page of a sweep with 6,000 cases, in a real browser."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.report.browser import page_of
from trajopt.report.viewer.pages import write_page
from trajopt.report.viewer.sweep_page import sweep_data

AXES = {
    "repeat": [1, 2, 3, 4],
    "configuration": ["lateral", "forward 35", "forward 45"],
    "height": [0.02, 0.03, 0.035, 0.04, 0.05],
    "friction": [0.2, 0.3, 0.45, 0.6, 0.8],
    "heading": [-0.0873, -0.0349, 0.0, 0.0349, 0.0873],
    "torque": [1.0, 2.0, 4.0, 8.0],
}


@pytest.fixture(scope="module")
def frame() -> pd.DataFrame:
    rng = np.random.default_rng(4)
    rows = pd.DataFrame(list(itertools.product(*AXES.values())), columns=list(AXES))
    rows["case"] = [f"{i:016x}" for i in rng.integers(0, 2**62, len(rows))]
    rows["status"] = np.where(np.arange(len(rows)) % 500 == 7, "error", "done")
    rows["climbed"] = rng.random(len(rows)) < rows["torque"] / 8 * (1 - 8 * rows["height"])
    rows["time"] = 2 + rng.random(len(rows))
    rows.loc[rows["status"] == "error", "time"] = np.nan
    return rows


def test_filter_sort_maps_and_a_case(frame: pd.DataFrame, tmp_path: Path) -> None:
    data = sweep_data(frame, "climbed") | {"title": "Climb rate", "store": "out/sweeps/climb"}
    file = write_page("sweep", data, tmp_path / "view.html")
    assert len(frame) == 6000
    assert file.stat().st_size < 3e6
    with page_of(file, (1200, 900)) as page:
        assert "6,000 of 6,000 cases" in page.inner_text("#count")
        assert page.locator("#maps figure").count() == 2
        shown = page.evaluate(
            "[view.maps[0].chosen.map(k => view.maps[0].columns[k].name), view.maps[0].means]"
        )
        x, y, value = shown[0]
        means = (
            frame.pivot_table(index=y, columns=x, values=value, aggfunc="mean")
            .to_numpy(float)
            .ravel()
        )
        # texts are in the order of their list on the page, which is that of the table
        np.testing.assert_allclose(np.sort(shown[1]), np.sort(means), atol=1e-6)
        page.locator(".filter", has_text="torque").get_by_role(
            "button", name="8", exact=True
        ).click()
        few = frame[frame["torque"] == 8.0]
        assert f"{len(few):,} of 6,000" in page.inner_text("#count")
        heading = page.locator("th", has_text="time").first
        heading.click()
        heading.click()
        first = page.locator("#rows tbody tr").nth(1)
        longest = few["time"].max()
        assert f"{longest:.5g}" in first.inner_text()
        first.click()
        opened = page.inner_text("#case")
        assert few.loc[few["time"].idxmax(), "case"][:12] in opened
        assert "trajopt report out/sweeps/climb" in opened
        page.locator("#maps .cell").first.click()
        assert page.evaluate("view.table.rows.length") < len(few)
        page.get_by_role("button", name="all cases").click()
        assert page.evaluate("view.table.rows.length") == 6000
        page.screenshot(path=tmp_path / "page.png")
