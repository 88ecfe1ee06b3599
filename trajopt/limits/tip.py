"""Tip-over: the zero-moment point stays inside the support polygon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, require_not_negative
from trajopt.errors import ArgumentError
from trajopt.limits.limit import Limit, Rows, linear_rows, require_robot
from trajopt.limits.loads import supports
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import STANDARD_GRAVITY, Robot

_SMALLEST = 1e-3  # m, chosen: an edge nearer to the centre of gravity is scaled as if that far
_COINCIDE = 1e-9  # m


@dataclass(frozen=True)
class Tip(Limit):
    """No tipping fore, aft or sideways; ``reserve`` (m) keeps the zero-moment point that far
    inside.

    The load on the far side of every edge of the support polygon (the convex hull of the contacts,
    with the middle of an axle that tilts for its wheels: ``limits/loads.py``) stays >= 0: n . (sum
    x N, sum y N) <= d sum N, with n the outward normal of the edge and d its distance from the foot
    of the centre of gravity. On level ground that is -h n . (f_x, f_y) <= d f_z, for two axles N_A
    >= 0, N_B >= 0 and h |f_y| <= w f_z; where an axle tilts, h counts from its height across it.
    One row an edge, or a place of support where castors swivel; contact with the ground (f_z >= 0)
    follows from them. Raises ArgumentError for a reserve < 0, a centre of gravity outside the
    support, or no robot.
    """

    reserve: float = 0.0  # m
    name: str = "tip"

    def __post_init__(self) -> None:
        require_not_negative(f"{self.name}.reserve", self.reserve, "m")

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        robot = require_robot(self.name, robot)
        arms, demand = supports(path, robot)
        normals, distances = support_edges(arms) if arms.ndim == 2 else moving_edges(arms)
        distances = distances - self.reserve
        if arms.ndim == 2 and np.any(distances <= 0):
            raise ArgumentError(
                f"{self.name}: robot.body.cog",
                robot.body.cog,
                f"a centre of gravity more than {self.reserve} m inside the support polygon",
            )
        over = np.concatenate([-distances[..., None], normals], axis=-1)
        over = over / np.maximum(distances, _SMALLEST)[..., None]
        value = demand.through(over)
        return linear_rows(self.name, value.a, value.b, -value.c, STANDARD_GRAVITY)


def support_edges(arms: Array) -> tuple[Array, Array]:
    """Outward normals (E, 2) of the support polygon's edges, and distances (E,) of the cog's foot
    from them, for contacts (C, 2) from the centre of gravity.

    Raises ArgumentError when the contacts lie on one line.
    """
    hull = _convex_hull(arms)
    if len(hull) < 3:
        raise ArgumentError(
            "robot.body.contacts", arms.tolist(), "three or more contacts not on one line"
        )
    edge = np.roll(hull, -1, axis=0) - hull
    normals = np.column_stack([edge[:, 1], -edge[:, 0]]) / np.hypot(edge[:, 0], edge[:, 1])[:, None]
    return normals, np.sum(normals * hull, axis=1)


def moving_edges(arms: Array) -> tuple[Array, Array]:
    """As ``support_edges`` for contacts (N, C, 2): normals (N, C, 2), distances (N, C). As many
    edges as contacts: what is too many gets (0, 0) and 1 m, which never binds."""
    corners = [int(np.argmin(np.sum((arms[0] - p) ** 2, axis=1))) for p in _convex_hull(arms[0])]
    hull = arms[:, corners]
    edge = np.roll(hull, -1, axis=1) - hull
    length = np.hypot(edge[..., 0], edge[..., 1])
    if len(corners) > 2 and length.min() > _COINCIDE:
        normals = np.stack([edge[..., 1], -edge[..., 0]], axis=-1) / length[..., None]
        distances = np.sum(normals * hull, axis=2)
        reach = normals @ arms.swapaxes(1, 2)
        if np.all(reach <= distances[..., None] + 1e-12):
            # the same contacts are the corners everywhere
            spare = arms.shape[1] - len(corners)
            return (
                np.pad(normals, ((0, 0), (0, spare), (0, 0))),
                np.pad(distances, ((0, 0), (0, spare)), constant_values=1.0),
            )
    return _edges_from_each(arms)


def _edges_from_each(arms: Array) -> tuple[Array, Array]:
    """The edge that starts at each contact, or (0, 0) and 1 m where none does."""
    edge = arms[:, None] - arms[:, :, None]  # (N, from, to, 2)
    turn = edge[:, :, :, None, 0] * edge[:, :, None, :, 1]
    turn = turn - edge[:, :, :, None, 1] * edge[:, :, None, :, 0]
    length = np.hypot(edge[..., 0], edge[..., 1])
    outer = (turn.min(axis=3) >= -1e-12) & (length > _COINCIDE)
    after = np.argmax(np.where(outer, length, -1.0), axis=2)[..., None, None]
    along = np.take_along_axis(edge, after, axis=2)[:, :, 0]
    starts = np.take_along_axis(outer, after[..., 0], axis=2)
    size = np.where(starts, np.hypot(along[..., 0], along[..., 1])[..., None], 1.0)
    normals = np.where(starts, np.stack([along[..., 1], -along[..., 0]], axis=-1) / size, 0.0)
    return normals, np.where(starts[..., 0], np.sum(normals * arms, axis=2), 1.0)


def _convex_hull(points: Array) -> Array:
    """Corners counter-clockwise (monotone chain: sort, then keep left turns)."""
    ordered = sorted({(float(x), float(y)) for x, y in points})
    chains: list[list[tuple[float, float]]] = []
    for sweep in (ordered, ordered[::-1]):
        chain: list[tuple[float, float]] = []
        for p in sweep:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], p) <= 1e-12:
                chain.pop()
            chain.append(p)
        chains.append(chain[:-1])
    return np.array(chains[0] + chains[1])


def _turn(o: tuple[float, float], a: tuple[float, float], b: tuple[float, float]) -> float:
    return (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])
