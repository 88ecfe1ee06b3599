"""Array types, angles and checks of numbers that every room uses."""

from __future__ import annotations

from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trajopt.errors import ArgumentError

Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]
IndexArray = NDArray[np.intp]  # positions in another array
AnyArray = NDArray[Any]


@overload
def fold(angle: float, period: float = ...) -> float: ...
@overload
def fold(angle: Array, period: float = ...) -> Array: ...
def fold(angle: Any, period: float = 2.0 * np.pi) -> Any:
    """Angle modulo ``period``, rad, in [-period/2, period/2): the nearest way round.

    >>> fold(3.5 * np.pi) / np.pi
    -0.5
    """
    return angle - period * np.floor(angle / period + 0.5)


def rotation(angle: ArrayLike) -> Array:
    """Matrices (..., 2, 2) that turn plane vectors by ``angle`` (...), rad, counterclockwise: from
    the axes of a body with that heading to those of the world."""
    a = np.asarray(angle, dtype=np.float64)
    cos, sin = np.cos(a), np.sin(a)
    return np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=-2)


def require_finite(argument: str, value: ArrayLike, unit: str = "") -> None:
    """Raises ArgumentError unless ``value``, a number or an array, is finite everywhere."""
    expected = f"finite numbers, {unit}".rstrip(", ")
    if not np.all(np.isfinite(as_numbers(argument, value, expected))):
        raise ArgumentError(argument, value, expected)


def require_positive(argument: str, value: ArrayLike, unit: str = "") -> None:
    """Raises ArgumentError unless ``value``, a number or an array, is finite and > 0 everywhere."""
    expected = f"a finite value > 0 {unit}".rstrip()
    numbers = as_numbers(argument, value, expected)
    if not (np.all(np.isfinite(numbers)) and np.all(numbers > 0.0)):
        raise ArgumentError(argument, value, expected)


def require_not_negative(argument: str, value: ArrayLike, unit: str = "") -> None:
    """Raises ArgumentError unless ``value``, a number or an array, is finite and >= 0
    everywhere."""
    expected = f"a finite value >= 0 {unit}".rstrip()
    numbers = as_numbers(argument, value, expected)
    if not (np.all(np.isfinite(numbers)) and np.all(numbers >= 0.0)):
        raise ArgumentError(argument, value, expected)


def as_numbers(argument: str, value: Any, expected: str) -> Array:
    """``value`` as an array of real numbers. Raises ArgumentError, saying what was ``expected``,
    where it is none."""
    try:
        array = np.asarray(value)
        if (
            array.dtype.kind in "biuf" or array.dtype == object or array.size == 0
        ):  # no text, no complex numbers
            return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        pass
    raise ArgumentError(argument, value, expected) from None
