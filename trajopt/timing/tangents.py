"""Limits that are not linear in (s'', s'^2), by passes that are repeated.

Rows of such a limit at a profile (``Limit.linear``) are exact there and stricter elsewhere. So each
profile that the passes find keeps the limit, and the next, with rows at it, is as fast or faster
everywhere: they rise to the profile whose rows are taken at itself, by Newton's steps (each doubles
the digits). The first guess is one from above, the motion with the torques of rest. Where its rows
leave no motion (a slope that only a slower one holds, an end that must be reached fast), the guess
falls towards what the start can reach, until they do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import InfeasibleError
from trajopt.limits.limit import Limit, is_linear
from trajopt.timing.stages import FineRows, tangent
from trajopt.timing.track import Track

Solve = Callable[[FineRows], tuple[Array, str]]

_SETTLED = 1e-6  # relative change of s'^2 that ends the repetition: the next is its square; chosen
_MOST = 100  # passes; chosen: 6 are usual
_SMALL = 1e-3  # of the largest s'^2, chosen: below it, rounding counts more than what is gained
_STUCK = 1e-6  # relative change of a guess that ends the search for a better one; chosen
_FALL = 4.0  # most by which a guess of s'^2 falls at once: rows near rest allow a few times as much
_UNKNOWN = 1.0  # m^2/s^2, guess where only such limits bound the motion; chosen


def settled(
    track: Track,
    limits: Sequence[Limit],
    fine: FineRows,
    solve: Solve,
    reach: Callable[[FineRows], Array],
) -> tuple[FineRows, Array, str]:
    """Rows, s'^2 at the gridpoints, and engine of the fastest profile; ``fine`` has rows without a
    profile, ``solve`` gives profile and engine for rows, ``reach`` the profile of driving on from
    the start as fast as rows allow. Raises what ``solve`` raises."""
    if all(is_linear(limit) for limit in limits):
        return fine, *solve(fine)
    try:
        sd2, name = solve(fine)
    except InfeasibleError as error:
        if error.limit != "none":
            raise
        bounds = np.append(fine.bounds[:, 0].min(axis=1), fine.bounds[-1, -1].min())
        sd2, name = np.minimum(bounds, _UNKNOWN), ""
    highest, found, rows = sd2, False, fine
    for _ in range(_MOST):
        rows = tangent(track, fine, limits, sd2)
        before = sd2
        try:
            sd2, name = solve(rows)
            found = True
        except InfeasibleError:
            sd2 = np.clip(reach(rows), before / _FALL, highest)
            if found or _near(sd2, before, _STUCK):
                raise
        if found and _near(sd2, before, _SETTLED):
            break
    return rows, sd2, name


def _near(new: Array, old: Array, share: float) -> bool:
    return bool(np.all(np.abs(new - old) <= share * (new + _SMALL * new.max())))
