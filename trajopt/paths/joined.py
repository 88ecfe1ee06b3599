"""Paths of several pieces, each driven forward or backward, with a stop where they meet."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import AnyArray, Array, IndexArray, fold
from trajopt.errors import ArgumentError
from trajopt.paths.path import Path, row
from trajopt.paths.segments import SegmentPath
from trajopt.paths.spline import SplineBasis

_MEET = 1e-6  # m and rad between pieces that meet; chosen: as points that coincide


@dataclass(frozen=True)
class JoinedPath(Path):
    """Pieces one after the other, made by ``Path.join`` and ``Path.backward``; ``signs`` are 1 of
    those that are driven forward, -1 of those driven backward."""

    parts: tuple[Path, ...] = ()
    signs: tuple[int, ...] = ()

    plain: ClassVar[bool] = False

    @property
    def orders(self) -> int:  # type: ignore[override]
        return max(part.orders for part in self.parts)

    @cached_property
    def _starts(self) -> tuple[Array, Array]:
        """(M+1,) each: spline and path parameters where pieces begin, and at the end."""
        lengths = [part.length for part in self.parts]
        return self._knots[self._firsts], np.concatenate([[0.0], np.cumsum(lengths)])

    @cached_property
    def _firsts(self) -> IndexArray:
        """(M+1,): which cell each piece begins with, and how many there are."""
        return np.cumsum([0, *(len(part.basis.knots) - 1 for part in self.parts)])

    def _by_part(
        self, starts: ArrayLike, places: AnyArray, value: Callable[[int, IndexArray], Array]
    ) -> Array:
        """``value`` of each piece at those places (N,) that lie in it, of the piece to the right where
        two meet."""
        which = np.searchsorted(starts, places, side="right") - 1
        which = np.clip(which, 0, len(self.parts) - 1)
        order = [np.flatnonzero(which == k) for k in range(len(self.parts))]
        found = [value(k, at) for k, at in enumerate(order)]
        whole = np.empty((len(places), *found[0].shape[1:]))
        for at, values in zip(order, found, strict=True):
            whole[at] = values
        return whole

    def _inside(self, i: IndexArray, t: Array, derivative: int) -> Array:
        def value(k: int, at: IndexArray) -> Array:
            part = self.parts[k]
            if derivative > part.orders:
                return np.zeros((len(at), part.coordinates.shape[1]))
            return part._inside(i[at] - self._firsts[k], t[at], derivative)

        return self._by_part(self._firsts, i, value)

    def _swept(self, i: IndexArray, t: Array, h: Array, reach: float) -> Array:
        def value(k: int, at: IndexArray) -> Array:
            return self.parts[k]._swept(i[at] - self._firsts[k], t[at], h[at], reach)

        return self._by_part(self._firsts, i, value)

    @cached_property
    def _cubics(self) -> tuple[Array, Array]:
        return self._knots, np.concatenate([part._cubics[1] for part in self.parts])

    def facing(self, u: ArrayLike) -> Array:
        signs = np.array(self.signs, dtype=np.float64)
        return self._by_part(self._starts[0], row("u", u), lambda k, at: np.full(len(at), signs[k]))

    @property
    def joints(self) -> Array:
        return self._starts[0][1:-1]

    @property
    def jumps(self) -> Array:
        cells = zip(self._firsts[:-1], self.parts, strict=True)
        at = [first + np.searchsorted(part.basis.knots, part.jumps) for first, part in cells]
        return np.asarray(self._knots[np.concatenate(at)])

    def standstill(self, share: float) -> float | None:
        for u, part in zip(self._starts[0][:-1], self.parts, strict=True):
            place = part.standstill(share)
            if place is not None:
                return float(u) + place - part.start
        return None

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        return self._starts

    def parameter(self, u: ArrayLike) -> Array:
        places, (starts, s) = row("u", u), self._starts

        def value(k: int, at: IndexArray) -> Array:
            part = self.parts[k]
            return np.asarray(s[k] + part.parameter(places[at] - starts[k] + part.start))

        return self._by_part(starts, places, value)

    def locate(self, s: ArrayLike) -> Array:
        places, (u, starts) = np.clip(row("s", s), 0.0, self.length), self._starts

        def value(k: int, at: IndexArray) -> Array:
            part = self.parts[k]
            return np.asarray(u[k] + part.locate(places[at] - starts[k]) - part.start)

        return self._by_part(starts, places, value)


def backward(path: Path) -> Path:
    """See ``Path.backward``."""
    if path.heading is not None:
        expected = "a path along its heading: one of its own says which way the robot faces"
        raise ArgumentError("heading", "given", expected)
    if isinstance(path, JoinedPath):
        return _made(path.parts, tuple(-sign for sign in path.signs))
    return _made((path,), (-1,))


def joined(pieces: Sequence[Path]) -> Path:
    """See ``Path.join``."""
    if not isinstance(pieces, (list, tuple)) or not pieces:
        raise ArgumentError("pieces", pieces, "a list of paths")
    parts, signs = list[Path](), list[int]()
    for n, piece in enumerate(pieces):
        if not isinstance(piece, Path) or not (
            piece.plain or isinstance(piece, (JoinedPath, SegmentPath))
        ):
            raise ArgumentError(f"pieces[{n}]", piece, "a Path, not yet laid on a ground")
        if n:
            _require_meeting(n, pieces[n - 1], piece)
        parts += piece.parts if isinstance(piece, JoinedPath) else [piece]
        signs += piece.signs if isinstance(piece, JoinedPath) else [1]
    return _made(tuple(parts), tuple(signs))


def _made(parts: tuple[Path, ...], signs: tuple[int, ...]) -> Path:
    knots, start = [0.0], 0.0
    for part in parts:
        knots += [start + (knot - part.start) for knot in part.basis.knots[1:]]
        start = knots[-1]
    points = [parts[0].points, *(part.points[1:] for part in parts[1:])]
    heading = None
    if parts[0].heading is not None:
        yaws = [part.yaw(np.asarray(part.basis.knots)) for part in parts]
        heading = np.concatenate([yaws[0], *(yaw[1:] for yaw in yaws[1:])])
    return JoinedPath(
        SplineBasis(tuple(knots)),
        np.concatenate(points),
        heading,
        parts[0].turning_length,
        parts,
        signs,
    )


def _require_meeting(n: int, before: Path, after: Path) -> None:
    """Raises ArgumentError, with place and distance, where piece ``n`` does not go on as the one
    before ends."""
    if before.coordinates.shape[1] != after.coordinates.shape[1]:
        dimensions = before.coordinates.shape[1]
        value = f"points of {after.coordinates.shape[1]} numbers"
        raise ArgumentError(f"pieces[{n}]", value, f"points of {dimensions}, as the piece before")
    if (before.heading is None) != (after.heading is None):
        expected = "one with a heading of its own, as the piece before, or none of both"
        raise ArgumentError(f"pieces[{n}]", "another kind of heading", expected)
    if before.heading is not None and before.turning_length != after.turning_length:
        expected = f"{before.turning_length!r} m, as of the piece before"
        raise ArgumentError(f"pieces[{n}].turning_length", after.turning_length, expected)
    last, first = before.position([before.end])[0], after.position([after.start])[0]
    apart = float(np.linalg.norm(first - last))
    if not apart <= _MEET:
        raise ArgumentError(
            f"pieces[{n}]",
            f"a start at {_place(first)} m",
            f"one at {_place(last)} m, where the piece before ends, {apart:.3g} m away",
        )
    yaw, new = before.yaw([before.end])[0], after.yaw([after.start])[0]
    off = new - yaw if before.heading is not None else fold(float(new - yaw))
    if not abs(off) <= _MEET:
        raise ArgumentError(
            f"pieces[{n}]",
            f"a robot that faces {new:.9g} rad at its start, at {_place(first)} m",
            f"{yaw:.9g} rad, as it does where the piece before ends (driven backward it faces "
            "against the direction of travel)",
        )


def _place(p: Array) -> str:
    return "(" + ", ".join(f"{c:.9g}" for c in p.tolist()) + ")"
