"""Race lines of the TUM's planner [heilmeier2020]: CSV with semicolons, the names of its columns in
the last comment."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.files import LARGEST, LARGEST_TABLE, content_of

COLUMNS = ("s_m", "x_m", "y_m", "psi_rad", "kappa_radpm", "vx_mps", "ax_mps2")
NORTH = math.pi / 2  # rad: headings count from the y axis


class RaceLine(NamedTuple):
    """``s`` (N,), m; ``points`` (N, 2), m; ``heading`` (N,), rad from the x axis, continuous;
    ``curvature`` (N,), 1/m; ``speed`` (N,), m/s; ``acceleration`` (N,), m/s^2, up to the next
    point."""

    s: Array
    points: Array
    heading: Array
    curvature: Array
    speed: Array
    acceleration: Array


def read_race_line(file: str | Path) -> RaceLine | None:
    """The race line in ``file``; None where its comments do not name these columns. Raises
    ArgumentError where its rows are others, OSError and ValueError where it cannot be read."""
    text = content_of(file, LARGEST_TABLE).decode("utf-8-sig")
    names = [line.lstrip("# ") for line in text[:4096].splitlines() if line.startswith("#")]
    if tuple(name.strip() for name in (names or [""])[-1].split(";")) != COLUMNS:
        return None
    expected = f"rows of {len(COLUMNS)} finite numbers, {'; '.join(COLUMNS)}"
    try:
        rows = np.loadtxt(io.StringIO(text), delimiter=";", ndmin=2)
    except ValueError as error:
        raise ArgumentError(str(file), str(error), expected) from None
    if rows.shape[1:] != (len(COLUMNS),) or not (np.abs(rows) <= LARGEST).all():
        raise ArgumentError(str(file), f"an array of shape {rows.shape}", expected)
    s, x, y, psi, curvature, speed, acceleration = rows.T
    points, heading = np.column_stack([x, y]), np.unwrap(psi + NORTH)
    return RaceLine(s, points, heading, curvature, speed, acceleration)
