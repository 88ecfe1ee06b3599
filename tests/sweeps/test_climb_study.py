"""The climb rate study: its trial is sub-test 2 as ``run_climb`` drives it."""

from __future__ import annotations

import pytest

from tests.sweeps.crashes import ROOT
from trajopt.errors import ArgumentError
from trajopt.sweeps.cases import Case
from trajopt.sweeps.sweepfile import load_sweep
from trajopt.systems.smdw import study as climb_study
from trajopt.systems.smdw.climb import Climb, Outcome, run_climb
from trajopt.systems.smdw.configurations import configurations_of


def test_a_trial_climbs_with_the_values_of_its_case(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco")
    plan = load_sweep(ROOT / "problems" / "sweeps" / "climb_rate.toml")
    assert len(plan.table) == 6000
    case = plan.table.rows()[4321]
    seen: list[Climb] = []

    def watched(climb: Climb, engine: str) -> Outcome:
        seen.append(climb)
        return run_climb(climb, engine)

    monkeypatch.setattr(climb_study, "run_climb", watched)
    row = plan.run(case)
    step = seen[0].step
    assert (step.height, step.friction, step.robot.motor_array("torque")[0]) == (
        case["obstacles.step.height"],
        case["friction"],
        case["torque"],
    )
    assert row["climbed"] == float(run_climb(seen[0], case["engine"]).critical_up)


def test_all_configurations_of_the_study_are_there_and_others_are_named() -> None:
    plan = load_sweep(ROOT / "problems" / "sweeps" / "climb_rate.toml")
    problem = plan.run.problem  # type: ignore[attr-defined]
    wanted = {row["configuration"] for row in plan.table.rows()}
    for height in {row["obstacles.step.height"] for row in plan.table.rows()}:
        changed = problem.replace({"obstacles.step.height": height})
        assert wanted <= {c.name for c in configurations_of(changed)}
    with pytest.raises(ArgumentError, match="lateral left"):
        climb_study.trial(Case("0" * 32, {"configuration": "on its head"}), problem)
