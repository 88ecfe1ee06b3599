"""Results show themselves in a notebook, which is executed here."""

from __future__ import annotations

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).parents[2]
BOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
SHOWN = {
    "problem": "import trajopt\nproblem = trajopt.load_problem('problems/smdw/scenario_1_lateral.toml')\nproblem",
    "robot": "problem.robot",
    "solution": "solution = trajopt.solve(problem)\nsolution",
    "trajectory": "solution.trajectory",
    "search": "trajopt.minimize(lambda x: (x[0] - 1) ** 2, [[-2, 2]], optimizer='pso', budget=trajopt.Budget(200))",
    "report": "trajopt.validate(solution.trajectory, problem, engine='mujoco')",
}
TOLD = ("frame = solution.trajectory.to_frame()\nassert len(frame) > 100 and 'x_m' in frame.columns\n"
        "for thing in (problem, problem.robot, solution, solution.trajectory):\n"
        "    assert len(repr(thing)) < 160, repr(thing)\n"
        "    assert thing.plot().axes")  # fmt: skip


def test_results_show_facts_and_a_picture() -> None:
    book = nbformat.v4.new_notebook(
        cells=[nbformat.v4.new_code_cell(code) for code in (*SHOWN.values(), TOLD)]
    )
    NotebookClient(book, timeout=300, resources={"metadata": {"path": str(ROOT)}}).execute()
    for name, cell in zip(SHOWN, book.cells, strict=False):
        (shown,) = [output for output in cell.outputs if output.output_type == "execute_result"]
        html = shown["data"]["text/html"]
        assert "<table>" in html, name
        assert "data:image/png;base64," in html, name
        assert len(shown["data"]["text/plain"]) < 160, name


@pytest.mark.parametrize("name", [path.stem for path in BOOKS])
def test_shipped_notebooks_run(name: str) -> None:
    book = nbformat.read(ROOT / "docs" / "notebooks" / f"{name}.ipynb", as_version=4)
    NotebookClient(book, timeout=300, resources={"metadata": {"path": str(ROOT)}}).execute()
    pictures = [
        output
        for cell in book.cells
        for output in cell.get("outputs", ())
        if "image/png" in output.get("data", {}) or "base64" in str(output.get("data", ""))
    ]
    assert pictures


def test_there_are_three_notebooks() -> None:
    assert len(BOOKS) >= 3
