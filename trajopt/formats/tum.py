"""Race lines of the TUM's planner [heilmeier2020]: ``s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2``.

Headings count from the y axis, counter-clockwise; the acceleration of a row holds up to the next
one. ``[path] file`` reads such files.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from trajopt.arrays import fold
from trajopt.errors import ArgumentError
from trajopt.formats.rosbag import sample_times
from trajopt.paths.race_line import COLUMNS, NORTH
from trajopt.report.files import write_text
from trajopt.timing.trajectory import Trajectory

_STILL = 1e-9  # m between rows: a rest is one row


def write(trajectory: Trajectory, file: Path, sample_time: float) -> int:
    """Rows in steps of ``sample_time``, s, and at the end; returns how many. Raises ArgumentError
    for a motion that is not along its path on level ground."""
    path = trajectory.path
    back = bool((path.facing(trajectory.u) < 0).any())
    if path.heading is not None or back or not trajectory.ground.level:
        other = "driven backward" if back else "a hill"
        value = other if path.heading is None else "a free heading"
        expected = (
            "a motion forward along its path on level ground: race lines have no other heading"
        )
        raise ArgumentError("--format tum", value, expected)
    s, v, _ = trajectory.along(sample_times(trajectory, sample_time))
    kept = np.append(True, np.diff(s) > _STILL)
    s, v = s[kept], v[kept]
    u = path.locate(s)
    (x, y), (dx, dy), (ddx, ddy) = (path.position(u, k)[:, :2].T for k in range(3))
    curvature = (dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3
    psi = fold(np.arctan2(dy, dx) - NORTH)
    a = np.append(np.diff(v**2) / (2 * np.diff(s)), 0.0)
    rows = np.column_stack([s, x, y, psi, curvature, v, a])
    lines = ["# " + "; ".join(COLUMNS), *("; ".join(map(repr, row)) for row in rows.tolist())]
    write_text(file, "\n".join(lines) + "\n")
    return len(rows)
