"""The double wheel's geometry beside [guzman2015], and its closed form beside the point cloud."""

from __future__ import annotations

import math

import numpy as np

from benchmarks.common import ResultTable
from benchmarks.theses.smdw_study import CLOUD_POINTS, meet_step_cloud
from trajopt.systems.smdw.climbing import DEFAULT_WHEEL, FITTED_WHEEL, forward_alphas
from trajopt.systems.smdw.geometry import contact_offset, meet_step


def geometry() -> ResultTable:
    rows = []
    for name, wheel in (("default", DEFAULT_WHEEL), ("fitted to the print", FITTED_WHEEL)):
        offsets = 100 * contact_offset(wheel, np.radians([30.0, 60.0]))
        spans = [forward_alphas(wheel, 0.05, theta=t) for t in (0.0, None)]
        shown = [
            "none" if s is None else f"{-math.degrees(s[1]):.0f} to {-math.degrees(s[0]):.0f}"
            for s in spans
        ]
        rows.append(
            (
                name,
                f"{100 * wheel.radius:.2f}, {100 * wheel.minor_radius:.2f}",
                f"{offsets[0]:.2f}",
                f"{offsets[1]:.2f}",
                f"{100 * wheel.greatest_clearance:.2f}",
                *shown,
            )
        )
    rows.append(("thesis", "not printed", "4.63", "3.49", "5 (stated)", "-40 to -13", ""))
    return ResultTable(
        "Wheel geometry",
        (
            "sizes",
            "Rc, Re, cm",
            "offset at 30 deg, cm",
            "at 60 deg",
            "Rc - Re, cm",
            "forward alpha for 5 cm at theta 0, deg",
            "at any theta",
        ),
        rows,
    )


def agreement(quick: bool) -> ResultTable:
    """Largest difference between closed form and point cloud over wheel angle, yaw and three
    heights; none left out."""
    rows = []
    every = 30.0 if quick else 5.0  # deg
    yaws = np.radians(np.arange(-180.0 + every, 0.0, every))
    for name, wheel in (("default", DEFAULT_WHEEL), ("fitted to the print", FITTED_WHEEL)):
        apart, nodes, verdicts = np.zeros(4), 0, 0
        for height in (0.02, 0.035, 0.045):
            for theta in np.radians(np.arange(-180.0, 180.0, every)):
                exact = meet_step(wheel, theta, yaws, height)
                for k, yaw in enumerate(yaws):
                    cloud = meet_step_cloud(wheel, float(theta), float(yaw), height)
                    nodes, verdicts = (
                        nodes + 1,
                        verdicts + int(bool(cloud.over) != bool(exact.over[k])),
                    )
                    if cloud.over and exact.over[k]:
                        apart = np.maximum(
                            apart,
                            [
                                abs(cloud.clearance - exact.clearance[k]),
                                abs(cloud.offset - exact.offset[k]),
                                abs(cloud.arm - exact.arm[k]),
                                abs(math.degrees(cloud.tangent - exact.tangent[k])),
                            ],
                        )
        rows.append((name, str(nodes), str(verdicts), *(f"{value:.2g}" for value in apart)))
    return ResultTable(
        f"Wheel geometry: closed form against {CLOUD_POINTS:,} points, largest difference",
        (
            "sizes",
            "nodes",
            "verdicts that differ",
            "clearance, m",
            "contact offset, m",
            "lever arm, m",
            "tangent angle, deg",
        ),
        rows,
    )
