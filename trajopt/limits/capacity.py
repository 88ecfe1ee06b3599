"""What all wheels hold together: more, and the robot slides as a whole.

A wheel at the end of its friction keeps pulling, and the others take what more there is to hold. A
force and yaw moment w can be held exactly where no way y of sliding would cost friction less than w
gives: y . w <= sum mu N |v(y)|, with v the velocity of each wheel's contact in the directions in
which it holds. y is a velocity and yaw rate of the body; pivots that turn freely turn as costs least.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from trajopt.arrays import Array
from trajopt.limits.forces import Affine, cross
from trajopt.limits.grip import Holds, ground_wrench, holds_of, wrench_of_forces
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot

_TURNS = 6  # rounds in which pivots find how they turn
_ROUNDS = 200  # of weights, in ``friction_used``; chosen: to about 1e-4
# rad, over the root of the number of ways: how far off the nearest is (measured: 3.4 to 3.6)
_REACH = 3.6
_GOLDEN = (np.sqrt(5) - 1) / 2  # of a turn between neighbours: spreads any number evenly
_SLOWEST = 1e-7  # of the fastest contact: slower ones count as that fast
_LIGHTEST = 1e-9  # of the largest load: wheels without load count as that heavy
_NOTHING = 1e-300
# Pivots turn as costs least with the loads at rest, not with those of the motion, which is up to 4 %
# too hopeful (measured)
_PIVOTS = 0.955


def capacity_rows(
    path: PathSamples, robot: Robot, grips: Affine, sides: int
) -> tuple[Affine, Array]:
    """(N, 2 R): y . w - sum mu N |v(y)|, which stays <= 0 for every y of a set, then those for -y;
    and |v(y)| (R, K) or (N, R, K) of every wheel. ``grips`` (N, K) is mu N.

    Where every wheel holds in one direction the set is all there is to check: the sums of such
    forces are a body with a face for every pair of them. Else it is a net of about sides^2 / 4 ways,
    even in the axes in which forces of one size reach equally far, and what friction holds is taken
    smaller by as much as the net is too coarse for.
    """
    holds, matrix = holds_of(robot), wrench_of_forces(path, robot)
    forces, inside, faces = matrix[..., :3, :], 1.0, _faces(holds, matrix)
    if faces is not None:
        ways = faces
    else:
        net, inside = _net(sides)
        lower = np.asarray(np.linalg.cholesky(forces @ forces.swapaxes(-1, -2)), np.float64)
        even = np.asarray(np.linalg.inv(lower), np.float64)
        ways = np.concatenate([net @ even, _edges(holds, forces, lower, even, sides)], axis=-2)
    moving = ways @ forces
    if holds.free:
        inside *= _PIVOTS
        moving = moving + _turned(holds, moving, matrix, grips.c)
    speed = _speeds(holds, moving, grips.c.shape[1])
    given, cost = ground_wrench(path, robot).through(ways), grips.through(speed) * inside
    return Affine.beside(given - cost, given * -1.0 - cost), speed


def _speeds(holds: Holds, moving: Array, wheels: int) -> Array:
    """(..., K): of every wheel's contact, from those in all directions (..., F)."""
    speed = np.zeros((*moving.shape[:-1], wheels))
    for wheel in holds.wheels:
        speed[..., wheel] = np.linalg.norm(moving[..., holds.columns(int(wheel))], axis=-1)
    return speed


def friction_used(path: PathSamples, robot: Robot, grips: Array, sdd: Array, sd2: Array) -> Array:
    """(N,): the least share of mu N (N, K) that suffices at states s'' and s'^2 (N,) if all wheels
    use the same; inf where loads do not allow any.

    The dearest way of sliding for the motion's w: the least cost at y . w = 1, by weighted least
    squares, whose weights mu N / |v| are set anew each round. Every round bounds the share from
    below.
    """
    holds, matrix = holds_of(robot), wrench_of_forces(path, robot)
    asked = np.zeros((len(sdd), matrix.shape[-2]))
    asked[:, :3] = ground_wrench(path, robot).at(sdd, sd2)
    grips = np.maximum(grips, _LIGHTEST * np.abs(grips).max(axis=1, keepdims=True))
    faces = _faces(holds, matrix)
    if faces is not None:
        cost = grips @ _speeds(holds, faces @ matrix, grips.shape[1]).T
        return np.asarray((np.abs(asked @ faces.T) / cost).max(axis=1))
    weight, found = grips[:, holds.wheel], np.zeros(len(sdd))
    for _ in range(_ROUNDS):
        squares = (matrix * weight[:, None, :]) @ matrix.swapaxes(-1, -2)
        way = np.linalg.solve(squares, asked[..., None])[..., 0]
        speed = _speeds(holds, (way[:, None, :] @ matrix)[:, 0], grips.shape[1])
        given, cost = np.sum(way * asked, axis=1), np.sum(grips * speed, axis=1)
        found = np.maximum(found, given / np.maximum(cost, _NOTHING))
        relative = speed / np.maximum(speed.max(axis=1, keepdims=True), _NOTHING)
        weight = (grips / np.maximum(relative, _SLOWEST))[:, holds.wheel]
    return found


