"""The map of a castor's direction over a stretch of path, against SciPy and its own order."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from trajopt.robots.swivel import Swivel

GAUSS = 0.5 + np.array([-1.0, 0.0, 1.0]) * np.sqrt(15.0) / 10
TRAIL = np.array([0.3, 0.7])


def velocity(u: np.ndarray) -> np.ndarray:
    """(N, 2): of two pivots, complex."""
    first = 1.0 + 0.4 * u - 0.7 * u**2 + 1j * (0.3 - 0.8 * u + 0.5 * u**2)
    return np.stack([first, 0.2 * u - 1j * np.cos(2 * u)], axis=-1)


def turning(u: np.ndarray) -> np.ndarray:
    return np.asarray(0.9 - 1.1 * u + 0.6 * np.sin(3 * u))


def mapped(begin: float, length: float, angle: np.ndarray) -> np.ndarray:
    u = begin + length * GAUSS
    found = Swivel.of(velocity(u)[None], turning(u)[None], np.array([length]), TRAIL)
    return found.follow(angle)[-1]


@pytest.mark.parametrize("angle", [(0.3, -1.0), (2.5, 1.4)])
def test_a_stretch_is_exact_to_the_sixth_order(angle: tuple[float, float]) -> None:
    def rate(u: float, angle: np.ndarray) -> np.ndarray:
        v, w = velocity(np.array(u)), turning(np.array(u))
        return np.asarray(np.imag(v * np.exp(-1j * angle)) / TRAIL - w)

    start, off = np.array(angle), []
    for length in (0.2, 0.1):
        run = solve_ivp(rate, (0.4, 0.4 + length), start, "DOP853", rtol=1e-13, atol=1e-14)
        off.append(np.abs(mapped(0.4, length, start) - run.y[:, -1]))
    assert off[1].max() < 1e-8
    assert np.all(off[0] / off[1] > 60)  # 2^7 = 128


def test_steady_turning_is_exact_whatever_the_length() -> None:
    # |v| < trail |w|: the castor goes round for ever; |v| > trail |w|: it settles
    start = np.array([0.4, -0.9])
    for speed in (0.05, 2.0):
        v = np.full((1, 3, 2), speed * np.exp(0.3j))
        found = Swivel.of(v, np.full((1, 3), 0.8), np.array([1.5]), TRAIL).follow(start)[-1]

        def rate(_: float, angle: np.ndarray, speed: float = speed) -> np.ndarray:
            return np.asarray(speed * np.sin(0.3 - angle) / TRAIL - 0.8)

        run = solve_ivp(rate, (0, 1.5), start, "DOP853", rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(found, run.y[:, -1], atol=1e-11)
