"""A plugin file as users write them: an own optimizer and problems of every bad kind."""

import time
from dataclasses import dataclass

import numpy as np

from trajopt.objectives.base import Evaluation
from trajopt.optimize.base import Status


@dataclass(frozen=True)
class RandomSearch:
    name = "random-search"
    needs = frozenset()
    stochastic = True

    def search(self, run, x0, rng):
        if x0 is not None:
            run.evaluate(x0[None])
        while True:
            run.evaluate(rng.uniform(*run.bounds.T, size=(20, len(run.bounds))))
            run.nit += 1


OPTIMIZERS = {"random-search": RandomSearch}


@dataclass(frozen=True)
class Bad:
    kind: str
    dimension = 2
    provides = frozenset()
    constrained = False

    def evaluate(self, x):
        cost = (x * x).sum(axis=1)
        if self.kind == "raises":
            raise RuntimeError("on purpose")
        if self.kind == "hangs":
            time.sleep(60.0)
        if self.kind == "changes its argument":
            x[:] = 1e9
        bad = {
            "returns NaN": np.full(len(x), np.nan),
            "returns inf": np.full(len(x), np.inf),
            "wrong shape": np.ones((len(x), 3)),
        }
        return Evaluation(bad.get(self.kind, cost), np.zeros(len(x)))

    def score(self, x):
        return self.evaluate(np.array(x)[None])


PROBLEMS = {
    f"bad/{kind}": (lambda kind=kind: (Bad(kind), [[-1.0, 2.0]] * 2))
    for kind in (
        "raises",
        "hangs",
        "returns NaN",
        "returns inf",
        "wrong shape",
        "changes its argument",
        "good",
    )
}
assert Status.CONVERGED
