"""Errors a user can meet. Each carries the offending value and says what would be right."""

from __future__ import annotations

from typing import Any


class TrajoptError(Exception):
    """Base of every error that trajopt raises on purpose."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Worker processes send errors by pickle, which would call the class with its message
        alone."""
        return _restored, (type(self), self.args, dict(self.__dict__))


def _restored(
    kind: type[TrajoptError], args: tuple[Any, ...], fields: dict[str, Any]
) -> TrajoptError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(fields)
    return error


_LONGEST = 1000  # characters of what would be right: names in it may be of any length; chosen


class ArgumentError(TrajoptError, ValueError):
    """A call got a value it cannot use.

    ``argument`` names it, ``value`` is what came, ``expected`` says what would be right.
    """

    def __init__(self, argument: str, value: Any, expected: str) -> None:
        self.argument, self.value, self.expected = argument, value, expected
        super().__init__(
            printable(f"{_cut(argument)} = {_short(value)}: expected {_cut(expected, _LONGEST)}")
        )


class ProblemError(TrajoptError, ValueError):
    """A problem file holds something wrong.

    ``file``, ``key`` and ``value`` say where, ``expected`` what would be right.
    """

    def __init__(self, file: str, key: str, value: Any, expected: str) -> None:
        self.file, self.key, self.value, self.expected = file, key, value, expected
        super().__init__(
            printable(f"{file}: {_cut(key)} = {_short(value)}: expected {_cut(expected, _LONGEST)}")
        )


class InfeasibleError(TrajoptError):
    """No motion satisfies the limits.

    ``limit`` names the limit that cannot be met, ``place`` the path parameter (same unit as the
    gridpoints) where it fails first.
    """

    def __init__(self, limit: str, place: float, reason: str) -> None:
        self.limit, self.place, self.reason = limit, place, reason
        super().__init__(
            f"infeasible: limit '{limit}' at s = {place:.4g}: {_cut(reason, _LONGEST)}"
        )


class MissingDependencyError(TrajoptError, ImportError):
    """An optional package is not installed. ``extra`` is the pip extra that brings it."""

    def __init__(self, package: str, extra: str, purpose: str) -> None:
        self.package, self.extra, self.purpose = package, extra, purpose
        super().__init__(
            f"{purpose} needs the package '{package}', which is not installed: "
            f"pip install 'wheeled-trajopt[{extra}]' (pybullet has wheels up to CPython 3.11)"
            if package == "pybullet"
            else f"{purpose} needs the package '{package}', which is not installed: "
            f"pip install 'wheeled-trajopt[{extra}]'"
        )


class SimulationError(TrajoptError):
    """A physics engine could not run the scene, or its result is not a motion (NaN, explosion)."""


def printable(text: str, spared: str = "") -> str:
    r"""``text`` with control characters (but the ``spared`` ones) as escapes, so that no name or
    message moves the cursor, changes colours or starts a new line.

    >>> print(printable("a\nb\x1b[31m"))
    a\nb\x1b[31m
    """
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c in spared else c.encode("unicode_escape").decode() for c in text
    )


def _short(value: Any) -> str:
    try:
        return _cut(repr(value))
    except Exception:  # integers of 5,000 digits, lists nested too deep, objects of others
        return f"a {type(value).__name__} that cannot be shown"


def _cut(text: str, limit: int = 120) -> str:
    return text if len(text) <= limit else text[: limit - 3] + "..."
