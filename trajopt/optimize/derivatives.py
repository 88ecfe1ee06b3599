"""Derivatives of a run's objective, and the way back onto constraints."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from trajopt.arrays import Array
from trajopt.objectives.base import Capability
from trajopt.optimize.base import Stop
from trajopt.optimize.violations import excess, rounding

if TYPE_CHECKING:
    from trajopt.optimize.run import Run

_DIFFERENCE = 1.5e-8  # of the width: step of forward differences, square root of the rounding
_ROUNDING = 1.5e-14  # of the value: least step, some 64 units of rounding, chosen
_STEPS_BACK = 3  # onto constraints that are missed by little, chosen
_LITTLE = 1e-2  # of the width, largest of those steps, chosen


class NoGradient(Exception):
    """A derivative is not finite: this start of a local method can go no further."""


class Derivatives:
    """The objective's own where it has them, else forward differences on the scale of the bounds,
    one batch of evaluations. The last point's are kept."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self._last: tuple[Array, Array, Array] | None = None

    def at(self, x: Array) -> tuple[Array, Array]:
        """Gradient of the cost (d,) and of each constraint (m, d) at x (d,). Raises NoGradient
        where they are not finite."""
        run = self.run
        x = np.clip(x, *run.bounds.T)
        if self._last is not None and np.array_equal(x, self._last[0]):
            return self._last[1], self._last[2]
        d, m = len(x), 0 if run.limits is None else run.limits.shape[1]
        own = Capability.GRADIENT in run.objective.provides
        own_rows = m == 0 or Capability.JACOBIAN in run.objective.provides
        gradient, rows = np.zeros(d), np.zeros((m, d))
        if not (own and own_rows):
            gradient, rows = self._differences(x)
        if own:
            run.ngev += 1
            gradient = self._own("gradient", x, (d,))
        if m and own_rows:
            rows = self._own("jacobian", x, (m, d))
        if not (np.isfinite(gradient).all() and np.isfinite(rows).all()):
            self._no_gradient(x, "not finite")
        self._last = x.copy(), gradient, rows
        return gradient, rows

    def _own(self, name: str, x: Array, shape: tuple[int, ...]) -> Array:
        try:
            found = np.asarray(getattr(self.run.objective, name)(x.copy()), dtype=np.float64)
            if found.size != math.prod(shape):
                raise ValueError(f"shape {found.shape}, expected {shape}")
        except Stop:
            raise
        except Exception as error:
            self._no_gradient(x, f"{type(error).__name__}: {error}")
        return found.reshape(shape)

    def _no_gradient(self, x: Array, reason: str) -> NoReturn:
        said = f"the gradient is no use at {x.tolist()}: {reason}"
        self.run.answers.count(1, said)
        raise NoGradient(said)

    def _differences(self, x: Array) -> tuple[Array, Array]:
        run = self.run
        here = run.at(x)
        # Where bounds are narrow for their size: at least some units of rounding.
        least = np.minimum(_ROUNDING * np.abs(x), run.width / 2)
        step = np.maximum(_DIFFERENCE * run.width, least)
        ahead = x + np.diag(np.where(x + step > run.bounds[:, 1], -step, step))
        there = run.evaluate(ahead, inside=True)
        step = np.diagonal(ahead) - x  # as rounded
        rows = np.zeros((0, len(x)))
        with np.errstate(invalid="ignore"):
            gradient = (there.cost - here.cost[0]) / step
            if here.constraints is not None and there.constraints is not None:
                rows = ((there.constraints - here.constraints) / step[:, None]).T
        return gradient, rows


def onto_constraints(run: Run, x: Array) -> Array:
    """``x`` (d,), where a local method ended, moved the shortest way (on the scale of the bounds)
    onto the constraints that it breaks by little, as such methods do."""
    for _ in range(_STEPS_BACK):
        here = run.at(x)
        if here.constraints is None or here.limits is None or run.remaining() < 2:
            return x
        values, (low, high) = here.constraints, here.limits
        over = excess(values, here.limits, rounding(here.limits))[0]
        broken = over > 0
        if not broken.any() or not np.isfinite(over).all():
            return x
        target = np.where(values[0] < low, low, high) - values[0]
        rows = run.derivatives(x)[1][broken] * run.width
        step = np.linalg.lstsq(rows, target[broken], rcond=1e-10)[0]
        if np.abs(step).max() > _LITTLE:
            return x
        x = np.clip(x + run.width * step, *run.bounds.T)
    run.at(x)
    return x