def _turned(holds: Holds, moving: Array, matrix: Array, grips: Array) -> Array:
    """(N, R, F): what pivots that turn freely add to contacts' velocities ``moving`` (N, R, F), at
    the rate that costs friction least with loads times friction ``grips`` (N, K)."""
    added = np.zeros(moving.shape)
    for k, group in enumerate(holds.free):
        arm, parts, mine = matrix[..., 3 + k, None, :], [], []
        for wheel in group:
            own = holds.columns(int(wheel))
            p, q = moving[..., own], np.broadcast_to(arm[..., own], (*moving.shape[:-1], len(own)))
            squares = [np.einsum("...k,...k->...", *pair) for pair in ((p, p), (p, q), (q, q))]
            parts.append((np.maximum(grips[:, None, wheel], _LIGHTEST), *squares))
            mine += own.tolist()
        rate = np.zeros(moving.shape[:-1])
        for _ in range(_TURNS):
            above, below = np.zeros_like(rate), np.full_like(rate, _NOTHING)
            for grip, pp, pq, qq in parts:
                size = np.sqrt(np.maximum(pp + rate * (2 * pq + rate * qq), _SLOWEST**2))
                above, below = above + grip * pq / size, below + grip * qq / size
            rate = -above / below
        added[..., mine] = rate[..., None] * arm[..., mine]
    return added


def _edges(holds: Holds, forces: Array, lower: Array, even: Array, sides: int) -> Array:
    """(..., R, 3): ways of sliding at which what the wheels hold has edges: those that let a wheel
    stand that holds along and across, and of one that holds in one direction a round of those across
    it."""
    found, turns = [], np.pi * np.arange(sides)[:, None] / sides
    for wheel in holds.wheels:
        mine = [forces[..., None, :, k] for k in holds.columns(int(wheel))]
        if len(mine) == 2:
            found.append(cross(mine[0], mine[1]))
            continue
        aside = np.stack([-mine[0][..., 1], mine[0][..., 0], 0 * mine[0][..., 0]], axis=-1) @ lower
        other = cross(mine[0] @ even.swapaxes(-1, -2), aside)
        aside, other = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in (aside, other))
        found.append((aside * np.cos(turns) + other * np.sin(turns)) @ even)
    return np.concatenate(found, axis=-2)


def _faces(holds: Holds, matrix: Array) -> Array | None:
    """(R, 3): normals, one way, of the faces of all sums of forces (3, F) of bounded size; None
    where not every wheel holds in one direction of the body."""
    if len(holds.wheels) < len(holds.wheel) or holds.free or matrix.ndim == 3:
        return None
    a, b = np.triu_indices(matrix.shape[1], 1)
    normals = cross(matrix[:, a].T, matrix[:, b].T)
    return np.asarray(normals[np.linalg.norm(normals, axis=1) > _SLOWEST])


@lru_cache(maxsize=8)
def _net(sides: int) -> tuple[Array, float]:
    """(R, 3): unit vectors that, with their opposites, spread evenly over the sphere, and the cosine
    of the largest angle from anywhere to the nearest."""
    count = max(sides**2 // 16, 4)
    x = (np.arange(count) + 0.5) / count
    turn = np.pi * ((np.arange(count) * _GOLDEN) % 1.0)
    across = np.sqrt(1 - x**2)
    net = np.column_stack([x, across * np.cos(turn), across * np.sin(turn)])
    # the same seen in a mirror, which keeps what is ahead and turns the rest
    net = np.vstack([net, net * [1.0, -1.0, -1.0]])
    return net, float(np.cos(_REACH / np.sqrt(2 * len(net))))
