"""Searches of the SMDW theses as problems of the optimizer benchmark.

Names: ``smdw/<file>/<free>`` and ``smdw/<file>/<free>/limits`` (a problem file in a decision space,
without and with actuator limits); ``random-smdw/<seed>/<free>[/limits]``. ``<free>`` joins names
with "+".
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from trajopt.arrays import Array
from trajopt.bench.problems import Family
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Objective
from trajopt.objectives.terminal import terminal_objective, with_free
from trajopt.problem import Problem, load_problem
from trajopt.systems.smdw.thesis import through_drives


def of_file(text: str, root: Path) -> tuple[Objective, Array]:
    """The problem ``smdw/<text>``; ``root`` is the folder with problem files."""
    stem, free, limited = _parts(text)
    problem = load_problem(root / "smdw" / f"{stem}.toml")
    return _terminal(problem, free, limited)


def drawn(text: str, root: Path) -> tuple[Objective, Array]:
    """Scenario 1's robot and space with a goal pose, wheel angles and a pair of wheels drawn from
    the seed."""
    seed, free, limited = _parts(text)
    problem = load_problem(root / "smdw" / "scenario_1_forward35.toml")
    rng = np.random.default_rng(int(seed))
    pose = rng.uniform(
        [1.0, -1.0, 0.3], [2.8, 1.0, 1.5]
    )  # m, m, rad; far enough and turning, chosen
    pose[2] *= rng.choice([-1.0, 1.0])
    pairs = (
        ["front-left", "front-right"],
        ["front-left", "rear-left"],
        ["front-right", "rear-right"],
        ["rear-left", "rear-right"],
    )
    goal = {
        "pose": pose.tolist(),
        "wheels": rng.uniform(-np.pi, np.pi, 4).tolist(),
        "critical": pairs[int(rng.integers(len(pairs)))],
    }
    return _terminal(problem.replace(goal=goal), free, limited)


def _parts(text: str) -> tuple[str, str, bool]:
    parts = text.split("/")
    if len(parts) not in (2, 3) or (len(parts) == 3 and parts[2] != "limits"):
        raise ArgumentError("problem", text, "<name>/<free> or <name>/<free>/limits")
    return parts[0], parts[1], len(parts) == 3


def _terminal(problem: Problem, free: str, limited: bool) -> tuple[Objective, Array]:
    changed = problem.replace({"actuator": None, "objective.kind": "terminal"})
    changed = through_drives(changed) if limited else changed
    objective = terminal_objective(with_free(changed, *free.split("+")))
    return objective, objective.bounds


FAMILIES = {
    "smdw": Family(
        of_file,
        {
            "SMDW, ideal drives (affine)": r"smdw/[^/]+/[^/]+",
            "SMDW, limits, points free": r"smdw/[^/]+/(p1|p2|p1\+p2)/limits",
            "SMDW, limits, points and headings free": r"smdw/[^/]+/.*heading/limits",
        },
    ),
    "random-smdw": Family(drawn, {"random SMDW goals, limits": r"random-smdw/.*"}),
}
