"""The page of a benchmark, in a real browser: every curve and table, one colour an optimizer."""

from __future__ import annotations

from pathlib import Path

from tests.report.browser import page_of
from trajopt.bench.comparison import BenchPlan, run_bench
from trajopt.bench.page import write_report
from trajopt.sweeps.store import open_store

NAMES = ("lattice", "pso", "nelder-mead")


def test_every_curve_and_table_is_there(tmp_path: Path) -> None:
    plan = BenchPlan(
        "mini", ("smdw/scenario_1_lateral/p2",), NAMES, seeds=2, evaluations=200, seconds=2.0
    )
    run_bench(plan, tmp_path / "rows")
    report = write_report(open_store(tmp_path / "rows", create=False), tmp_path / "page")
    with page_of(report.with_name("index.html"), (1200, 900)) as page:
        charts = page.evaluate("view.data.charts.map(c => c.lines.map(l => [l.name, l.colour]))")
        assert len(charts) >= 6
        assert all(
            len({colour for chart in charts for n, colour in chart if n == name}) == 1
            for name in NAMES
        )
        assert page.locator("#charts canvas").count() == len(charts)
        markdown = report.read_text()
        for title in ("Answers", "Expected running time", "Best known costs"):
            assert title in page.inner_text("#sections")
        rows = sum(line.startswith("|") for line in markdown.splitlines())
        tables = sum(
            set(line) <= set("|-: ") for line in markdown.splitlines() if line.startswith("|")
        )
        assert page.locator(".tables tr").count() == rows - tables
        page.get_by_role("button", name="pso", exact=True).click()
        assert page.evaluate("view.charts.every(c => c.hidden.has('pso'))")
        page.screenshot(path=tmp_path / "page.png", full_page=True)
