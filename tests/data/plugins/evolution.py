"""An optimizer of one's own: a (1+1) evolution strategy with the 1/5th rule (Rechenberg 1973) and
restarts."""

import numpy as np

from trajopt.optimize.base import better


class EvolutionStrategy:
    name = "evolution-strategy"
    needs = frozenset()
    stochastic = True

    def search(self, run, start, rng):
        (low, high), step = run.bounds.T, 0.0
        while True:  # the run ends the search
            if step < 1e-9:
                x, told, step = (
                    rng.uniform(low, high) if run.nfev or start is None else start,
                    (np.inf, np.inf),
                    0.3,
                )
            y = (
                np.clip(x + step * (high - low) * rng.standard_normal(len(low)), low, high)
                if told[0] < np.inf
                else x
            )
            seen = run.evaluate(y[None])
            new = float(seen.cost[0]), float(seen.violation[0])
            won = better(*new, *told)
            x, told, step = (
                (y, new, 1.5 * step)
                if won
                else (rng.uniform(low, high) if told[0] == np.inf else x, told, step * 1.5**-0.25)
            )


OPTIMIZERS = {"evolution-strategy": EvolutionStrategy}
