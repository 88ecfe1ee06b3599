"""Places on level ground that no path joins: rows there tell what limits hold of a path."""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array
from trajopt.paths.samples import PathSamples


def made_up(count: int) -> tuple[PathSamples, Array]:
    """Samples at places that no path joins, and their features (N, 11)."""
    rng = np.random.default_rng(20)
    twist, rate = rng.uniform(-1, 1, (2, count, 3))
    samples = samples_of_twists(twist, rate)
    p = np.hypot(twist[:, 0], twist[:, 1])
    p1 = np.sum(twist[:, :2] * rate[:, :2], axis=1) / p
    w = twist[:, 2:]
    return samples, np.column_stack([twist, p, rate, p1, w * w, w * twist[:, :2]])


def samples_of_twists(twist: Array, rate: Array) -> PathSamples:
    count, w = len(twist), twist[:, 2]
    zero, rng = np.zeros(count), np.random.default_rng(21)
    return PathSamples(
        s=rng.uniform(0, 1, count),
        u=rng.uniform(0, 1, count),
        position=np.column_stack([rng.uniform(-1, 1, (count, 2)), zero]),
        yaw=rng.uniform(-3, 3, count),
        tangent=rng.uniform(-1, 1, (count, 3)),
        twist=twist,
        twist_rate=rate,
        acceleration_rate=np.column_stack(
            [rate[:, 0] - w * twist[:, 1], rate[:, 1] + w * twist[:, 0], zero]
        ),
        gravity=np.column_stack([zero, zero, zero - 1]),
        curvature=rng.uniform(-1, 1, count),
        slope=zero,
        velocity=np.column_stack([twist[:, :2], zero]),
        turning=np.column_stack([zero, zero, w]),
        turning_rate=np.column_stack([zero, zero, rate[:, 2]]),
    )
