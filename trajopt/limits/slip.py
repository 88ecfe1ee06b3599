"""Wheel slip: the ground force of every contact stays inside its friction cone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from trajopt.arrays import Array, require_choice, require_whole
from trajopt.errors import ArgumentError
from trajopt.limits.capacity import capacity_rows, friction_used
from trajopt.limits.forces import Affine, specific_force
from trajopt.limits.friction import Friction, coefficients, edges, require_friction
from trajopt.limits.grip import contact_forces, holds_of
from trajopt.limits.limit import Limit, Rows, linear_rows, require_robot
from trajopt.limits.loads import contact_loads
from trajopt.paths.samples import PathSamples
from trajopt.robots.description import Sharing
from trajopt.robots.robot import STANDARD_GRAVITY, Robot


@dataclass(frozen=True)
class Slip(Limit):
    """Friction coefficient ``friction`` between wheels and ground, with load transfer, slope and
    curvature: one number, one a wheel of the robot's file, or a ``FrictionAlong`` or
    ``FrictionMap``. ``rule`` says how wheels share a force that more of them hold than need to; None: as
    the robot's file says with ``sharing``:

    least_norm  each wheel has to hold its own part of the least-norm forces with the right sum and
                yaw moment (``limits/grip.py`` says which wheels hold what): a polygon a wheel that
                holds along and across, two rows one that holds along its roller or across. While it
                holds, no wheel is at its limit; where it breaks, others may still take over.
    capacity    all wheels together hold force and yaw moment, however they share them
                (``limits/capacity.py``): beyond it the robot slides as a whole.
    load        as the loads are, with no regard to the yaw moment, as in [waheed2006]: friction
                times the load of all that hold. Unsafe where an axle also has to hold the body on
                its curve or against a slope. Only for driven fixed and steered wheels.

    The polygon of ``sides`` sides is inscribed in the cone, its corners where the force is straight
    ahead, back, left and right. Between corners it takes up to (pi / sides)^2 / 2 of the friction: 32
    sides cost 0.1 % of time on a slalom where friction binds all along, 16 cost 0.5 %. Capacity is
    exact for wheels that hold in one direction each (Mecanum, omni); for others 32 sides give 256
    rows, which leave out 2.5 %; 7 % where wheels hang on pivots that turn freely.

    Raises ArgumentError for a friction that is not > 0, fewer than 4 sides, a rule that is none of
    these or not for the robot, a robot whose wheels cannot supply the wrench, or no robot.
    """

    friction: Friction  # dimensionless
    sides: int = 32
    rule: Sharing | None = None
    name: str = "slip"

    def __post_init__(self) -> None:
        require_friction(f"{self.name}.friction", self.friction)
        require_whole(
            f"{self.name}.sides", self.sides, 4, "4 or more sides of the friction polygon"
        )
        if self.rule is not None:
            require_choice(f"{self.name}.rule", self.rule, get_args(Sharing))

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        robot = require_robot(self.name, robot)
        whole = self.rule_of(robot) == "capacity"
        found, scale = (self._together if whole else self._each)(path, robot)
        rows = linear_rows(self.name, found.a, found.b, -found.c, scale)
        return replace(rows, edges=edges(self.friction, path, robot))

    def _together(self, path: PathSamples, robot: Robot) -> tuple[Affine, Array]:
        """Rows of capacity, and their size."""
        grips, mu = self._grips(path, robot)
        found, speed = capacity_rows(path, robot, grips, self.sides)
        size = np.tile(np.sum(speed * mu[:, None, :], axis=-1), 2)
        return found, np.broadcast_to(size * STANDARD_GRAVITY / mu.shape[1], found.a.shape)

    def _each(self, path: PathSamples, robot: Robot) -> tuple[Affine, Array]:
        """Rows of shares, and their size."""
        shares, sizes = [], []
        for force, grip, size in self.shares(path, robot):
            pair = force.a.shape[1] == 2
            normals = normals_of(self.sides) if pair else np.array([[1.0], [-1.0]])
            inside = np.cos(np.pi / self.sides) if pair else 1.0
            shares.append(force.through(normals) - grip * inside)
            sizes.append(np.broadcast_to(size * STANDARD_GRAVITY, shares[-1].a.shape))
        return Affine.beside(*shares), np.hstack(sizes)

    def needed(self, path: PathSamples, robot: Robot, sdd: Array, sd2: Array) -> Array:
        """(N,): how many times the friction there is a state s'' and s'^2 (N,) needs, with the cone
        itself; inf where a wheel that must hold carries no load."""
        if self.rule_of(robot) == "capacity":
            return friction_used(path, robot, self._grips(path, robot)[0].at(sdd, sd2), sdd, sd2)
        worst = np.zeros(len(path.s))
        for force, grip, _ in self.shares(path, robot):
            used = np.linalg.norm(force.at(sdd, sd2), axis=1)
            load = grip.at(sdd, sd2)[:, 0]
            with np.errstate(divide="ignore", invalid="ignore"):
                share = np.where(load > 0, used / load, np.where(used > 0, np.inf, 0.0))
            worst = np.maximum(worst, share)
        return worst

    def rule_of(self, robot: Robot) -> Sharing:
        """The rule, or the robot's."""
        return robot.description.sharing if self.rule is None else self.rule

    def _grips(self, path: PathSamples, robot: Robot) -> tuple[Affine, Array]:
        """Friction times load (N, K), and friction (N or 1, K), of every wheel."""
        mu = coefficients(f"{self.name}.friction", self.friction, path, robot)
        return contact_loads(path, robot) * mu, mu

    def shares(self, path: PathSamples, robot: Robot) -> list[tuple[Affine, Affine, Array]]:
        """Force (N, 1 or 2), friction times load (N, 1), and friction (N or 1, 1) times share of
        the weight, for every wheel or for all together."""
        holds = holds_of(robot)
        grips, mu = self._grips(path, robot)
        if self.rule_of(robot) == "load":
            if not holds.all_drive:
                expected = f"least_norm or capacity: '{robot.name}' has wheels that hold in one direction or swivel"
                raise ArgumentError(f"{self.name}.rule", "load", expected)
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


def normals_of(sides: int) -> Array:
    """(sides, 2): outward normals of a polygon with a corner straight ahead."""
    angles = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    return np.column_stack([np.cos(angles), np.sin(angles)])
