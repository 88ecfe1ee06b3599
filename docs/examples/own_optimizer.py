"""An optimizer of one's own, also by `trajopt solve my.toml --optimizer own_optimizer.py:walk`."""

import numpy as np

import trajopt


class Walk:
    """A random walk that keeps what is better and shortens its steps where nothing was."""

    name = "walk"
    needs = frozenset()  # what an objective must offer besides values: nothing
    stochastic = True

    def search(self, run, start, rng):
        low, high = run.bounds.T
        best = (low + high) / 2 if start is None else start
        value, step = run.cost(best), 0.3
        while True:  # the run counts, keeps the best and ends the search
            tried = np.clip(best + step * (high - low) * rng.standard_normal(len(low)), low, high)
            found = run.cost(tried)
            if found < value:
                best, value = tried, found
            else:
                step = max(0.98 * step, 1e-9)


OPTIMIZERS = {"walk": Walk}

if __name__ == "__main__":
    budget = trajopt.Budget(evaluations=2000)

    def square(x):
        return float(np.sum((x - 0.3) ** 2))

    for optimizer in (Walk(), "pso"):
        found = trajopt.minimize(square, [[-1, 1]] * 5, optimizer=optimizer, seed=0, budget=budget)
        print(f"{found.optimizer}: {found.fun:.1e} in {found.nfev} evaluations")
