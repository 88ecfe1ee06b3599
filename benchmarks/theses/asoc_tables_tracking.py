"""Tracking and physics of the ASOC page: Tables IX and X, paired differences, both engines."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.common import ResultTable
from benchmarks.theses.asoc_reference import TABLE_9, TABLE_10
from benchmarks.theses.asoc_study import constant_speed, square_corners
from trajopt.arrays import Array
from trajopt.errors import SimulationError
from trajopt.systems.asoc.modules import AsocGeometry
from trajopt.systems.asoc.reference import Reference, planned_speed
from trajopt.systems.asoc.run import AsocRun, drive_asoc
from trajopt.systems.asoc.tracking import FRICTION, Knowledge, Tracking, track_many
from trajopt.world.height_map import HeightMap
from trajopt.world.rough import rough_ground

Errors = list[list[float]]  # RMS errors, m: one list a command, one entry a field

GEOMETRY = AsocGeometry(4)
FIELD = 9.0  # m between the places of two runs on one ground, chosen
WIDE_FIELD = 21.0  # m, for physics by dead reckoning, which may end far from the path; chosen
STUDENT = {3: 4.303, 10: 2.262, 20: 2.093}  # t, two-sided 95 %, by number of values
PHYSICS_SEED = 3  # of the rough ground in the engines
KNOWLEDGE = {
    (True, True): Knowledge(True, 2.0),
    (True, False): Knowledge(False, 2.0),
    (False, True): Knowledge(True, np.inf),
    (False, False): Knowledge(False, np.inf),
}  # as TABLE_10
PAIRS = (
    ("ground known against unknown, position at 0.5 Hz", (True, True), (True, False)),
    ("ground known against unknown, dead reckoning", (False, True), (False, False)),
    ("position at 0.5 Hz against dead reckoning, ground known", (True, True), (False, True)),
    ("position at 0.5 Hz against dead reckoning, ground unknown", (True, False), (False, False)),
)


@dataclass(frozen=True)
class Command:
    """A column group of Tables IX and X: what the robot should do, and on which friction."""

    name: str
    reference: Reference
    friction: float = FRICTION


FAST = Command("1.5 m/s", constant_speed(square_corners()))
NO_SLIP = Command("1.5 m/s, no slip", FAST.reference, np.inf)
PLANNED = Command("planned corners", planned_speed(square_corners()))
COMMANDS = (FAST, NO_SLIP, PLANNED)
NAMES = tuple(command.name for command in COMMANDS)
ACROSS = tuple(f"across, {name}" for name in NAMES)
STEPS = (*itertools.pairwise(TABLE_9), (0.0, 4.5))  # cm, pairs of roughness that are compared


@dataclass(frozen=True)
class Effort:
    """How much a run may take."""

    points: int
    fields: int  # rough places in Tables IX and X
    seeds: int  # rough grounds of Table X in physics
    physics: tuple[float, ...]  # sigmas, m
    pareto: int  # generations
    knowledge: tuple[float, ...]  # sigmas of Table X in physics, m


FULL = Effort(4096, 20, 10, (0.0, 0.015, 0.03, 0.045), 100, (0.03,))
QUICK = Effort(512, 3, 3, (), 20, ())


def places(sigma: float, count: int) -> tuple[HeightMap, Array]:
    """One ground with ``count`` independent fields in rows, and where they start."""
    side = int(np.ceil(np.sqrt(count)))
    ground = rough_ground(sigma, rng=np.random.default_rng(11), size=FIELD * side)
    return replace(ground, origin=(-2.0, -2.0)), FIELD * np.column_stack(
        np.divmod(np.arange(count), side)
    )


def runs(sigma: float, knowledge: Knowledge, command: Command, effort: Effort) -> list[Tracking]:
    ground, origins = places(sigma, effort.fields)
    return track_many(
        GEOMETRY,
        ground,
        command.reference,
        [knowledge] * effort.fields,
        origins,
        friction=command.friction,
    )


def interval(values: Sequence[float]) -> str:
    """Mean and 95 % interval in percent of the body length (1 m)."""
    array = 100 * np.array(values)
    half = STUDENT[len(array)] * array.std(ddof=1) / np.sqrt(len(array))
    return f"{array.mean():.2f} +- {half:.2f}"


def difference(less: Sequence[float], more: Sequence[float]) -> tuple[str, str]:
    """Mean paired difference with its 95 % interval, % of body length, and what it says."""
    gain = np.array(more) - np.array(less)
    half = STUDENT[len(gain)] * gain.std(ddof=1) / np.sqrt(len(gain))
    verdict = (
        "smaller"
        if gain.mean() > half
        else "larger"
        if gain.mean() < -half
        else "no difference seen"
    )
    return f"{100 * gain.mean():+.3f} +- {100 * half:.3f}", verdict


def tables_9_and_10(effort: Effort) -> tuple[ResultTable, ResultTable, ResultTable]:
    """Tables IX and X, and their paired differences field by field."""
    nine, by_sigma = table_9(effort)
    ten, by_knowledge = table_10(effort)
    pairs = [(f"IX: sigma {a:g} against {b:g} cm", by_sigma[a], by_sigma[b]) for a, b in STEPS]
    pairs += [(f"X: {name}", by_knowledge[less], by_knowledge[more]) for name, less, more in PAIRS]
    rows = [
        (name, *itertools.chain(*map(difference, first, second))) for name, first, second in pairs
    ]
    header = (
        "first against second",
        *itertools.chain(*((f"{c.name}: second - first", f"{c.name}: first is") for c in COMMANDS)),
    )
    return (
        nine,
        ten,
        ResultTable(
            "Tables IX, X: paired differences of the RMS error, % of body length, "
            f"{effort.fields} fields",
            header,
            rows,
        ),
    )


def across(found: Sequence[Sequence[Tracking]]) -> list[str]:
    return [interval([r.rms_across for r in part]) for part in found]


def table_9(effort: Effort) -> tuple[ResultTable, dict[float, Errors]]:
    rows, errors = [], {}
    for sigma, printed in TABLE_9.items():
        found = [runs(sigma / 100, Knowledge(), command, effort) for command in COMMANDS]
        errors[sigma] = [[r.rms for r in part] for part in found]
        rows.append(
            (
                f"{sigma:g}",
                f"{printed:.2f}",
                *map(interval, errors[sigma]),
                *across(found),
                f"{np.degrees(max(np.abs(r.inclination).max() for r in found[0])):.0f}",
                f"{100 * np.mean([r.airborne.mean() for r in found[0]]):.1f}",
            )
        )
    return ResultTable(
        "Table IX: RMS error, % of body length (1 m), kinematic, ground and position known",
        ("sigma, cm", "printed", *NAMES, *ACROSS, "steepest wheel, deg", "wheels in the air, %"),
        rows,
    ), errors


def table_10(effort: Effort) -> tuple[ResultTable, dict[tuple[bool, bool], Errors]]:
    rows, errors = [], {}
    for case, printed in TABLE_10.items():
        found = [runs(0.03, KNOWLEDGE[case], command, effort) for command in COMMANDS]
        errors[case] = [[r.rms for r in part] for part in found]
        rows.append(
            (
                "0.5 Hz" if case[0] else "dead reckoning",
                "known" if case[1] else "unknown",
                f"{printed:.2f}",
                *map(interval, errors[case]),
                *across(found),
            )
        )
    return ResultTable(
        "Table X: RMS error by knowledge, kinematic, sigma 3 cm (not printed; chosen)",
        ("position", "ground", "printed", *NAMES, *ACROSS),
        rows,
    ), errors


def ground_of(sigma: float) -> HeightMap:
    if sigma == 0:
        return HeightMap(np.zeros((40, 40)), 0.25, (-2.5, -2.5))
    return replace(
        rough_ground(sigma, rng=np.random.default_rng(PHYSICS_SEED), size=FIELD),
        origin=(-2.0, -2.0),
    )


def physics(effort: Effort) -> tuple[ResultTable, list[tuple[str, AsocRun]]]:
    rows, kept = [], []
    cases = itertools.product(
        ("pybullet", "mujoco"), effort.physics, (FAST, PLANNED), (False, True)
    )
    for name, sigma, command, driven in cases:
        if driven and sigma != 0.015:
            continue
        label = (name, f"{100 * sigma:g}", command.name, "driven" if driven else "passive")
        try:
            run = drive_asoc(
                GEOMETRY, ground_of(sigma), command.reference, driven_pivots=driven, engine=name
            )
        except SimulationError as error:
            rows.append((*label, "", "", "", "", str(error)))
            continue
        if not driven:
            kept.append((f"{name}, {100 * sigma:g} cm, {command.name}", run))
        rows.append(
            (
                *label,
                f"{100 * run.rms:.2f}",
                f"{100 * run.rms_across:.2f}",
                str(run.losses),
                f"{100 * run.airborne_share:.1f}",
                f"{run.recording.real_time_factor:.1f} x real time",
            )
        )
    return ResultTable(
        "Physics: 65 kg, friction 0.6; RMS error in % of body length (printed for sigma 0: 8.67)",
        (
            "engine",
            "sigma, cm",
            "speed",
            "pivots",
            "RMS",
            "RMS across",
            "contacts lost",
            "wheels in the air, %",
            "note",
        ),
        rows,
    ), kept


def physics_knowledge(effort: Effort) -> ResultTable:
    """Table X with planned corners in MuJoCo, one rough field a seed, paired."""
    rows: list[tuple[str, ...]] = []
    for sigma in effort.knowledge:
        errors: dict[tuple[bool, bool], list[float]] = {case: [] for case in KNOWLEDGE}
        for seed in range(effort.seeds):
            ground = rough_ground(sigma, rng=np.random.default_rng(100 + seed), size=WIDE_FIELD)
            ground = replace(
                ground, origin=((4.5 - WIDE_FIELD) / 2,) * 2
            )  # the square in the middle
            for case, knowledge in KNOWLEDGE.items():
                run = drive_asoc(
                    GEOMETRY, ground, PLANNED.reference, knowledge=knowledge, engine="mujoco"
                )
                errors[case].append(run.rms)
        label = f"{100 * sigma:g}"
        rows += [
            (
                label,
                "0.5 Hz" if case[0] else "dead reckoning",
                "known" if case[1] else "unknown",
                interval(values),
                "",
            )
            for case, values in errors.items()
        ]
        rows += [
            (label, name, "", *difference(errors[less], errors[more])) for name, less, more in PAIRS
        ]
    return ResultTable(
        "Table X in physics (MuJoCo, planned corners): RMS error, % of body length; then paired "
        "differences, second - first",
        ("sigma, cm", "position", "ground", "RMS or difference", "first is"),
        rows,
    )
