"""The optimizer benchmark: plugins, bad objectives, resuming, the report, and the profiles'
definitions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from trajopt.bench.comparison import BenchPlan, load_bench, run_bench
from trajopt.bench.page import write_report
from trajopt.bench.problems import bench_problem, best_costs
from trajopt.bench.tables import BenchTables
from trajopt.cli.bench import app
from trajopt.errors import ArgumentError
from trajopt.optimize.base import Budget
from trajopt.optimize.search import minimize, optimizer_named, optimizer_names
from trajopt.sweeps.store import open_store

PLUGIN = str(Path(__file__).parent / "bench_plugin.py")
INF, NAN = np.inf, np.nan


def test_an_optimizer_in_a_file_works_by_its_path() -> None:
    for name in (PLUGIN, f"{PLUGIN}:random-search"):
        found = minimize(
            lambda x: float(np.sum(x * x)), [[-1.0, 2.0]] * 2, optimizer=name, budget=Budget(400)
        )
        assert found.optimizer == "random-search"
        assert found.fun < 0.1
    with pytest.raises(ArgumentError, match="random-search"):
        optimizer_named(f"{PLUGIN}:nothing")
    with pytest.raises(ArgumentError, match="existing Python file"):
        optimizer_named("no/such/file.py")


def test_an_optimizer_of_an_installed_package_is_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    from trajopt.optimize import plugins, search

    made = optimizer_named(PLUGIN)
    monkeypatch.setattr(search, "installed_optimizers", lambda: {"theirs": lambda: made})
    assert "theirs" in optimizer_names()
    assert optimizer_named("theirs") is made
    assert isinstance(plugins.installed_optimizers(), dict)


@pytest.fixture(scope="module")
def bad_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    kinds = (
        "raises",
        "hangs",
        "returns NaN",
        "returns inf",
        "wrong shape",
        "changes its argument",
        "good",
    )
    plan = BenchPlan(
        "bad",
        tuple(f"bad/{kind}" for kind in kinds),
        ("pso", "random-search"),
        seeds=2,
        evaluations=200,
        seconds=2.0,
        time_limit=3.0,
        plugins=(PLUGIN,),
    )
    store = tmp_path_factory.mktemp("bench") / "rows"
    run_bench(replace(plan, problems=plan.problems[:1]), store, jobs=2)
    run_bench(plan, store, jobs=2)  # goes on: the finished ones are not run again
    return store


@pytest.mark.slow
def test_bad_objectives_ruin_neither_the_run_nor_other_rows(bad_store: Path) -> None:
    store = open_store(bad_store, create=False)
    frame = store.frame()
    assert len(frame) == 7 * 2 * 2
    status = frame.groupby("problem")["status"].unique()
    assert list(status["bad/hangs"]) == ["timeout"]
    good = frame[frame.problem.isin(["bad/good", "bad/changes its argument"])]
    assert (good.status == "done").all()
    assert (good.cost < 0.2).all()
    for kind in ("raises", "returns NaN", "returns inf", "wrong shape"):
        rows = frame[frame.problem == f"bad/{kind}"]
        assert all(
            "on purpose" in str(r.first_failure) or r.failures > 0 or r.status == "error"
            for r in rows.itertuples()
        )
    page = write_report(store, bad_store.parent / "page").read_text()
    for kind in ("raises", "hangs", "returns NaN", "wrong shape"):
        assert f"| bad/{kind} |" in page.split("Searches that failed")[1]
    for name in (
        "ecdf.png",
        "ecdf.svg",
        "profiles.png",
        "profiles.svg",
        "searches.csv",
        "shares.csv",
    ):
        assert (bad_store.parent / "page" / name).stat().st_size > 0


@pytest.mark.slow
def test_the_command_line_runs_resumes_and_reports(tmp_path: Path) -> None:
    file = tmp_path / "mini.toml"
    file.write_text(
        'seeds = 2\nevaluations = 300\nseconds = 2.0\nproblems = ["smdw/scenario_1_lateral/p2"]\n'
        'optimizers = ["lattice", "pso"]\n'
    )
    arguments = [str(file), "--store", str(tmp_path / "rows")]
    for _ in range(2):
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 0, result.output
        assert "3 done" in result.output
    reported = CliRunner().invoke(
        app, ["report", str(tmp_path / "rows"), "--out", str(tmp_path / "page")]
    )
    assert reported.exit_code == 0, reported.output
    assert "lattice" in (tmp_path / "page" / "index.md").read_text()


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("optimizers = ['pso']", "problems"),
        ("problems = ['x']\noptimizers = []", "optimizers"),
        ("problems = ['x']\noptimizers = ['pso']\nseedz = 3", "seedz"),
        ("problems = ['x']\noptimizers = ['pso']\nseeds = -1", "seeds"),
        ("= nonsense", "bench file"),
    ],
)
def test_bench_files_name_the_wrong_key(tmp_path: Path, text: str, wanted: str) -> None:
    (tmp_path / "b.toml").write_text(text)
    with pytest.raises(ArgumentError, match=wanted):
        load_bench(tmp_path / "b.toml")


def test_the_shipped_bench_file_names_existing_problems_and_optimizers() -> None:
    pytest.importorskip("pymoo")
    pytest.importorskip("optimagic")
    plan = load_bench(Path(__file__).parents[2] / "benchmarks" / "pso_vs_gradient.toml")
    assert len(plan.optimizers) >= 8
    assert plan.seeds >= 5
    assert {case["problem"] for case in plan.cases()} == set(plan.problems)


def test_problem_names() -> None:
    a, b = bench_problem("random-smdw/1/p2"), bench_problem("random-smdw/2/p2")
    x = np.full((1, 2), 0.5)
    assert a.objective.evaluate(x).cost != b.objective.evaluate(x).cost
    assert (
        bench_problem("random-smdw/1/p2").objective.evaluate(x).cost == a.objective.evaluate(x).cost
    )
    for wrong in (
        "nothing/x",
        "smdw/scenario_1_lateral",
        "classical/ackley-x",
        "smdw/scenario_1_lateral/p2/nolimits",
    ):
        with pytest.raises(ArgumentError, match="problem"):
            bench_problem(wrong)


def test_best_costs_take_known_and_found_values() -> None:
    def row(cost: float, known: float, feasible: bool = True) -> dict[str, object]:
        return {
            "problem": "a",
            "optimizer": "o",
            "seed": 1,
            "status": "done",
            "cost": cost,
            "best": known,
            "feasible": feasible,
        }

    assert best_costs([row(2.0, NAN), row(1.0, NAN), row(0.1, NAN, False)])["a"] == (
        1.0,
        "o, seed 1",
    )
    assert best_costs([row(2.0, 0.5)])["a"] == (0.5, "best_known.json")
    with pytest.raises(ArgumentError, match="finished"):
        BenchTables([{**row(1.0, NAN), "status": "error"}])


def test_best_known_values_are_kept_with_who_found_them(tmp_path: Path) -> None:
    import json

    from trajopt.bench.problems import write_best_known

    plan = BenchPlan("best", ("random-smdw/7/p2/limits",), ("pso",), seeds=2, evaluations=300)
    store = run_bench(plan, tmp_path / "rows")
    file = tmp_path / "best.json"
    known = write_best_known(store, file)["random-smdw/7/p2/limits"]
    assert known["cost"] == store.frame().cost.min()
    assert known["found_by"].startswith("pso, seed ")
    objective = bench_problem("random-smdw/7/p2/limits").objective
    assert objective.score(np.array(known["x"])).cost[0] == known["cost"]
    file.write_text(
        json.dumps({"random-smdw/7/p2/limits": {"cost": -1.0, "found_by": "someone", "x": []}})
    )
    assert write_best_known(store, file)["random-smdw/7/p2/limits"]["found_by"] == "someone"


def test_other_seconds_for_costly_problems(tmp_path: Path) -> None:
    file = tmp_path / "b.toml"
    text = 'problems = ["corridor/1/duration", "classical/ackley-2"]\noptimizers = ["pso"]\nseeds = 1\nseconds = 0.1\n'
    file.write_text(text + '[longer]\n"corridor/" = 6\n')
    frame = run_bench(load_bench(file), tmp_path / "rows").frame().set_index("problem")
    assert 0.6 <= frame.seconds["corridor/1/duration"] < 0.9
    assert frame.seconds["classical/ackley-2"] < 0.3
    file.write_text(text + '[longer]\n"corridor/" = -1\n')
    with pytest.raises(ArgumentError, match="longer"):
        load_bench(file)


def test_several_budgets_and_the_sections_that_tell_of_them(tmp_path: Path) -> None:
    file = tmp_path / "b.toml"
    text = 'problems = ["smdw/scenario_1_lateral/p2/limits", "classical/ackley-2"]\nseeds = 2\n'
    text += 'optimizers = ["pso", "slsqp", "newton", "ipopt", "lattice"]\n'
    file.write_text(text + 'budgets = ["200 evaluations", "60 evaluations", "0.1 s"]\n')
    store = run_bench(load_bench(file), tmp_path / "rows")
    frame = store.frame()
    assert len(frame) == 3 * (5 * 2 - 1 + 3 * 2)  # the lattice once; it and Newton on one problem
    for text, most in (("60 evaluations", 60), ("200 evaluations", 200)):
        assert (frame.nfev[frame.budget == text] <= most).all()
    assert (frame.seconds[frame.budget == "0.1 s"] < 0.2).all()
    told = BenchTables.by_budget(frame.to_dict("records"))
    assert list(told) == ["60 evaluations", "200 evaluations", "0.1 s"]
    assert (
        len({str(sorted(tables.best.items())) for tables in told.values()}) == 1
    )  # of all budgets
    page = write_report(store, tmp_path / "page").read_text()
    lines = page.split("## Several budgets")[1].split("## What exactness buys")
    assert "| family | 60 evaluations | 200 evaluations | 0.1 s |" in lines[0]
    assert sum(line.startswith("| pso |") for line in lines[0].splitlines()) == 1
    parts = [line.split(" |")[0] for line in lines[1].split("## ")[0].splitlines()]
    assert {"| newton", "| ipopt", "| lattice", "| pso", "| slsqp"} <= set(parts)
    assert "2 seeds" in lines[0]
    assert "2 seeds" in lines[1]
    other = '[longer]\n"a" = 2\n'
    for wrong, key in (
        ('budgets = ["1 hour"]\n', "budgets"),
        ('budgets = [""]\n', "budgets"),
        ('budgets = "1 s"\n', "budgets"),
        ('seconds = 1\nbudgets = ["1 s"]\n' + other, "seconds"),
    ):
        file.write_text('problems = ["a/b"]\noptimizers = ["pso"]\n' + wrong)
        with pytest.raises(ArgumentError, match=key):
            load_bench(file)


@pytest.mark.parametrize("name", ["auto", "l-bfgs-b", "nelder-mead", "slsqp", "cobyqa", "pso"])
def test_objectives_with_starts_of_their_own(name: str) -> None:
    """A path's least time offers its given knots as a start."""
    problem = bench_problem("powerbot/experiment_1")
    assert hasattr(problem.objective, "starts")
    found = minimize(problem.objective, problem.bounds, optimizer=name, budget=Budget(40))
    assert found.fun < problem.reference
    assert found.nfev == 40


