"""Mean isotropy as a smooth function of split/offset, for optimisers: a cubic spline through the
quadrature.

The quadrature itself has kinks (where a tilted module is isotropic) and costs milliseconds; the
spline costs nothing, is twice differentiable and runs on numbers and symbols alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.systems.asoc.isotropy import mean_isotropy, spread_modules

LOWEST_RATIO, HIGHEST_RATIO = 0.5, 10.0  # split/offset that the design space can reach, chosen
PEAK = (1.4, 4.0)  # ratios between which knots are dense, chosen: Table II's optima lie inside
DENSE, COARSE = (
    24,
    5,
)  # knots inside and on either side; error below 2e-3, 6e-3 at the kink 2/cos(tilt); chosen
POINTS, SHIFTS = 512, 2  # of the quadrature at each knot; error below 5e-4, chosen
QUADRATURE_SEED = 0  # fixes the shifts of the quadrature, so that the curve is the same every time


@dataclass(frozen=True, eq=False)
class IsotropyCurve:
    """Natural cubic spline in x = ln(ratio), written twice: local cubics, and a line plus truncated
    cubes."""

    knots: Array  # (k,) ln(ratio)
    local: Array  # (k - 1, 4) coefficients of 1, dx, dx^2, dx^3 from each knot
    cubes: Array  # (k - 1,) weights of max(x - knot, 0)^3

    def at(self, ratio: Any) -> Any:
        """Mean isotropy at split/offset inside [0.5, 10]: an array, or one number or symbol."""
        x = np.log(ratio)
        if isinstance(x, np.ndarray) and x.ndim > 0:
            return self._local(x)
        beyond = np.maximum(x - self.knots[:-1], 0.0)
        return (
            self.local[0, 0]
            + self.local[0, 1] * (x - self.knots[0])
            + np.sum(self.cubes * beyond * beyond * beyond)
        )

    def _local(self, x: Array) -> Array:
        """The same curve by looking the interval up: fast on arrays of designs (equal to
        rounding)."""
        i = np.clip(np.searchsorted(self.knots, x, side="right") - 1, 0, len(self.local) - 1)
        d = x - self.knots[i]
        a, b, c, e = (self.local[:, k][i] for k in range(4))
        return np.asarray(a + d * (b + d * (c + d * e)))


@lru_cache(maxsize=16)
def isotropy_curve(modules: int, tilt: float) -> IsotropyCurve:
    """The curve of N equally spaced modules that tilt by {-tilt, 0, +tilt} (rad) independently
    (Table II)."""
    low, high = np.log(PEAK)
    x = np.concatenate(
        [
            np.linspace(np.log(LOWEST_RATIO), low, COARSE, endpoint=False),
            np.linspace(low, high, DENSE, endpoint=False),
            np.linspace(high, np.log(HIGHEST_RATIO), COARSE + 1),
        ]
    )
    places, tilts = spread_modules(modules), ((-tilt, 0.0, tilt) if tilt else (0.0,))
    values = np.array(
        [
            mean_isotropy(
                places,
                float(r),
                rng=np.random.default_rng(QUADRATURE_SEED),
                tilts=tilts,
                jacobian="forward",
                points=POINTS,
                shifts=SHIFTS,
            ).value
            for r in np.exp(x)
        ]
    )
    return _natural_spline(x, values)


def _natural_spline(x: Array, y: Array) -> IsotropyCurve:
    """Natural cubic spline through (x, y)."""
    h, slope = np.diff(x), np.diff(y) / np.diff(x)
    system = np.eye(len(x))
    right = np.zeros(len(x))
    for i in range(1, len(x) - 1):
        system[i, i - 1 : i + 2] = h[i - 1], 2 * (h[i - 1] + h[i]), h[i]
        right[i] = 6 * (slope[i] - slope[i - 1])
    bend = np.linalg.solve(system, right)  # second derivatives
    third = np.diff(bend) / h
    first = slope - h * (2 * bend[:-1] + bend[1:]) / 6
    local = np.column_stack([y[:-1], first, bend[:-1] / 2, third / 6])
    return IsotropyCurve(x, local, np.diff(third, prepend=0.0) / 6)
