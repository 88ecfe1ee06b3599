"""The least time in which wheels of limited speed can bring a robot to its goal pose: a proof.

Wheel i turns at J_i (v, w), with the body's velocity v and yaw rate w, and no faster than
``saturation`` (S). On a motion whose headings stay in [a, b], take a world vector p and a number q
such that for each heading y there (R(-y) p, q) and (R(-y) p, -q) lie in the hull of all +-J_i.
Then p . v + q |w| <= S at each instant, so that

    S T >= p . d + q (2 (b - a) - |turn|)

for the way d and the turn to the goal, since a motion that visits a and b turns that much. The
bound is the least over all [a, b] of the largest over p and q: on a grid, widened so that it holds
between its places (the turn of the smaller interval, the hull over the larger one).
"""

from __future__ import annotations

from heapq import heappop, heappush
from typing import TYPE_CHECKING

import numpy as np

from trajopt.arrays import Array

if TYPE_CHECKING:
    from trajopt.objectives.terminal import TerminalObjective

_STEP = np.deg2rad(0.25)  # of headings, chosen
_ASIDE = np.linspace(-0.8, 0.8, 13)  # rad, of p from the way, chosen: any choice is a valid bound
_SHARES = np.geomspace(0.5, 2.0, 61)  # of q, chosen likewise


def impossible(objective: TerminalObjective) -> str:
    """Why no motion reaches the goal pose, with what would do; empty where that is not proved."""
    if objective.actuator.is_ideal or objective.kinematics is not None:
        return ""
    task, longest = objective.problem.search, objective.nominal_duration
    if "duration_s" in objective.names:
        longest = float(objective.bounds[objective.names.index("duration_s"), 1])
    speed = objective.actuator.saturation
    start, goal = np.array(task.start), np.array(task.goal)
    least = least_time(objective.model.inverse, speed, start, goal, longest)
    if least <= longest:
        return ""
    return (
        f"no motion reaches the goal pose in {longest:g} s: wheels of {speed:g} rad/s need "
        f"{least:.4g} s at least, or {speed * least / longest:.4g} rad/s (actuator.duration, "
        "actuator.saturation)"
    )


def least_time(inverse: Array, saturation: float, start: Array, goal: Array, given: float) -> float:
    """Seconds that a motion between two poses (3,) takes at least; 0 where some motion takes no
    more than ``given``, or the wheels do not move the body in all directions.

    ``inverse`` (W, 3): body velocity to wheel speeds, rad/s.
    """
    way, turn = goal[:2] - start[:2], float(goal[2] - start[2])
    if np.linalg.matrix_rank(inverse) < 3 or not np.isfinite(saturation):
        return 0.0
    low, high = min(start[2], goal[2]), max(start[2], goal[2])
    most = np.pi / 2  # of an excursion: by then each wheel row has met each direction
    beyond = np.arange(0.0, most + _STEP, _STEP)
    inside = np.linspace(low, high, 2 + int(abs(turn) / _STEP))
    every = np.concatenate([low - beyond, inside, high + beyond])
    turning = np.abs(inverse[:, 2]).max() * (high - low)
    for simple in (_straight, _pieces):
        if given >= (turning + simple(inverse, way, every, low, high)) / saturation:
            return 0.0
    reached = low - beyond, inside, high + beyond
    return _bound(inverse, way, reached, abs(turn)) / saturation


def _straight(inverse: Array, way: Array, headings: Array, low: float, high: float) -> float:
    """Wheel travel, rad, of a straight way at the best heading, and of turning there and back."""
    along = np.abs(_in_body(way, headings) @ inverse[:, :2].T).max(axis=1)
    aside = np.maximum(np.maximum(low - headings, headings - high), 0.0)
    there_and_back = 2 * float(np.abs(inverse[:, 2]).max()) * aside
    return float((along + there_and_back).min())


def _pieces(inverse: Array, way: Array, headings: Array, low: float, high: float) -> float:
    """Wheel travel, rad, of straight pieces of way at headings between the first and the last."""
    angle = np.linspace(0.0, 2 * np.pi, 181)[:-1]
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    reached = around / np.abs(around @ inverse[:, :2].T).max(axis=1)[:, None]  # by 1 rad of travel
    support = _support(around, headings[(headings >= low) & (headings <= high)], reached)
    return float((around @ way / support).max() / np.cos(np.pi / 180))


def _support(around: Array, headings: Array, reached: Array) -> Array:
    """(n,): how far the places ``reached`` (k, 2) of bodies with these headings lie in each
    direction ``around`` (n, 2)."""
    seen = np.concatenate([_in_body(u, headings) for u in around])
    return np.asarray((seen @ reached.T).max(axis=1).reshape(len(around), -1).max(axis=1))


def _bound(inverse: Array, way: Array, headings: tuple[Array, ...], turn: float) -> float:
    from scipy.spatial import ConvexHull

    hull = ConvexHull(np.concatenate([inverse, -inverse])).equations
    facets = hull[:, :3] / -hull[:, 3:]
    angle = np.arctan2(way[1], way[0]) + _ASIDE
    vectors = np.column_stack([np.cos(angle), np.sin(angle)])
    ahead = (vectors @ way)[:, None]
    reach = np.abs(inverse[:, 2]).max() / np.hypot(*inverse[:, :2].T).min()
    q = reach * _SHARES
    sizes = []  # (headings, directions, shares): of (R(-y) p, +-q), as a multiple of the hull
    for places in headings:
        flat = np.stack([_in_body(vector, places) for vector in vectors], axis=1) @ facets[:, :2].T
        sizes.append((flat[:, :, None] + q[:, None] * np.abs(facets[:, 2])).max(axis=3))
    between = 1 / np.cos(_STEP / 2)
    below, above = (np.maximum.accumulate(sizes[i], axis=0) * between for i in (0, 2))
    middle = sizes[1].max(axis=0) * between

    def cell(
        i: tuple[int, int], j: tuple[int, int]
    ) -> tuple[float, tuple[int, int], tuple[int, int]]:
        """The bound for excursions of i and j steps beyond the two headings."""
        size = np.maximum(np.maximum(below[i[1]], middle), above[j[1]])
        gain = ahead + q * (turn + 2 * _STEP * (i[0] + j[0]))
        return float((gain / size).max()), i, j

    cells = [cell((0, len(below) - 1), (0, len(above) - 1))]
    while True:  # the cell with the least bound is split until it is a place
        bound, i, j = heappop(cells)
        longer = max(i, j, key=lambda span: span[1] - span[0])
        middle_of = sum(longer) // 2
        if middle_of == longer[0]:
            return bound
        for half in ((longer[0], middle_of), (middle_of, longer[1])):
            heappush(cells, cell(half, j) if longer is i else cell(i, half))


def _in_body(vector: Array, headings: Array) -> Array:
    """(n, 2): a vector of the world as bodies with these headings see it."""
    c, s = np.cos(headings), np.sin(headings)
    return np.column_stack([c * vector[0] + s * vector[1], c * vector[1] - s * vector[0]])
