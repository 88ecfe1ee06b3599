"""How far points of a robot move at most along cubics: bounded from the control values of their
derivatives on the interval, which hold their range."""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array


def swept(cubics: Array, start: Array, size: Array, scale: float, reach: float) -> Array:
    """(N,): at least the way (m) of any point within ``reach`` (m) of the origin, from ``start`` on
    for ``size`` of the cubics' parameter; ``cubics`` (N, 4, D), whose last column, where ``scale`` >
    0, is the yaw times it."""
    c, h = cubics, size[:, None]
    t0, t1 = start[:, None], start[:, None] + h

    def first(t: Array) -> Array:
        return np.asarray(c[:, 1] + t * (2 * c[:, 2] + t * 3 * c[:, 3]))

    def second(t: Array) -> Array:
        return np.asarray(2 * c[:, 2] + 6 * t * c[:, 3])

    # Control values of the quadratic derivative on the interval: its range lies between them.
    q = np.stack([first(t0), first(t0) + h / 2 * second(t0), first(t1)])
    way = h[:, 0] * np.hypot(q[..., 0], q[..., 1]).mean(axis=0)
    if scale > 0:  # a heading of its own: the last column, times the turning length
        return np.asarray(way + reach * h[:, 0] * np.abs(q[..., -1]).mean(axis=0) / scale)
    mid = (t0 + t1) / 2
    a, m, b = (_cross(first(t), second(t)) for t in (t0, mid, t1))
    bend = np.max(np.abs([a, 2 * m - (a + b) / 2, b]), axis=0)
    ahead = q.sum(axis=0)
    size = np.hypot(ahead[:, 0], ahead[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        slowest = np.min(np.sum(q[..., :2] * ahead[:, :2], axis=2), axis=0) / size
        turn = np.where(slowest > 0, h[:, 0] * bend / slowest**2, np.inf)
    return np.asarray(way + reach * turn)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