def test_a_known_cost_that_a_search_beats_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    from trajopt.bench import answers, problems

    row = {"problem": "a", "optimizer": "o", "seed": 1, "status": "done", "feasible": True}
    row |= {"reference": 10.0, "best": 2.0, "cost": 1.0, "budget": "1 s"}
    known = {"a": {"cost": 2.0, "found_by": "x"}}
    for module in (answers, problems):
        monkeypatch.setattr(module, "best_known", lambda: known)
    assert "a 2 by 1 (o, seed 1)" in answers.beaten_lines(BenchTables([row]))[0]
    assert "No search" in answers.beaten_lines(BenchTables([{**row, "cost": 2.0 - 1e-7}]))[0]


def test_the_leading_swarm_is_in_the_pictures() -> None:
    from trajopt.bench.pictures import shown

    def row(name: str, cost: float) -> dict[str, object]:
        return {
            **{"problem": "a", "optimizer": name, "seed": 1, "status": "done", "feasible": True},
            **{"reference": 10.0, "best": 0.0, "cost": cost, "at_evaluations": [1.0]},
            **{"at_seconds": [1.0], "at_cost": [cost], "nfev": 1, "dimension": 1},
        }

    rows = [row(f"better-{k}", 0.0) for k in range(9)] + [row("pso", 8.0), row("pso-gbest", 9.9)]
    names = list(shown(BenchTables(rows)))
    assert names[0] == "pso"
    assert len(names) == 8
    assert "pso-gbest" not in names


