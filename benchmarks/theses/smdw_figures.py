"""Pictures of the SMDW reproduction page, drawn from runs made here and from the trial files of
other benchmarks.

Counterparts of [guzman2015]: Figures 6.4 and 6.11 (sub-test 1), 6.6-6.8 and 6.13 (sub-test 2), 6.3
and 6.10 (set-ups), 4.10, 4.18 and 6.9 (wheel); climb rates, phase map and closed-loop endings.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure

from benchmarks.common import OUT, PROBLEMS
from benchmarks.theses import closed_loop, smdw_printed
from benchmarks.theses.climb_trials import NAMES, climb_from, plan_of
from benchmarks.theses.smdw_trial_figures import (
    ClimbCell,
    causes_figure,
    climb_rates_figure,
    endings_figure,
    phase_map_figure,
)
from benchmarks.theses.smdw_wheel_figures import cam_figure, setups_figure, wheel_at_step_figure
from trajopt.problem import load_problem
from trajopt.simulate.engine import ENGINES, Recording
from trajopt.systems.smdw.climb import Climb, StepScene, judge, reached, record_climb, run_approach
from trajopt.systems.smdw.climbing import DEFAULT_WHEEL, FITTED_WHEEL, loc8_smdw
from trajopt.systems.smdw.configurations import configurations_of
from trajopt.systems.smdw.pictures import geometry_figure
from trajopt.systems.smdw.planner import Plan
from trajopt.systems.smdw.trial_pictures import Motions, motions_figure
from trajopt.systems.smdw.trials import approach_command, step_scene

# Share of the thesis's ten runs that climbed, least and greatest (sections 6.1, 6.1.1, 6.2); "most"
# is not counted.
THESIS_SHARE: dict[tuple[str, float], tuple[float, float] | None] = {
    ("lateral", 0.05): (0.0, 0.0),
    ("forward35", 0.05): (0.5, 0.5),
    ("forward45", 0.05): (0.5, 0.6),
    ("lateral", 0.035): (0.2, 0.4),
    ("forward35", 0.035): (1.0, 1.0),
    ("forward45", 0.035): (1.0, 1.0),
}
SOURCE_NAMES = {
    "exact": "planned exactly",
    "thesis PSO": "thesis's PSO, re-run",
    "uniform": "uniform random phases",
}
SCENARIOS = {1: "step_5cm.toml", 2: "step_3_5cm.toml"}
LOW_STEP = 0.035  # m, section 6.1.1: scenario 1's final states against a lower step
NEAR = 0.02  # m, an end this near to its target is drawn as met, chosen
# Targets of Tables 6.1 and 6.6, m, m, rad
_YAWS = {"lateral": -math.pi / 2, "forward35": -0.611, "forward45": -math.pi / 4}
TARGETS = {
    1: {name: (2.46 if name == "lateral" else 2.2, 0.76, yaw) for name, yaw in _YAWS.items()},
    2: {name: (1.524 if name == "lateral" else 1.3, 0.0, yaw) for name, yaw in _YAWS.items()},
}


@dataclass(frozen=True, eq=False)
class Driven:
    """Sub-test 1 of one configuration: its plan, the recorded approaches and, from where each
    ended, the climb."""

    plan: Plan
    approaches: list[Recording]
    climbs: list[Climb]


def driven(number: int, trials: int) -> dict[str, Driven]:
    """Open-loop approaches of a scenario from starts with errors, friction 0.6-1.0, in MuJoCo, by
    configuration."""
    problem = load_problem(PROBLEMS / "smdw" / SCENARIOS[number])
    found = {}
    for configuration in configurations_of(problem):
        if configuration.name not in NAMES:
            continue
        plan = plan_of(problem, configuration)
        approaches, climbs = [], []
        for n in range(trials):
            rng = np.random.default_rng([n, 11])
            scene = step_scene(problem, float(rng.uniform(0.6, 1.0)))
            approaches.append(run_approach(scene, approach_command(problem, plan, rng)))
            pose, wheels = reached(approaches[-1])
            climbs.append(
                replace(
                    climb_from(problem, plan, np.zeros(4), rng),
                    step=scene,
                    pose=pose,
                    wheels=wheels,
                )
            )
        found[configuration.name] = Driven(plan, approaches, climbs)
    return found


def first_sub_test(figure: str, runs: Mapping[str, Driven]) -> Figure:
    """Figures 6.4 and 6.11: driven beside planned motions."""
    panels = []
    for name, run in runs.items():
        ideal = run.plan.trajectory.at(np.linspace(0.0, run.plan.duration, 200)).pose
        misses = [math.hypot(*(a.pose[-1] - ideal[-1])[:2]) for a in run.approaches]
        panels.append(
            Motions(
                f"{figure}: {name}",
                [a.pose for a in run.approaches],
                [m < NEAR for m in misses],
                ideal,
                run.climbs[0].step.step.place[0],
                f"black: planned; blue: ends within 2 cm\nmedian miss {100 * np.median(misses):.1f} cm",
            )
        )
    return motions_figure(panels, loc8_smdw())


def second_sub_test(climbs: Mapping[str, Sequence[Climb]]) -> Figure:
    """Figures 6.6-6.8 and 6.13: two seconds against the step; titles are the keys."""
    panels = []
    for title, group in climbs.items():
        recordings = [record_climb(climb) for climb in group]
        up = [judge(climb, run).critical_up for climb, run in zip(group, recordings, strict=True)]
        panels.append(
            Motions(
                title,
                [run.pose for run in recordings],
                up,
                None,
                group[0].step.step.place[0],
                f"blue: leading wheels up, {sum(up)} of {len(up)}",
            )
        )
    return motions_figure(panels, loc8_smdw())


def lowered(there: StepScene) -> StepScene:
    """The same at the lower step."""
    return replace(there, step=replace(there.step, height=LOW_STEP))


def motions(runs: Mapping[int, Mapping[str, Driven]], quick: bool) -> Iterator[tuple[str, Figure]]:
    """Sub-tests 1 and 2 of both scenarios, scenario 1 at the lower step, and lateral with the yaw
    set right."""
    numbers = {1: ("6.4", "6.6"), 2: ("6.11", "6.13")}
    for number, found in runs.items():
        first, second = numbers[number]
        yield f"sub_test_1_scenario_{number}.png", first_sub_test(first, found)
        yield (
            f"sub_test_2_scenario_{number}.png",
            second_sub_test(
                {
                    f"{second}: {name}, {100 * run.climbs[0].step.height:g} cm": run.climbs
                    for name, run in found.items()
                }
            ),
        )
    low = {
        name: [replace(c, step=lowered(c.step)) for c in run.climbs]
        for name, run in runs[1].items()
    }
    yield (
        "figure_6_7.png",
        second_sub_test({f"6.7: {name}, {100 * LOW_STEP:g} cm": c for name, c in low.items()}),
    )
    printed = {
        g.yaw: g.climbs[: 2 if quick else None]
        for g in smdw_printed.groups()
        if g.configuration == "lateral left" and g.height == LOW_STEP
    }
    yield (
        "figure_6_8.png",
        second_sub_test(
            {
                f"{'6.7a' if yaw == smdw_printed.YAWS[0] else '6.8'}: yaw {yaw}": climbs
                for yaw, climbs in printed.items()
            }
        ),
    )


def trial_rows(part: str) -> list[dict[str, str]]:
    """Rows of all climb trial files that exist, without runs that left physics."""
    rows = []
    for file in sorted(OUT.glob("climb_*_trials.csv")):
        if "quick" not in file.stem:
            with file.open(newline="", encoding="utf-8") as stream:
                rows += [
                    r
                    for r in csv.DictReader(stream)
                    if r["part"] == part and r["exploded"] == "False"
                ]
    return rows


def climb_cells() -> list[ClimbCell]:
    """Climbs from planned states: one cell an engine, step, configuration and planner."""
    groups: dict[tuple[str, float, str, str], list[bool]] = {}
    for r in trial_rows("planned"):
        key = (r["engine"], float(r["height"]), r["configuration"], r["source"])
        groups.setdefault(key, []).append(r["critical_up"] == "True")
    order = list(SOURCE_NAMES)
    return [
        ClimbCell(
            engine, height, name, SOURCE_NAMES[source], sum(up), len(up), THESIS_SHARE[name, height]
        )
        for (engine, height, name, source), up in sorted(
            groups.items(),
            key=lambda item: (
                item[0][0],
                item[0][1],
                list(NAMES.values()).index(item[0][2]),
                order.index(item[0][3]),
            ),
        )
    ]


Shares = dict[tuple[str, float], dict[tuple[float, float], list[float]]]


def phase_shares(engine: str) -> tuple[list[float], Shares]:
    """Phases (rad), and the share that climbs at each, by configuration and step (m), torque (N m)
    and friction."""
    rows = [r for r in trial_rows("phases") if r["engine"] == engine]
    labels = sorted({r["source"] for r in rows}, key=float)
    hits: dict[tuple[str, float], dict[tuple[float, float], list[list[bool]]]] = {}
    for r in rows:
        panel = hits.setdefault((r["configuration"], float(r["height"])), {})
        cells = panel.setdefault((float(r["torque"]), float(r["friction"])), [[] for _ in labels])
        cells[labels.index(r["source"])].append(r["critical_up"] == "True")
    shares = {
        key: {
            row: [float(np.mean(c)) if c else math.nan for c in cells]
            for row, cells in sorted(panel.items())
        }
        for key, panel in sorted(hits.items(), key=lambda item: (item[0][0] != "lateral", item[0]))
    }
    return [float(v) for v in labels], shares


def phase_map(engine: str) -> Figure | None:
    """Climbs over phase, torque and friction in one engine; None without its trials."""
    phases, shares = phase_shares(engine)
    return phase_map_figure(shares, phases) if shares else None


def causes(engine: str) -> Figure | None:
    """Climbs over heading error, gap and speed in one engine; None without its trials."""
    found: dict[str, dict[str, dict[float, tuple[int, int]]]] = {}
    for r in trial_rows("causes"):
        if r["engine"] != engine:
            continue
        cause, value = r["source"].rsplit(": ", 1)
        label = f"{r['configuration']}, {100 * float(r['height']):g} cm, {float(r['torque']):g} N m"
        cells = found.setdefault(cause, {}).setdefault(label, {})
        up, of = cells.get(float(value), (0, 0))
        cells[float(value)] = up + (r["critical_up"] == "True"), of + 1
    return causes_figure(found) if found else None


def endings(engine: str) -> Figure | None:
    """How approaches end under control in one engine; None without its trials."""
    rows = closed_loop.kept(OUT / f"closed_loop_{engine}_trials.csv")
    found = {
        name: np.array(
            [(r.position, r.yaw, r.phase) for r in rows if r.control == name and not r.exploded]
        )
        for name in closed_loop.SETTINGS
    }
    found = {name: values for name, values in found.items() if len(values)}
    return endings_figure(found, {n: closed_loop.SETTINGS[n][2] for n in found}) if found else None


def from_files() -> Iterator[tuple[str, Figure]]:
    """(file name, figure) of everything there are trial files for."""
    cells = climb_cells()
    if cells:
        yield "climb_rates.png", climb_rates_figure(cells)
    for engine in ENGINES:
        for name, figure in (
            (f"phase_map_{engine}.png", phase_map(engine)),
            (f"causes_{engine}.png", causes(engine)),
            (f"closed_loop_{engine}.png", endings(engine)),
        ):
            if figure is not None:
                yield name, figure


def wheel_and_set_ups() -> Iterator[tuple[str, Figure]]:
    """The wheel at the step, and where the scenarios start."""
    yield "cam.png", cam_figure(DEFAULT_WHEEL, FITTED_WHEEL)
    yield "geometry_5cm.png", geometry_figure(DEFAULT_WHEEL, 0.05)
    yield (
        "figure_6_9.png",
        wheel_at_step_figure(DEFAULT_WHEEL, math.radians(-35), math.radians(-30), LOW_STEP),
    )
    numbers = {1: "6.3", 2: "6.10"}
    yield (
        "set_ups.png",
        setups_figure(
            [
                (f"{numbers[n]}: scenario {n}", load_problem(PROBLEMS / "smdw" / file), TARGETS[n])
                for n, file in SCENARIOS.items()
            ]
        ),
    )
