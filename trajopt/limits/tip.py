"""Tip-over: the zero-moment point stays inside the support polygon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, require_not_negative
from trajopt.errors import ArgumentError
from trajopt.limits.forces import contact_arms, specific_force
from trajopt.limits.limit import Rows, linear_rows, require_robot
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import STANDARD_GRAVITY, Body, Robot


@dataclass(frozen=True)
class Tip:
    """No tipping fore, aft or sideways; ``reserve`` (m) keeps the zero-moment point that far
    inside.

    The load on the far side of every edge of the support polygon (the convex hull of the contacts)
    stays >= 0: -h n . (f_x, f_y) <= d f_z, with n the outward normal of the edge and d its distance
    from the foot of the centre of gravity. For two axles these are N_A >= 0, N_B >= 0 and h |f_y|
    <= w f_z. One row an edge; contact with the ground (f_z >= 0) follows from them.
    Raises ArgumentError for a reserve < 0, a centre of gravity outside the support, or no robot.
    """

    reserve: float = 0.0  # m
    name: str = "tip"

    def __post_init__(self) -> None:
        require_not_negative(f"{self.name}.reserve", self.reserve, "m")

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        body = require_robot(self.name, robot).body
        normals, distances = support_edges(body)
        distances = distances - self.reserve
        if np.any(distances <= 0):
            raise ArgumentError(
                f"{self.name}: robot.body.cog",
                body.cog,
                f"a centre of gravity more than {self.reserve} m inside the support polygon",
            )
        lever = np.column_stack(
            [-normals * (body.cog[2] / distances)[:, None], -np.ones(len(normals))]
        )
        value = specific_force(path, body).through(lever)
        return linear_rows(self.name, value.a, value.b, -value.c, STANDARD_GRAVITY)


def support_edges(body: Body) -> tuple[Array, Array]:
    """Outward normals (E, 2) of the support polygon's edges, and distances (E,) of the cog's foot
    from them.

    Raises ArgumentError when the contacts lie on one line.
    """
    hull = _convex_hull(contact_arms(body))
    if len(hull) < 3:
        raise ArgumentError(
            "robot.body.contacts", body.contacts, "three or more contacts not on one line"
        )
    edge = np.roll(hull, -1, axis=0) - hull
    normals = np.column_stack([edge[:, 1], -edge[:, 0]]) / np.hypot(edge[:, 0], edge[:, 1])[:, None]
    return normals, np.sum(normals * hull, axis=1)


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
