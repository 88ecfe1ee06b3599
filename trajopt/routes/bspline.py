"""Clamped uniform cubic B-splines, which are paths of the package exactly."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from trajopt.arrays import Array
from trajopt.paths.path import Path
from trajopt.paths.spline import SplineBasis


@lru_cache(maxsize=64)
def knots_of(points: int) -> Array:
    """Knots of the B-spline with ``points`` control points: 1 apart, the ends fourfold."""
    inner = np.arange(points - 2, dtype=np.float64)
    return np.concatenate([np.zeros(3), inner, np.full(3, points - 3.0)])


def basis_rows(points: int, u: Array, derivative: int = 0) -> Array:
    """(M, n): the derivative of order 0, 1, 2 at u (M,) = rows @ control points (n, D)."""
    from scipy.interpolate import BSpline

    return np.asarray(BSpline(knots_of(points), np.eye(points), 3)(u, nu=derivative))


def as_path(points: Array, turning_length: float) -> Path:
    """The same curve as a path: control points (n, 2), along the tangent, or (n, 3) with yaw."""
    count = len(points)
    knots = np.arange(count - 2, dtype=np.float64)
    values = basis_rows(count, knots) @ points
    ends = basis_rows(count, knots[[0, -1]], 1) @ points
    basis = SplineBasis(tuple(knots.tolist()), clamped_start=True, clamped_end=True)
    whole = np.vstack([values, ends])
    heading = whole[:, 2] if points.shape[1] == 3 else None
    return Path(basis, whole[:, :2], heading, turning_length)


def fitted(places: Array, count: int, ends: tuple[Array, Array], free: bool) -> Array:
    """(count, 2 or 3): control points near a polyline (N, 2), between two poses (3,); yaw, if free,
    evenly from one to the other, the nearest way round."""
    step = np.linalg.norm(np.diff(places, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(step)])
    u = np.linspace(0.0, count - 3.0, 8 * count)
    share = u / (count - 3.0) * along[-1]
    target = np.column_stack([np.interp(share, along, places[:, k]) for k in (0, 1)])
    rows = basis_rows(count, u)
    bend = np.diff(np.eye(count), n=2, axis=0)  # evens out the corners of the grid's way
    matrix = np.vstack([rows, 1.0 * bend])
    right = np.vstack([target, np.zeros((count - 2, 2))])
    points = np.linalg.lstsq(matrix, right, rcond=None)[0]
    points[0], points[-1] = ends[0][:2], ends[1][:2]
    if free:
        turn = np.remainder(ends[1][2] - ends[0][2] + np.pi, 2 * np.pi) - np.pi
        return np.column_stack([points, ends[0][2] + turn * np.linspace(0.0, 1.0, count)])
    ray = along[-1] / (count - 3.0) / 3.0
    for at, pose, sign in ((1, ends[0], 1.0), (-2, ends[1], -1.0)):
        points[at] = pose[:2] + sign * ray * np.array([np.cos(pose[2]), np.sin(pose[2])])
    return np.asarray(points)
