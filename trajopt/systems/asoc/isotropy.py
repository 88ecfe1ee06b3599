"""Kinematic isotropy of robots on split offset casters ([udengaard2008], sections 2.1-2.5).

Isotropy is the smallest over the largest *singular value* of a Jacobian, yaw weighed by an explicit
length. "inverse" is the matrix from body twist to wheel speeds, W(alpha) = [F(alpha_i)^-1 [I,
p_perp_i / length]]; "forward" that from wheel speeds to body twist of eq. 2, the mean of the
modules' F(alpha_i). Without tilt and with all wheels down they agree on average. Table I follows
from "inverse" (wheels off the ground have no row), Table II from "forward". The average over
independent, uniform module angles is taken after the ratio.

The average is a quasi-Monte-Carlo rule (rank-1 lattice, random shifts), good for the periodic
integrand here; the spread of the shifts is the stated error. Singular values come from the 3 x 3
Gram matrix W^T W.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from trajopt.arrays import Array, require_positive
from trajopt.errors import ArgumentError

Jacobian = Literal["inverse", "forward"]

POINTS = 4096  # of the lattice; error below 1e-3 on all of Table I, chosen
SHIFTS = 8  # random shifts, for the error; chosen
_SINGULAR = 1e-13  # eigenvalues below this share of the largest are rounding: no motion that way
_KOROBOV = (
    76  # Korobov generator of the lattice: a good one for up to 8 angles, found by trial (chosen)
)


@dataclass(frozen=True)
class MeanIsotropy:
    """``value`` in [0, 1] and its standard ``error`` from independent shifts of the quadrature."""

    value: float
    error: float


@dataclass(frozen=True)
class Contact:
    """Which wheels of N modules touch the ground: module numbers without contact and with one wheel
    only.

    A module in ``partial`` keeps its wheel 2 (by symmetry of the average either gives the same).
    """

    lost: tuple[int, ...] = ()
    partial: tuple[int, ...] = ()


def spread_modules(count: int) -> Array:
    """(N, 2): equally spaced module axes on the unit circle."""
    angles = 2 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(angles), np.sin(angles)])


def isotropy(
    positions: ArrayLike,
    ratio: float | ArrayLike,
    alpha: ArrayLike,
    *,
    contact: Contact | None = None,
    tilt: ArrayLike = 0.0,
    length: float = 1.0,
    jacobian: Jacobian = "inverse",
) -> Array:
    """(n,): smallest over largest singular value at module angles ``alpha`` (n, N), rad.

    ``positions`` (N, 2) of the module axes (m), ``ratio`` = split/offset, ``tilt`` (rad, broadcast
    to (n, N)) of the axles, ``length`` (m) that weighs yaw. Raises ArgumentError for shapes that do
    not fit.
    """
    p, a, contact = _checked(positions, alpha, contact or Contact())
    require_positive("length", length, "m")
    if jacobian not in ("inverse", "forward"):
        raise ArgumentError("jacobian", jacobian, "inverse or forward")
    effective = np.broadcast_to(np.asarray(ratio) * np.cos(tilt), a.shape)
    if not np.all(effective > 0):
        raise ArgumentError(
            "ratio", np.asarray(ratio).tolist(), "split/offset > 0, tilts below 90 deg"
        )
    gram = np.zeros((6, len(a)))
    for i in range(len(p)):
        if i in contact.lost:
            continue
        half = effective[:, i] / 2
        for side in (1.0,) if i in contact.partial else (-1.0, 1.0):
            # a row of F^-1 [I, p_perp], the wheel side * split/2 beside the axis
            # (asoc.module_inverse)
            across = side * half if jacobian == "inverse" else -side / half  # a row of F^T, twice
            x = np.cos(a[:, i]) + across * np.sin(a[:, i])
            y = np.sin(a[:, i]) - across * np.cos(a[:, i])
            z = (-p[i, 1] * x + p[i, 0] * y) / length
            gram += np.stack([x * x, y * y, z * z, x * y, x * z, y * z])
    return ratio_from_gram(gram)


def ratio_from_gram(gram: Array) -> Array:
    """(n,): smallest over largest singular value of W from W^T W given as (6, n): xx, yy, zz, xy,
    xz, yz.

    Eigenvalues of symmetric 3 x 3 matrices by the trigonometric formula [smith1961].
    """
    xx, yy, zz, xy, xz, yz = gram
    mean = (xx + yy + zz) / 3
    dx, dy, dz = xx - mean, yy - mean, zz - mean
    off = xy * xy + xz * xz + yz * yz
    spread = np.sqrt((dx * dx + dy * dy + dz * dz + 2 * off) / 6)
    det = dx * (dy * dz - yz * yz) - xy * (xy * dz - yz * xz) + xz * (xy * yz - dy * xz)
    round_ = spread <= 1e-14 * mean
    cosine = np.clip(det / np.where(round_, 1.0, 2 * spread**3), -1.0, 1.0)
    angle = np.arccos(cosine) / 3
    largest = mean + 2 * spread * np.cos(angle)
    smallest = mean + 2 * spread * np.cos(angle + 2 * np.pi / 3)
    share = np.where(smallest > _SINGULAR * largest, smallest, 0.0) / largest
    return np.asarray(np.where(round_, 1.0, np.sqrt(share)))


def mean_isotropy(
    positions: ArrayLike,
    ratio: float,
    *,
    rng: Generator,
    contact: Contact | None = None,
    tilts: Sequence[float] = (0.0,),
    length: float = 1.0,
    jacobian: Jacobian = "inverse",
    points: int = POINTS,
    shifts: int = SHIFTS,
) -> MeanIsotropy:
    """Mean of ``isotropy`` over uniform module angles, and over ``tilts`` (rad) drawn by each
    module independently with equal chance: every combination counts, as in the thesis's full
    factorial.

    Raises ArgumentError for no tilt, fewer than 2 shifts or no points.
    """
    p = np.asarray(positions, dtype=np.float64)
    if len(tilts) == 0 or points < 1 or shifts < 2:
        raise ArgumentError(
            "points", (len(tilts), points, shifts), "tilts, >= 1 point and >= 2 shifts"
        )
    levels, weights = _tilt_levels(tilts)
    combinations = np.stack(
        np.meshgrid(*[np.arange(len(levels))] * len(p), indexing="ij"), -1
    ).reshape(-1, len(p))
    grid = np.outer(np.arange(points), float(_KOROBOV) ** np.arange(len(p)) % points) / points
    means = []
    for _ in range(shifts):
        alpha = 2 * np.pi * ((grid + rng.random(len(p))) % 1.0)
        means.append(
            sum(
                float(np.prod(weights[c]))
                * float(
                    isotropy(
                        p,
                        ratio,
                        alpha,
                        contact=contact,
                        tilt=levels[c],
                        length=length,
                        jacobian=jacobian,
                    ).mean()
                )
                for c in combinations
            )
        )
    return MeanIsotropy(float(np.mean(means)), float(np.std(means, ddof=1) / np.sqrt(shifts)))


def _tilt_levels(tilts: Sequence[float]) -> tuple[Array, Array]:
    """Distinct |tilt| and their chances: isotropy depends on the cosine only."""
    levels, counts = np.unique(np.abs(np.asarray(tilts, dtype=np.float64)), return_counts=True)
    return levels, counts / counts.sum()


def _checked(
    positions: ArrayLike, alpha: ArrayLike, contact: Contact
) -> tuple[Array, Array, Contact]:
    p, a = np.asarray(positions, dtype=np.float64), np.asarray(alpha, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 2 or not np.all(np.isfinite(p)):
        raise ArgumentError("positions", p.tolist(), "finite module positions, shape (N, 2), m")
    if a.ndim != 2 or a.shape[1] != len(p):
        raise ArgumentError("alpha", a.shape, f"shape (n, {len(p)}): one angle a module, rad")
    named = (*contact.lost, *contact.partial)
    if len(set(named)) < len(named) or any(not 0 <= i < len(p) for i in named):
        raise ArgumentError("contact", contact, f"each module 0..{len(p) - 1} at most once")
    if len(contact.lost) == len(p):
        raise ArgumentError("contact", contact, "at least one wheel on the ground")
    return p, a, contact
