"""Wheel slip: the ground force of every contact stays inside its friction cone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trajopt.arrays import Array, require_whole
from trajopt.limits.forces import Affine, contact_loads, specific_force
from trajopt.limits.friction import Friction, coefficients, edges, require_friction
from trajopt.limits.grip import contact_forces, holds_of
from trajopt.limits.limit import Rows, linear_rows, require_robot
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import STANDARD_GRAVITY, Robot


@dataclass(frozen=True)
class Slip:
    """Friction coefficient ``friction`` between wheels and ground, with load transfer, slope and
    curvature: one number, one a wheel of the robot's file, or a ``FrictionAlong`` or
    ``FrictionMap``.

    Where driven fixed or steered wheels alone hold the robot, they share the force as their loads
    allow: ||(f_x, f_y)|| <= friction times their load, and the yaw moment is not counted. With
    ``per_wheel``, and for all other robots, each wheel has to hold its own share, the least-norm
    forces with the right sum and yaw moment (``limits/grip.py`` says which wheels hold what): a
    polygon a wheel that holds along and across, two rows one that holds along its roller or across.
    This is stricter, as two wheels on one axle also have to hold the body on its curve.

    The polygon of ``sides`` sides is inscribed in the cone, its corners where the force is straight
    ahead, back, left and right. Between corners it takes up to (pi / sides)^2 / 2 of the friction: 32
    sides cost 0.1 % of time on a slalom where friction binds all along, 16 cost 0.5 %.

    Raises ArgumentError for a friction that is not > 0, fewer than 4 sides, a robot whose wheels
    cannot supply the wrench, or no robot.
    """

    friction: Friction  # dimensionless
    sides: int = 32
    per_wheel: bool = False
    name: str = "slip"

    def __post_init__(self) -> None:
        require_friction(f"{self.name}.friction", self.friction)
        require_whole(
            f"{self.name}.sides", self.sides, 4, "4 or more sides of the friction polygon"
        )

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        shares, sizes, robot = [], [], require_robot(self.name, robot)
        for force, grip, size in self._shares(path, robot):
            normals = _normals(self.sides) if force.a.shape[1] == 2 else np.array([[1.0], [-1.0]])
            inside = np.cos(np.pi / self.sides) if force.a.shape[1] == 2 else 1.0
            shares.append(force.through(normals) - grip * inside)
            sizes.append(np.broadcast_to(size * STANDARD_GRAVITY, shares[-1].a.shape))
        found = Affine.beside(*shares)
        rows = linear_rows(self.name, found.a, found.b, -found.c, np.hstack(sizes))
        return replace(rows, edges=edges(self.friction, path, robot))

    def needed(self, path: PathSamples, robot: Robot, sdd: Array, sd2: Array) -> Array:
        """(N,): how many times the friction there is a state s'' and s'^2 (N,) needs, with the cone
        itself; inf where a wheel that must hold carries no load."""
        worst = np.zeros(len(path.s))
        for force, grip, _ in self._shares(path, robot):
            used = np.linalg.norm(force.at(sdd, sd2), axis=1)
            load = grip.at(sdd, sd2)[:, 0]
            with np.errstate(divide="ignore", invalid="ignore"):
                share = np.where(load > 0, used / load, np.where(used > 0, np.inf, 0.0))
            worst = np.maximum(worst, share)
        return worst

    def _shares(self, path: PathSamples, robot: Robot) -> list[tuple[Affine, Affine, Array]]:
        """Force (N, 1 or 2), friction times load (N, 1), and friction (N or 1, 1) times share of
        the weight, for every wheel or for all together."""
        holds = holds_of(robot)
        mu = coefficients(f"{self.name}.friction", self.friction, path, robot)
        grips = contact_loads(path, robot) * mu
        if not self.per_wheel and holds.all_drive:
            both = np.isin(np.arange(mu.shape[1]), holds.wheels).astype(np.float64)[None, :]
            force = specific_force(path, robot.body).through(np.eye(2, 3))
            mean = mu[:, holds.wheels].mean(axis=1, keepdims=True)
            return [(force, grips.through(both), mean)]
        forces, found = contact_forces(path, robot), []
        for i in holds.wheels:
            columns = holds.columns(int(i))
            here = slice(columns[0], columns[-1] + 1)
            size = mu[:, i : i + 1] / mu.shape[1]
            found.append((forces[here], grips[slice(i, i + 1)], size))
        return found


def _normals(sides: int) -> Array:
    """(sides, 2): outward normals of a polygon with a corner straight ahead."""
    angles = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    return np.column_stack([np.cos(angles), np.sin(angles)])
