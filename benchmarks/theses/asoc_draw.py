"""Figures of [udengaard2008] drawn anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.common import OUT
from benchmarks.theses.asoc_pictures import (
    curve_figure,
    front_figure,
    map_figure,
    speed_figure,
    tracks_figure,
)
from benchmarks.theses.asoc_reference import FIGURE_9, FIGURE_11, TABLE_9, TABLE_10
from benchmarks.theses.asoc_study import full_factorial, square_corners
from benchmarks.theses.asoc_tables_tracking import FAST, GEOMETRY, KNOWLEDGE, NO_SLIP, Effort, runs
from benchmarks.theses.pareto import ParetoFront
from trajopt.arrays import Array
from trajopt.report.robot_picture import robot_figure
from trajopt.report.style import in_style, save_figure
from trajopt.systems.asoc.design import TERMS, AsocDesign
from trajopt.systems.asoc.isotropy import mean_isotropy, spread_modules
from trajopt.systems.asoc.modules import asoc_robot, link_velocities, wheel_steering
from trajopt.systems.asoc.run import AsocRun
from trajopt.systems.asoc.tracking import Knowledge

FIGURES = OUT / "asoc"


def mean(places: Array, ratio: float, effort: Effort, **options: object) -> float:
    found = mean_isotropy(
        places, ratio, rng=np.random.default_rng(0), points=effort.points, shifts=4, **options
    )  # type: ignore[arg-type]  # options of several types
    return found.value


def ring(first: float, second: float) -> Array:
    angles = np.radians([0.0, first, second])
    return np.column_stack([np.cos(angles), np.sin(angles)])


def draw_isotropy(effort: Effort) -> None:
    few = replace(effort, points=256)
    ratios = np.linspace(0.8, 4.0, 49)
    curve = np.array([mean(spread_modules(3), float(r), few) for r in ratios])
    save_figure(
        curve_figure(
            ratios,
            curve,
            FIGURE_9,
            ("Figure 9: three ASOCs", "split / offset (–)", "mean isotropy (–)"),
        ),
        FIGURES / "figure_09.png",
    )
    angles = np.linspace(0, 120, 25)
    curve = np.array([mean(ring(a, 2 * a), 2.0, few) for a in angles])
    save_figure(
        curve_figure(
            angles,
            curve,
            FIGURE_11,
            ("Figure 11: modules at 0, a, 2a", "a (deg)", "mean isotropy (–)"),
        ),
        FIGURES / "figure_11.png",
    )
    split, offset = np.linspace(0.05, 0.5, 181), np.linspace(0.03, 0.25, 177)
    table = np.linspace(0.15, 18.0, 400)
    values = np.array([mean(spread_modules(4), float(r), replace(few, points=64)) for r in table])
    area = np.interp(split[None, :] / offset[:, None], table, values)
    save_figure(
        map_figure(split, offset, area, ("Figure 8: four ASOCs", "split (m)", "offset (m)")),
        FIGURES / "figure_08.png",
    )
    ratios, degrees = np.linspace(1.5, 3.2, 35), np.linspace(0, 45, 16)
    area = np.array(
        [
            [
                mean(
                    spread_modules(3),
                    float(r),
                    few,
                    tilts=(-np.radians(d), 0.0, np.radians(d)),
                    jacobian="forward",
                )
                for r in ratios
            ]
            for d in degrees
        ]
    )
    ridge = (2 / np.cos(np.radians(degrees)), degrees)
    save_figure(
        map_figure(
            ratios,
            degrees,
            area,
            ("Figure 13: tilts -max, 0, +max", "split / offset (–)", "largest tilt (deg)"),
            ridge,
        ),
        FIGURES / "figure_13.png",
    )


def draw_tracking(effort: Effort, physical: list[tuple[str, AsocRun]]) -> None:
    corners = square_corners()
    known = [(f"sigma {s:g} cm", runs(s / 100, Knowledge(), FAST, effort)[0]) for s in TABLE_9]
    save_figure(
        tracks_figure(
            corners, [(n, r.pose[:, :2]) for n, r in known], "Figure 29: 1.5 m/s, all known"
        ),
        FIGURES / "figure_29.png",
    )
    save_figure(
        speed_figure([(n, r.times[:-1], r.speed) for n, r in known[::3]], 1.5, "Figure 30: speed"),
        FIGURES / "figure_30.png",
    )
    blind = [
        (
            f"{'0.5 Hz' if p else 'dead reckoning'}, ground {'known' if t else 'unknown'}",
            runs(0.03, KNOWLEDGE[p, t], NO_SLIP, effort)[0].pose[:, :2],
        )
        for p, t in TABLE_10
    ]
    save_figure(
        tracks_figure(corners, blind, "Figure 31: sigma 3 cm, no slip"), FIGURES / "figure_31.png"
    )
    level = [(name, run.recording.pose[:, :2]) for name, run in physical if ", 0 cm" in name]
    if level:
        save_figure(
            tracks_figure(corners, level, "Physics, level ground"), FIGURES / "physics_level.png"
        )


def draw(
    effort: Effort, front: ParetoFront, design: AsocDesign, physical: list[tuple[str, AsocRun]]
) -> None:
    FIGURES.mkdir(parents=True, exist_ok=True)
    with in_style():
        draw_isotropy(effort)
        draw_tracking(effort, physical)
        peaks = np.array([design.peaks[t] for t in TERMS])
        best = np.array(list(design.describe(full_factorial(design)[0]).values())) / peaks
        save_figure(front_figure(front.terms / peaks, TERMS, best), FIGURES / "pareto.png")
        twist = np.array([0.6, 0.6, 0.7])
        links = link_velocities(GEOMETRY.positions, twist)
        trailing = np.arctan2(links[:, 1], links[:, 0]) - np.arcsin(
            GEOMETRY.offset * twist[2] / np.linalg.norm(links, axis=1)
        )  # modules at rest against the body
        save_figure(
            robot_figure(
                asoc_robot(GEOMETRY), steering=wheel_steering(GEOMETRY, trailing), twist=twist
            ),
            FIGURES / "platform.png",
        )