def test_a_problem_file_is_compared_by_all_that_suit_it(tmp_path: Path) -> None:
    """``trajopt bench MY_PROBLEM.toml``: sets of optimizers, seeds and budgets by options; the same page."""
    problem = Path(__file__).parents[2] / "problems" / "smdw" / "table_5_3_1s.toml"
    plan = load_bench(problem)
    used = {case["optimizer"] for case in plan.cases()}
    assert {"auto", "pso", "lattice", "newton", "ipopt", "slsqp"} <= used
    store = tmp_path / "store"
    line = ["run", str(problem), "--store", str(store), "--seeds", "2", "--evaluations", "300"]
    line += ["--optimizer", "pso", "--optimizer", "newton", "--optimizer", "lattice"]
    assert CliRunner().invoke(app, line).exit_code == 0
    frame = open_store(store, create=False).frame()
    assert sorted(frame["optimizer"]) == ["lattice", "newton", "newton", "pso", "pso"]
    assert (frame["nfev"] <= 300).all()
    page = write_report(open_store(store, create=False), tmp_path / "report")
    assert "table_5_3_1s.toml" in page.read_text(encoding="utf-8")
    (tmp_path / "wrong.toml").write_text('problems = ["a/b"]\noptimizers = ["pso"]\nseeds = 0\n')
    with pytest.raises(ArgumentError, match="seeds"):
        load_bench(tmp_path / "wrong.toml")
