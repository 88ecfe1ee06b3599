"""Random profiles against an independent check: the two linear programs of every interval solved by
looking at all corners, for many paths at once in NumPy.

``python -m tests.timing.retimings --count 1000000`` (about four minutes of a processor); ends with 1
where one differs.
"""

from __future__ import annotations

import argparse
import itertools
import sys

import numpy as np

from trajopt.arrays import Array, BoolArray
from trajopt.timing.compiled import fastest_profiles

POINTS, ROWS, BATCH = 9, 3, 2_000
CLOSE = 1e-6  # relative, of s'^2; corners are exact to about 1e-9 here


def instances(rng: np.random.Generator, count: int) -> tuple[Array, ...]:
    """``s``, ``a``, ``b``, ``c``, ``sd2_max``, ``start``, ``end``: some start or end too fast, some
    have rows that rest breaks."""
    s = np.cumsum(rng.uniform(0.05, 0.5, (count, POINTS)), axis=1)
    size = (count, POINTS, ROWS)
    a, b = rng.normal(0, 1, size), rng.normal(0, 1, size)
    a[rng.random(size) < 0.2] = 0.0
    c = rng.uniform(0.1, 1.0, size)
    c[rng.random(count) < 0.2, rng.integers(POINTS), 0] = rng.uniform(-0.5, 0.1)
    sd2_max = rng.uniform(0.2, 5.0, (count, POINTS))
    start, end = (np.where(rng.random(count) < 0.5, 0.0, rng.uniform(0, 0.5, count)) for _ in "ab")
    return s, a, b, c, sd2_max, start, end


def by_corners(
    s: Array, a: Array, b: Array, c: Array, sd2_max: Array, start: Array, end: Array
) -> tuple[Array, BoolArray]:
    """The same profiles (P, G), and where there is one (P,)."""
    paths = len(s)
    low, high = np.empty_like(s), np.empty_like(s)
    low[:, -1], high[:, -1] = end, np.where(end <= sd2_max[:, -1] + 1e-12, end, -1.0)
    found = high[:, -1] >= low[:, -1]
    for i in range(POINTS - 2, -1, -1):
        p, q, r = _interval(s, a, b, c, i, low[:, i + 1], high[:, i + 1])
        p = np.column_stack([p, np.zeros((paths, 2))])
        q = np.column_stack([q, np.full(paths, -1.0), np.ones(paths)])
        r = np.column_stack([r, np.zeros(paths), sd2_max[:, i]])
        least, most = np.full(paths, np.inf), np.full(paths, -np.inf)
        for j, k in itertools.combinations(range(p.shape[1]), 2):
            with np.errstate(all="ignore"):
                size = p[:, j] * q[:, k] - p[:, k] * q[:, j]
                u = (r[:, j] * q[:, k] - r[:, k] * q[:, j]) / size
                x = (p[:, j] * r[:, k] - p[:, k] * r[:, j]) / size
                left = r - p * u[:, None] - q * x[:, None]
                inside = (left > -1e-9 * (1 + np.abs(u) + np.abs(x))[:, None]).all(axis=1)
            inside &= np.abs(size) > 1e-12
            least = np.where(inside, np.minimum(least, x), least)
            most = np.where(inside, np.maximum(most, x), most)
        low[:, i], high[:, i] = np.maximum(least, 0.0), most
        found &= most >= least
    x = np.empty_like(s)
    x[:, 0] = start
    found &= (start >= low[:, 0] - 1e-9) & (start <= high[:, 0] + 1e-9)
    for i in range(POINTS - 1):
        p, q, r = _interval(s, a, b, c, i, low[:, i + 1], high[:, i + 1])
        with np.errstate(all="ignore"):
            u = np.where(p > 1e-12, (r - q * x[:, i, None]) / p, np.inf).min(axis=1)
            x[:, i + 1] = np.clip(x[:, i] + 2 * (s[:, i + 1] - s[:, i]) * u, 0.0, high[:, i + 1])
    return x, found


def _interval(
    s: Array, a: Array, b: Array, c: Array, i: int, low: Array, high: Array
) -> tuple[Array, Array, Array]:
    """p u + q x <= r of interval ``i``: rows at both ends, and the set at its right end."""
    d = 2 * (s[:, i + 1] - s[:, i])[:, None]
    p = np.hstack([a[:, i], a[:, i + 1] + d * b[:, i + 1], d, -d])
    one = np.ones_like(d)
    q = np.hstack([b[:, i], b[:, i + 1], one, -one])
    return p, q, np.hstack([c[:, i], c[:, i + 1], high[:, None], -low[:, None]])


def compared(count: int, seed: int) -> tuple[int, int, float]:
    """How many of ``count`` random profiles differ, how many have no motion, and the largest
    difference of the others."""
    rng, differ, none, largest = np.random.default_rng(seed), 0, 0, 0.0
    for first in range(0, count, BATCH):
        given = instances(rng, min(BATCH, count - first))
        x, failed = fastest_profiles(*given)
        other, found = by_corners(*given)
        same = (failed < 0) == found
        both = (failed < 0) & found
        off = np.abs(x[both] - other[both]).max(axis=1, initial=0.0) / (1 + x[both].max(axis=1))
        differ += int((~same).sum() + (off > CLOSE).sum())
        none += int((failed >= 0).sum())
        largest = max(largest, float(off[off <= CLOSE].max(initial=0.0)))
    return differ, none, largest


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    differ, none, largest = compared(options.count, options.seed)
    print(
        f"{options.count} profiles, {none} without a motion: {differ} differ; "
        f"else within {largest:.1e}"
    )
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
