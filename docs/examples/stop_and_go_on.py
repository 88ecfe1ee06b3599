"""A search that a callback ends, and that goes on later from its file with the same bits."""

from pathlib import Path

import numpy as np

import trajopt


def cost(x):
    return float(np.sum(x**2 - 10 * np.cos(2 * np.pi * x)) + 10 * len(x))


def search(evaluations, state=None):
    return trajopt.minimize(
        cost,
        [[-5, 5]] * 6,
        optimizer="cma-es",
        seed=1,
        budget=trajopt.Budget(evaluations=evaluations),
        state=state,
    )


saved = Path("search.npz")
first = search(3000, saved)
print(f"after {first.nfev} evaluations {first.fun:.3f}")
second = search(6000, saved)
print(f"after {second.nfev} evaluations {second.fun:.3f}")
assert second.fun <= first.fun
