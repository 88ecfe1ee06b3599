"""Array types, angles and checks of numbers that every room uses."""

from __future__ import annotations

from collections.abc import Callable, Iterable
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


Shape = tuple[int | None, ...]  # of an array; None: any length


def as_numbers(argument: str, value: Any, expected: str, shape: Shape | None = None) -> Array:
    """``value`` as an array of real numbers, of ``shape`` where one is given: no texts, no masks, no
    complex numbers, nothing ragged; what a masked array hides is not a number. Raises ArgumentError,
    saying what was ``expected``."""
    try:
        if isinstance(value, np.ma.MaskedArray):
            value = np.ma.filled(value.astype(np.float64), np.nan)
        array = np.asarray(value)
        if array.dtype == object and all(_is_real(v) for v in array.flat):  # whole ones of any size
            array = array.astype(np.float64)
        if array.dtype.kind in "iuf" or array.size == 0:
            with np.errstate(over="ignore"):  # long doubles
                array = np.asarray(value, dtype=np.float64)
            if shape is None or (
                len(shape) == array.ndim
                and all(n in (None, m) for n, m in zip(shape, array.shape, strict=True))
            ):
                return array
    except (TypeError, ValueError, ArithmeticError):
        pass
    raise ArgumentError(argument, value, expected) from None


def _is_real(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def require_finite(
    argument: str, value: ArrayLike, unit: str = "", shape: Shape | None = ()
) -> Array:
    """``value``, a number or an array of ``shape`` (None: any), where it is finite everywhere.
    Raises ArgumentError."""
    return _where(np.isfinite, argument, value, f"finite numbers, {unit}".rstrip(", "), shape)


def require_positive(
    argument: str, value: ArrayLike, unit: str = "", shape: Shape | None = ()
) -> Array:
    """As ``require_finite``, > 0 everywhere."""
    expected = f"a finite value > 0 {unit}".rstrip()
    return _where(lambda a: np.isfinite(a) & (a > 0), argument, value, expected, shape)


def require_not_negative(
    argument: str, value: ArrayLike, unit: str = "", shape: Shape | None = ()
) -> Array:
    """As ``require_finite``, >= 0 everywhere."""
    expected = f"a finite value >= 0 {unit}".rstrip()
    return _where(lambda a: np.isfinite(a) & (a >= 0), argument, value, expected, shape)


def _where(
    fits: Callable[[Array], Any], argument: str, value: Any, expected: str, shape: Shape | None
) -> Array:
    array = as_numbers(argument, value, expected, shape)
    if not np.all(fits(array)):
        raise ArgumentError(argument, value, expected)
    return array


def require_between(argument: str, value: Any, low: float, high: float, unit: str) -> None:
    """Raises ArgumentError unless ``value`` is a number between ``low`` and ``high``, both
    excluded."""
    expected = f"a number between {low:.6g} and {high:.6g} {unit}"
    if not low < as_numbers(argument, value, expected, ()) < high:
        raise ArgumentError(argument, value, expected)


def require_rising(argument: str, value: Any, unit: str) -> Array:
    """``value`` (n,) as an array, n >= 1, finite and increasing. Raises ArgumentError."""
    array = as_numbers(argument, value, f"increasing {unit}", (None,))
    if not (len(array) and np.isfinite(array).all() and (np.diff(array) > 0).all()):
        raise ArgumentError(argument, value, f"increasing {unit}")
    return array


def require_whole(argument: str, value: Any, least: int, expected: str, most: int = 2**63) -> None:
    """Raises ArgumentError unless ``value`` is a whole number in ``least`` .. ``most``."""
    if not (isinstance(value, (int, np.integer)) and _is_real(value) and least <= value <= most):
        raise ArgumentError(argument, value, expected)


def require_choice(argument: str, value: Any, choices: Iterable[str]) -> None:
    """Raises ArgumentError unless ``value`` is one of the texts ``choices``."""
    known = tuple(choices)
    if not (isinstance(value, str) and value in known):
        raise ArgumentError(argument, value, "one of " + ", ".join(known))


def require_flag(argument: str, value: Any) -> None:
    """Raises ArgumentError unless ``value`` is true or false."""
    if not isinstance(value, (bool, np.bool_)):
        raise ArgumentError(argument, value, "true or false")
