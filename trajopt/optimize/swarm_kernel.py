"""One iteration of a swarm as a numba kernel: the same bits as the NumPy form of ``swarm``.

No fast-math, so that every operation is rounded as NumPy rounds it; a test holds the two together
exactly.
"""

from __future__ import annotations

import numpy as np

from trajopt.kernels import kernel


@kernel()
def remember(x, own, own_cost, own_violation, cost, violation, level):  # type: ignore[no-untyped-def]
    """Update own bests in place by Deb's rule; the index of the swarm's best."""
    n, d = x.shape
    for i in range(n):
        new, old = violation[i] <= level, own_violation[i] <= level
        if new and old:
            improved = cost[i] < own_cost[i]
        elif new or old:
            improved = new
        else:
            improved = violation[i] < own_violation[i] or (
                violation[i] == own_violation[i] and cost[i] < own_cost[i]
            )
        if improved:
            own_cost[i], own_violation[i] = cost[i], violation[i]
            for j in range(d):
                own[i, j] = x[i, j]
    best, feasible = 0, own_violation[0] <= level
    for i in range(1, n):
        inside = own_violation[i] <= level
        if (
            (inside and not feasible)
            or (inside and own_cost[i] < own_cost[best])
            or (not feasible and own_violation[i] < own_violation[best])
        ):
            best, feasible = i, inside or feasible
    return best


@kernel()
def ring_leaders(own_cost, own_violation, level, reach, leaders):  # type: ignore[no-untyped-def]
    """Fill ``leaders`` (n,): the index of the best own position within ``reach`` places on the
    ring."""
    n = len(own_cost)
    for i in range(n):
        best = i
        for k in range(-reach, reach + 1):
            j = (i + k) % n
            new = 0.0 if own_violation[j] <= level else own_violation[j]
            old = 0.0 if own_violation[best] <= level else own_violation[best]
            if new < old or (
                new == old
                and (own_cost[j] < own_cost[best] or (own_cost[j] == own_cost[best] and j < best))
            ):
                best = j
        leaders[i] = best


@kernel()
def move(x, v, own, leaders, r, inertia, cognitive, social, low, high, limit):  # type: ignore[no-untyped-def]
    """Velocities and positions after one iteration, in place; how many coordinates lie outside.

    ``leaders`` (n,): whose own best position each particle follows.
    """
    n, d = x.shape
    outside = 0
    for i in range(n):
        leader = own[leaders[i]]
        for j in range(d):
            p = (own[i, j] - x[i, j]) * cognitive * r[0, i, j]
            q = (leader[j] - x[i, j]) * social * r[1, i, j]
            speed = v[i, j] * inertia + p + q
            speed = min(max(speed, -limit[j]), limit[j])
            v[i, j] = speed
            x[i, j] += speed
            outside += x[i, j] < low[j] or x[i, j] > high[j]
    return outside


def warm() -> None:
    """Load the kernels from the cache, or compile them."""
    x, one = np.zeros((2, 1)), np.ones(1)
    cost, leaders = np.zeros(2), np.zeros(2, dtype=np.intp)
    remember(x, x.copy(), cost.copy(), cost.copy(), cost, cost, 0.0)
    ring_leaders(cost, cost, 0.0, 1, leaders)
    move(x, x.copy(), x.copy(), leaders, np.zeros((2, 2, 1)), 0.5, 0.5, 0.5, -one, one, one)
