"""Results show themselves in a notebook, which is executed here."""

from __future__ import annotations

from pathlib import Path

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).parents[2]
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
