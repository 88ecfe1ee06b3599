"""Test functions for swarms, shifted and (every second instance) rotated: twelve to tune on, and
thirteen that were set aside before tuning.

Each takes z (n, d), which is 0 at the optimum, and gives (n,), 0 there. Sources: the classical
collections and those of the BBOB noiseless suite (Hansen et al. 2009), simplified where that suite
adds transformations of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from zlib import crc32

import numpy as np

from trajopt.arrays import Array
from trajopt.objectives.base import Objective
from trajopt.optimize.functions import FunctionObjective

BOUND = 5.0  # of every variable, on both sides
_PI2 = 2 * np.pi


def _powers(d: int, top: float) -> Array:
    return 10.0 ** (top * np.arange(d) / max(d - 1, 1))


def _sphere(z: Array) -> Array:
    return (z**2).sum(axis=1)


def _ellipsoid(z: Array) -> Array:
    return z**2 @ _powers(z.shape[1], 6.0)


def _discus(z: Array) -> Array:
    return 1e6 * z[:, 0] ** 2 + (z[:, 1:] ** 2).sum(axis=1)


def _cigar(z: Array) -> Array:
    return z[:, 0] ** 2 + 1e6 * (z[:, 1:] ** 2).sum(axis=1)


def _different_powers(z: Array) -> Array:
    d = z.shape[1]
    return np.sqrt((np.abs(z) ** (2 + 4 * np.arange(d) / max(d - 1, 1))).sum(axis=1))


def _valley(z: Array) -> Array:
    """(n, d - 1): the terms of Rosenbrock's function."""
    y = max(1.0, z.shape[1] ** 0.5 / 8) * z + 1
    return 100 * (y[:, :-1] ** 2 - y[:, 1:]) ** 2 + (y[:, :-1] - 1) ** 2


def _rosenbrock(z: Array) -> Array:
    return _valley(z).sum(axis=1)


def _rastrigin(z: Array) -> Array:
    return (z**2 - 10 * np.cos(_PI2 * z) + 10).sum(axis=1)


def _ackley(z: Array) -> Array:
    hollow = 20 * np.exp(-0.2 * np.sqrt((z**2).mean(axis=1)))
    return 20 - hollow + np.e - np.exp(np.cos(_PI2 * z).mean(axis=1))


def _griewank(z: Array) -> Array:
    y = 20 * z
    waves = np.cos(y / np.sqrt(np.arange(1.0, z.shape[1] + 1))).prod(axis=1)
    return (y**2).sum(axis=1) / 4000 - waves + 1


def _schwefel(z: Array) -> Array:
    y = 100 * z + 420.9687462275036
    beyond = np.maximum(np.abs(y) - 500, 0.0)
    y = np.sign(y) * (np.abs(y) - np.where(beyond > 0, 2 * (beyond % 500), 0.0))
    y = np.clip(y, -500, 500)
    terms = 418.9828872724338 - y * np.sin(np.sqrt(np.abs(y)))
    return np.abs(terms.sum(axis=1) + 0.01 * (beyond**2).mean(axis=1))


def _weierstrass(z: Array) -> Array:
    scale, waves = 0.5 ** np.arange(12), 3.0 ** np.arange(12)
    least = (scale * np.cos(np.pi * waves)).sum()
    terms = (scale * np.cos(_PI2 * waves * (z[..., None] / 2 + 0.5))).sum(axis=2)
    return 10 * np.abs(terms.mean(axis=1) - least) ** 3


def _schaffer(z: Array) -> Array:
    r = np.hypot(z[:, :-1], z[:, 1:])
    return (np.sqrt(r) * (1 + np.sin(50 * r**0.2) ** 2)).mean(axis=1) ** 2


def _sharp_ridge(z: Array) -> Array:
    return z[:, 0] ** 2 + 100 * np.sqrt((z[:, 1:] ** 2).sum(axis=1))


def _step_ellipsoid(z: Array) -> Array:
    steps = np.where(np.abs(z) > 0.5, np.floor(0.5 + z), np.floor(0.5 + 10 * z) / 10)
    return 0.1 * np.maximum(np.abs(z[:, 0]) / 1e4, steps**2 @ _powers(z.shape[1], 2.0))


def _attractive_sector(z: Array) -> Array:
    y = z * _powers(z.shape[1], 0.5)
    return (np.where(y > 0, 100 * y, y) ** 2).sum(axis=1) ** 0.9


def _levy(z: Array) -> Array:
    w = 1 + z / 4
    middle = (w[:, :-1] - 1) ** 2 * (1 + 10 * np.sin(np.pi * w[:, :-1] + 1) ** 2)
    last = (w[:, -1] - 1) ** 2 * (1 + np.sin(_PI2 * w[:, -1]) ** 2)
    return np.sin(np.pi * w[:, 0]) ** 2 + middle.sum(axis=1) + last


