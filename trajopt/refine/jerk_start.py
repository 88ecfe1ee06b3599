"""Where programs of jerk-limited motions start, and how fine they are where."""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array
from trajopt.timing.trajectory import Trajectory

_JUMP = 0.1  # of the largest acceleration, from which nodes are graded around a jump; chosen


def least_time(length: float, jerk: float) -> float:
    """Of every motion from rest to rest whose jerk is bounded, s."""
    return float((32 * length / jerk) ** (1 / 3))


def first_guess(trajectory: Trajectory, jerk: float, n: int, slower: float) -> tuple[Array, Array]:
    """Shares (N,) of the duration, and a start there: the time-optimal motion, run slower by what
    its largest accelerations need to build up at ``jerk``, and by the factor ``slower``; or where the
    jerk alone takes longer, its closed form."""
    fastest, least = trajectory.duration, least_time(trajectory.path.length, jerk)
    peak = float(max(np.abs(trajectory.inside(share)[3]).max() for share in (0.001, 0.999)))
    if least > fastest:
        shares = np.full(4 * ((n + 3) // 4), 1.0)
        shares /= len(shares)
        return shares, _quarters(trajectory.path.length, jerk, least * slower, shares)
    stretch = slower * (1.0 + min(peak / jerk / fastest, least / fastest))
    shares = _graded(trajectory, min(peak / jerk / fastest, 0.1), n, peak)
    t = np.concatenate([[0.0], np.cumsum(shares)]) * fastest
    s, v, a = trajectory.along(np.minimum(t, fastest))
    v, a = v / stretch, a / stretch**2
    a[[0, -1]] = v[[0, -1]] = 0.0
    h = shares * fastest * stretch
    bend = np.clip(np.diff(a) / h, -jerk, jerk)
    return shares, np.concatenate([s, v, a, bend, [fastest * stretch]])


def _quarters(length: float, jerk: float, total: float, shares: Array) -> Array:
    """The start that turns a constant jerk over at the quarters of its time ``total``."""
    t = np.concatenate([[0.0], np.cumsum(shares)]) * 4
    j = np.where((t[:-1] < 1 - 1e-9) | (t[:-1] > 3 - 1e-9), 1.0, -1.0)
    h = np.diff(t)
    a = np.concatenate([[0.0], np.cumsum(j * h)])
    v = np.concatenate([[0.0], np.cumsum(h * (a[:-1] + j * h / 2))])
    s = np.concatenate([[0.0], np.cumsum(h * (v[:-1] + h * (a[:-1] / 2 + j * h / 6)))])
    unit, size = total / 4, length / s[-1]  # of time, and of s
    parts = [
        s * size,
        v * size / unit,
        a * size / unit**2,
        np.clip(j * size / unit**3, -jerk, jerk),
    ]
    return np.concatenate([*parts, [total]])


def _graded(trajectory: Trajectory, ramp: float, n: int, peak: float) -> Array:
    """Shares of the duration: N even ones, and finer ones in which the largest acceleration builds up
    (``ramp``, a share) where the time-optimal acceleration jumps."""
    even = np.arange(n + 1) / n
    first, last = (trajectory.inside(share)[3] for share in (1e-3, 1 - 1e-3))
    jumps = np.abs(np.concatenate([first, [0.0]]) - np.concatenate([[0.0], last]))
    places = (trajectory.times / trajectory.duration)[jumps > _JUMP * peak]
    steps = np.concatenate([np.arange(1, 17) / 8, 2 * 1.5 ** np.arange(1, 60)]) * ramp
    steps = np.concatenate([[0.0], steps[steps < 1 / n]])
    kept: list[float] = []
    for place in places.tolist():
        if not kept or place - kept[-1] > 2 * ramp:
            kept.append(place)
    near = (np.array(kept)[:, None] + np.concatenate([-steps, steps])).ravel()
    found = np.unique(np.concatenate([even, near[(near > 0) & (near < 1)]]))
    wide = np.concatenate([[True], np.diff(found) > min(ramp / 8, 0.1 / n)])
    wide[-1] = True
    return np.diff(found[wide])