def _zakharov(z: Array) -> Array:
    t = 0.5 * z @ np.arange(1.0, z.shape[1] + 1)
    return (z**2).sum(axis=1) + t**2 + t**4


def _gallagher(z: Array) -> Array:
    d = z.shape[1]
    rng = np.random.default_rng(d)
    peaks, heights = rng.uniform(-7, 7, (21, d)), np.append(10.0, rng.uniform(1.1, 9.1, 20))
    peaks[0] = 0.0
    tops = []
    for p, (peak, height) in enumerate(zip(peaks, heights, strict=True)):
        place = (7 * np.arange(d) + 3 * p) % d / max(d - 1, 1)
        weights = 10.0 ** ((3 * place - 1.5) * p / len(heights))
        tops.append(height * np.exp(-((z - peak) ** 2 @ weights) / (2 * d)))
    return (10 - np.max(tops, axis=0)) ** 2


def _lunacek(z: Array) -> Array:
    d = z.shape[1]
    near = 2.5
    size = 1 - 1 / (2 * np.sqrt(d + 20.0) - 8.2)
    far = -np.sqrt((near**2 - 1) / size)
    second = d + size * ((z + near - far) ** 2).sum(axis=1)
    waves = d - np.cos(_PI2 * z).sum(axis=1)
    return np.minimum((z**2).sum(axis=1), second) + 10 * waves


def _griewank_rosenbrock(z: Array) -> Array:
    terms = _valley(z)
    return 10 * (terms / 4000 - np.cos(terms)).mean(axis=1) + 10


def _katsuura(z: Array) -> Array:
    d = z.shape[1]
    y = z[..., None] * 2.0 ** np.arange(1, 25)
    rough = (np.abs(y - np.floor(y + 0.5)) / 2.0 ** np.arange(1, 25)).sum(axis=2)
    factors = (1 + np.arange(1, d + 1) * rough) ** (10.0 / d**1.2)
    return 10.0 / d**2 * (factors.prod(axis=1) - 1)


def _happy_cat(z: Array) -> Array:
    d, y = z.shape[1], z - 1
    square, total = (y**2).sum(axis=1), y.sum(axis=1)
    return np.abs(square - d) ** 0.25 + (0.5 * square + total) / d + 0.5


def _alpine(z: Array) -> Array:
    return np.abs(z * np.sin(z) + 0.1 * z).sum(axis=1)


def _salomon(z: Array) -> Array:
    r = np.sqrt((z**2).sum(axis=1))
    return 1 - np.cos(_PI2 * r) + 0.1 * r


def _styblinski_tang(z: Array) -> Array:
    y = z - 2.903534027771178
    return np.abs((y**4 - 16 * y**2 + 5 * y + 78.33233140754282).sum(axis=1) / 2)


TRAINING: dict[str, Callable[[Array], Array]] = {
    "sphere": _sphere,
    "ellipsoid": _ellipsoid,
    "discus": _discus,
    "cigar": _cigar,
    "different-powers": _different_powers,
    "rosenbrock": _rosenbrock,
    "rastrigin": _rastrigin,
    "ackley": _ackley,
    "griewank": _griewank,
    "schwefel": _schwefel,
    "weierstrass": _weierstrass,
    "schaffer": _schaffer,
}
HELD_OUT: dict[str, Callable[[Array], Array]] = {
    "sharp-ridge": _sharp_ridge,
    "step-ellipsoid": _step_ellipsoid,
    "attractive-sector": _attractive_sector,
    "levy": _levy,
    "zakharov": _zakharov,
    "gallagher": _gallagher,
    "lunacek": _lunacek,
    "griewank-rosenbrock": _griewank_rosenbrock,
    "katsuura": _katsuura,
    "happy-cat": _happy_cat,
    "alpine": _alpine,
    "salomon": _salomon,
    "styblinski-tang": _styblinski_tang,
}
_BY_AXIS = ("schwefel", "styblinski-tang", "alpine")  # never rotated: wells outside the box


def instance(name: str, d: int, number: int) -> tuple[Objective, Array]:
    """The objective and its bounds (d, 2). Even instances are rotated."""
    rng = np.random.default_rng((crc32(name.encode()), d, number))
    turned = number % 2 == 0 and name not in _BY_AXIS
    rotation = np.linalg.qr(rng.standard_normal((d, d)))[0] if turned else np.eye(d)
    shift = rng.uniform(0.3, 0.8, d) if name == "schwefel" else rng.uniform(-3, 3, d)
    function = {**TRAINING, **HELD_OUT}[name]

    def value(x: Array) -> Array:
        return np.asarray(function((x - shift) @ rotation.T))

    return FunctionObjective(value, d, batch=True), np.tile([-BOUND, BOUND], (d, 1))
